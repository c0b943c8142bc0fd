#include "core/casestore/content.h"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <system_error>

#include "core/casestore/sha256.h"
#include "core/io/image_file.h"

namespace fluorocut {

namespace fs = std::filesystem;

ScratchFile::ScratchFile(const std::string& file_name) {
    std::error_code failed;
    std::string folder = (fs::temp_directory_path(failed) / "fluorocut-XXXXXX").string();
    if (!failed && mkdtemp(folder.data()) != nullptr) {
        folder_ = folder;
        path_ = folder_ / file_name;
    }
}

ScratchFile::~ScratchFile() {
    std::error_code ignored;
    if (!folder_.empty()) fs::remove_all(folder_, ignored);
}

Result<std::string> ScratchFile::bytes() const {
    std::ifstream stream(path_, std::ios::binary);
    if (!stream) return outputFailed(path_.string(), "a scratch file that cannot be read", "free the disk");
    return std::string(std::istreambuf_iterator<char>(stream), {});
}

Result<void> ScratchFile::fill(std::string_view bytes) const {
    std::ofstream stream(path_, std::ios::binary);
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    stream.close();
    if (folder_.empty() || !stream)
        return outputFailed("scratch file", "a folder for temporary files that takes none", "free the disk");
    return {};
}

Result<std::string> bytesOf(const std::string& file_name, const std::function<Result<void>(const fs::path&)>& write) {
    const ScratchFile file(file_name);
    if (const Result<void> written = write(file.path()); !written) return written.error();
    return file.bytes();
}

std::string CaseContentItem::hash() const {
    return sha256(bytes);
}

Result<CaseContentItem> imageItem(const std::string& name, const Image& image) {
    bool whole = true;
    for (const float level : image.pixels())
        whole = whole && level >= 0 && level <= 65535 && level == std::floor(level);
    const std::string file_name = name + (whole ? ".png" : ".mha");
    Result<std::string> bytes =
        bytesOf(file_name, [&](const fs::path& path) -> Result<void> { return writeImage(path, image); });
    if (!bytes) return bytes.error();
    CaseContentItem made;
    made.item.kind = ItemKind::image;
    made.item.schema = whole ? "image/png" : "image/x-metaimage";
    made.item.file_name = file_name;
    made.bytes = std::move(*bytes);
    return made;
}

Result<Image> imageFrom(const std::string& file_name, std::string_view bytes) {
    Result<ImageFile> file = readBytes(file_name, bytes, [](const fs::path& path) { return readImage(path); });
    if (!file) return file.error();
    return std::move(file->image);
}

}  // namespace fluorocut
