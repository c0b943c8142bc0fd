#include "core/casestore/file_lock.h"

#include <cerrno>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

namespace fluorocut {
namespace {

// Whoever held the lock before may have removed the file between our opening and our locking it.
bool isStillThere(int descriptor, const std::filesystem::path& path) {
    struct stat held {
    }, named{};
    return ::fstat(descriptor, &held) == 0 && ::stat(path.c_str(), &named) == 0 && held.st_ino == named.st_ino &&
           held.st_dev == named.st_dev;
}

std::string holderOf(int descriptor) {
    char text[16] = {};
    const ssize_t size = ::pread(descriptor, text, sizeof text - 1, 0);
    const std::string process(text, size > 0 ? static_cast<std::size_t>(size) : 0);
    if (process.empty() || process.find_first_not_of("0123456789") != std::string::npos) return {};
    return " (process " + process + ")";
}

}  // namespace

Result<FileLock> FileLock::take(const std::filesystem::path& file) {
    const std::filesystem::path path = file.string() + ".lock";
    while (true) {
        const int descriptor = ::open(path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC | O_NOFOLLOW, 0644);
        if (descriptor < 0) {
            return outputFailed(path.string(), std::string("cannot be made: ") + std::strerror(errno),
                                "use a folder that can be written");
        }
        FileLock lock(path, descriptor);
        if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
            const bool is_held = errno == EWOULDBLOCK;
            const std::string why = is_held ? "open for writing in another place" + holderOf(descriptor)
                                            : std::string("cannot be locked: ") + std::strerror(errno);
            ::close(std::exchange(lock.descriptor_, -1));  // not ours to remove
            return outputFailed(file.string(), why, is_held ? "close it there first" : "");
        }
        if (!isStillThere(descriptor, path)) {
            ::close(std::exchange(lock.descriptor_, -1));
            continue;
        }
        const std::string process = std::to_string(::getpid());
        if (::ftruncate(descriptor, 0) != 0 || ::pwrite(descriptor, process.data(), process.size(), 0) < 0) {
            return outputFailed(path.string(), std::string("cannot be written: ") + std::strerror(errno));
        }
        return lock;
    }
}

FileLock::~FileLock() {
    if (descriptor_ < 0) return;
    ::unlink(path_.c_str());
    ::close(descriptor_);
}

}  // namespace fluorocut
