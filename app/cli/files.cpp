#include "app/cli/files.h"

#include <algorithm>
#include <cctype>

#include <unistd.h>

#include "core/distortion/distortion_map.h"
#include "core/imaging/carm_file.h"

namespace fluorocut::cli {

namespace fs = std::filesystem;

namespace {

bool isInside(const fs::path& path, const fs::path& folder) {
    std::error_code code;
    const fs::path relative = fs::relative(path, folder, code);  // follows links
    return !code && !relative.empty() && *relative.begin() != "..";
}

}  // namespace

Result<CArm> readImager(const std::filesystem::path& path) {
    return readCArm(path, distortionReaders());
}

std::string extensionOf(const fs::path& path) {
    std::string extension = path.extension().string();
    if (extension == ".gz") extension = path.stem().extension().string() + extension;
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return extension;
}

Result<void> checkOutput(const fs::path& output, const std::vector<fs::path>& inputs,
                         const std::vector<std::string>& extensions) {
    const std::string where = "output " + output.string();
    std::string known;
    for (const std::string& extension : extensions)
        known += (known.empty() ? "" : " ") + extension;
    const std::string extension = extensionOf(output);
    if (std::find(extensions.begin(), extensions.end(), extension) == extensions.end()) {
        return invalidOption(where, extension.empty() ? "no extension" : "extension " + extension, "one of " + known);
    }
    std::error_code code;
    const fs::path folder = output.has_parent_path() ? output.parent_path() : fs::path(".");
    if (!fs::is_directory(folder, code)) {
        return invalidOption(where, "no folder " + folder.string(), "an existing folder");
    }
    if (::access(folder.c_str(), W_OK) != 0) {
        return invalidOption(where, "a folder that cannot be written to, " + folder.string(), "a writable folder");
    }
    if (fs::is_directory(output, code)) return invalidOption(where, "a folder of that name", "a file's name");
    if (!fs::exists(output, code)) return {};
    for (const fs::path& input : inputs) {
        if (fs::equivalent(output, input, code) || (fs::is_directory(input, code) && isInside(output, input))) {
            return invalidOption(where, "the name of an input (" + input.string() + ")",
                                 "a name of its own: inputs are never overwritten");
        }
    }
    return {};
}

}  // namespace fluorocut::cli
