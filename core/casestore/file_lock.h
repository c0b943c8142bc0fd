// An advisory lock against two writers of one file: <file>.lock beside it, held with flock(2). A program that dies,
// even by kill -9, gives it back; the file it leaves locks nothing. Used by this folder only.
#pragma once

#include <filesystem>
#include <utility>

#include "core/base/result.h"

namespace fluorocut {

class FileLock {
  public:
    // Fails (outputFailed) at once when somebody holds it, in this program or another.
    static Result<FileLock> take(const std::filesystem::path& file);
    ~FileLock();
    FileLock(FileLock&& other) noexcept
        : path_(std::move(other.path_)), descriptor_(std::exchange(other.descriptor_, -1)) {}
    FileLock& operator=(FileLock&&) = delete;

  private:
    FileLock(std::filesystem::path path, int descriptor) : path_(std::move(path)), descriptor_(descriptor) {}

    std::filesystem::path path_;
    int descriptor_;
};

}  // namespace fluorocut
