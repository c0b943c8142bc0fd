#include "core/io/atomic_file.h"

#include <cerrno>
#include <cstring>
#include <fstream>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace fluorocut {

namespace fs = std::filesystem;

namespace {

bool syncPath(const fs::path& path, int flags) {
    const int file = ::open(path.c_str(), flags);
    if (file < 0) return false;
    const bool synced = ::fsync(file) == 0;
    return (::close(file) == 0) && synced;
}

// Removes the temporary file or folder unless it became the target.
class Remover {
  public:
    explicit Remover(fs::path path) : path_(std::move(path)) {}
    ~Remover() {
        std::error_code ignored;
        if (!path_.empty()) fs::remove_all(path_, ignored);
    }
    Remover(const Remover&) = delete;
    Remover& operator=(const Remover&) = delete;
    void keep() { path_.clear(); }

  private:
    fs::path path_;
};

// "out/" is the folder "out".
fs::path withoutSlash(const fs::path& target) {
    return target.has_filename() ? target : target.parent_path();
}

fs::path folderOf(const fs::path& target) {
    return target.has_parent_path() ? target.parent_path() : fs::path(".");
}

}  // namespace

Result<void> writeWhole(const fs::path& target, const std::function<Result<void>(const fs::path&)>& write) {
    const fs::path folder = folderOf(target);
    std::error_code code;
    if (!fs::is_directory(folder, code)) {
        return outputFailed(target.string(), "no folder " + folder.string(), "create it or name another output");
    }
    if (fs::is_directory(target, code)) {
        return outputFailed(target.string(), "a folder of that name", "name a file");
    }
    std::string pattern = (folder / (".fluorocut-XXXXXX" + target.extension().string())).string();
    const int file = ::mkstemps(pattern.data(), static_cast<int>(target.extension().string().size()));
    if (file < 0) return outputFailed(target.string(), std::string("no file can be made: ") + std::strerror(errno));
    ::fchmod(file, 0644);
    ::close(file);
    Remover remover{fs::path(pattern)};

    const Result<void> written = write(pattern);
    if (!written) return written.error();
    if (!syncPath(pattern, O_RDWR)) {
        return outputFailed(target.string(), std::string("not written to the disk: ") + std::strerror(errno),
                            "free some space");
    }
    fs::rename(pattern, target, code);
    if (code) return outputFailed(target.string(), "cannot be replaced: " + code.message());
    remover.keep();
    syncPath(folder, O_RDONLY | O_DIRECTORY);
    return {};
}

Result<void> writeWhole(const fs::path& target, std::string_view content) {
    return writeWhole(target, [&](const fs::path& temporary) -> Result<void> {
        std::ofstream stream(temporary, std::ios::binary);
        stream.write(content.data(), static_cast<std::streamsize>(content.size()));
        stream.close();
        if (!stream) return outputFailed(target.string(), "not all of it could be written", "free some space");
        return {};
    });
}

Result<void> requireNewFolder(const fs::path& target) {
    const fs::path named = withoutSlash(target), parent = folderOf(named);
    std::error_code code;
    if (named.empty() || !fs::is_directory(parent, code)) {
        return outputFailed(target.string(), "no folder " + parent.string(), "create it or name another output");
    }
    if (fs::exists(named, code) && !(fs::is_directory(named, code) && fs::is_empty(named, code))) {
        return invalidOption("output " + target.string(),
                             fs::is_directory(named, code) ? "a folder that is not empty" : "a file of that name",
                             "a new or an empty folder", "nothing is overwritten: name another one");
    }
    return {};
}

Result<void> writeWholeFolder(const fs::path& target, const std::function<Result<void>(const fs::path&)>& write) {
    if (const Result<void> good = requireNewFolder(target); !good) return good.error();
    const fs::path named = withoutSlash(target), parent = folderOf(named);
    std::error_code code;
    std::string pattern = (parent / ".fluorocut-XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr) {
        return outputFailed(target.string(), std::string("no folder can be made: ") + std::strerror(errno));
    }
    Remover remover{fs::path(pattern)};
    ::chmod(pattern.c_str(), 0755);
    if (const Result<void> written = write(pattern); !written) return written.error();
    syncPath(pattern, O_RDONLY | O_DIRECTORY);
    fs::rename(pattern, named, code);  // takes the place of an empty folder, and of nothing else
    if (code) return outputFailed(target.string(), "cannot be made: " + code.message());
    remover.keep();
    syncPath(parent, O_RDONLY | O_DIRECTORY);
    return {};
}

}  // namespace fluorocut
