// What files hold, as bytes in the case, and back: by the readers and writers of files, through a scratch file, so that
// what lies in a case is what lies in a file. For those who write cases: the procedure, the desktop.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.h"
#include "core/casestore/case_store.h"
#include "core/image/image.h"

namespace fluorocut {

// A file of its own in a folder of its own, both removed with it.
class ScratchFile {
  public:
    explicit ScratchFile(const std::string& file_name);
    ~ScratchFile();
    ScratchFile(const ScratchFile&) = delete;
    ScratchFile& operator=(const ScratchFile&) = delete;

    const std::filesystem::path& path() const { return path_; }
    Result<std::string> bytes() const;
    Result<void> fill(std::string_view bytes) const;

  private:
    std::filesystem::path folder_, path_;
};

// What `write` puts into the file that it is given.
Result<std::string> bytesOf(const std::string& file_name,
                            const std::function<Result<void>(const std::filesystem::path&)>& write);

// What `read` makes of a file with these bytes.
template <class Read>
auto readBytes(const std::string& file_name, std::string_view bytes, const Read& read)
    -> decltype(read(std::filesystem::path())) {
    const ScratchFile file(file_name);
    if (const Result<void> filled = file.fill(bytes); !filled) return filled.error();
    auto value = read(file.path());
    if (value) return value;
    Error error = value.error();
    if (const auto at = error.where.find(file.path().string()); at != std::string::npos)
        error.where.replace(at, file.path().string().size(), file_name);
    return error;
}

// Something to be put into the case.
struct CaseContentItem {
    Item item;
    std::string bytes;

    std::string hash() const;
};

// Without loss: 16-bit PNG where that holds every level, MetaImage of floats otherwise. `name`: without extension.
Result<CaseContentItem> imageItem(const std::string& name, const Image& image);
Result<Image> imageFrom(const std::string& file_name, std::string_view bytes);

}  // namespace fluorocut
