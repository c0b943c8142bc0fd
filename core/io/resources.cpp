#include "core/io/resources.h"

#include <algorithm>
#include <cstdlib>

namespace fluorocut {

namespace fs = std::filesystem;

namespace {

constexpr const char* kVariable = "FLUOROCUT_RESOURCES";

bool isFolder(const fs::path& path) {
    std::error_code ignored;
    return fs::is_directory(path, ignored);
}

}  // namespace

Result<fs::path> resourceFolder() {
    if (const char* named = std::getenv(kVariable); named != nullptr && *named != '\0') {
        if (isFolder(named)) return fs::path(named);
        return invalidInput(std::string("environment variable ") + kVariable, std::string("\"") + named + "\"",
                            "an existing folder", "correct it or unset it");
    }
    std::error_code code;
    const fs::path program = fs::read_symlink("/proc/self/exe", code);
    const fs::path installed = program.parent_path().parent_path() / "share" / "fluorocut";
    if (!code && isFolder(installed)) return installed;
    const fs::path source = FLUOROCUT_SOURCE_RESOURCES;
    if (isFolder(source)) return source;
    return invalidInput("the data that comes with FluoroCut",
                        "neither " + installed.string() + " nor " + source.string(), "one of these folders",
                        std::string("install it again or set ") + kVariable);
}

std::vector<std::string> resourceNames(std::string_view kind) {
    std::vector<std::string> names;
    const Result<fs::path> folder = resourceFolder();
    if (!folder) return names;
    std::error_code code;
    for (fs::directory_iterator entry(*folder / kind, code), end; !code && entry != end; entry.increment(code)) {
        if (entry->path().extension() == ".json") names.push_back(entry->path().stem().string());
    }
    std::sort(names.begin(), names.end());
    return names;
}

Result<fs::path> findResource(std::string_view kind, const std::string& name) {
    std::error_code ignored;
    if (fs::exists(name, ignored)) return fs::path(name);
    const std::vector<std::string> names = resourceNames(kind);
    // Only what is listed: a name with folders in it leads nowhere else.
    if (std::find(names.begin(), names.end(), name) != names.end()) {
        const Result<fs::path> folder = resourceFolder();
        if (!folder) return folder.error();
        return *folder / kind / (name + ".json");
    }
    std::string known;
    for (const std::string& other : names)
        known += (known.empty() ? "" : ", ") + other;
    return invalidInput(name, "no file of that name",
                        "a file" + (known.empty() ? std::string() : ", or one of those built in: " + known));
}

}  // namespace fluorocut
