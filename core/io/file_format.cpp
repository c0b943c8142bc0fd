#include "core/io/file_format.h"

#include <algorithm>
#include <cctype>
#include <cstring>
#include <stdexcept>
#include <string>

#include "core/io/formats/byte_reader.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

namespace fs = std::filesystem;

std::string_view name(FileFormat format) {
    switch (format) {
        case FileFormat::png:
            return "PNG";
        case FileFormat::tiff:
            return "TIFF";
        case FileFormat::metaImage:
            return "MetaImage";
        case FileFormat::nrrd:
            return "NRRD";
        case FileFormat::nifti:
            return "NIfTI";
        case FileFormat::dicom:
            return "DICOM";
        case FileFormat::dicomFolder:
            return "DICOM folder";
        case FileFormat::stl:
            return "STL";
        case FileFormat::obj:
            return "OBJ";
        case FileFormat::ply:
            return "PLY";
        case FileFormat::json:
            return "JSON";
        case FileFormat::unknown:
            return "unknown";
    }
    throw std::logic_error("FileFormat outside its enumeration");
}

namespace {

std::string lowerExtension(const fs::path& path) {
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return extension;
}

// DICOM without preamble and "DICM" (older archives): little-endian elements of group 0008 in rising order.
bool looksLikeBareDicom(std::string_view head) {
    if (head.size() < 16 || head.substr(0, 2) != std::string_view("\x08\0", 2) || head[3] != 0) return false;
    const std::string_view vr = head.substr(4, 2);
    return vr == "UI" || vr == "CS" || vr == "UL" || vr == "DA" || (head[6] == 0 && head[7] == 0);
}

bool looksLikeMetaImage(std::string_view head) {
    for (const std::string_view key : {"ObjectType", "NDims", "Comment", "ObjectSubType"}) {
        if (!head.starts_with(key)) continue;
        const auto after = head.find_first_not_of(" \t", key.size());
        return after != std::string_view::npos && (head[after] == '=' || head[after] == ':');
    }
    return false;
}

}  // namespace

Result<FileFormat> detectFormat(const fs::path& path) {
    std::error_code code;
    if (fs::is_directory(path, code)) return FileFormat::dicomFolder;
    const Result<std::string> beginning = readBeginning(path, 512);
    if (!beginning) return beginning.error();
    const std::string_view head = *beginning;
    if (head.starts_with("\x89PNG\r\n\x1a\n")) return FileFormat::png;
    for (const std::string_view mark : {std::string_view("II*\0", 4), std::string_view("MM\0*", 4),
                                        std::string_view("II+\0", 4), std::string_view("MM\0+", 4)}) {
        if (head.starts_with(mark)) return FileFormat::tiff;
    }
    if (head.starts_with("NRRD000")) return FileFormat::nrrd;
    if (head.size() >= 132 && head.substr(128, 4) == "DICM") return FileFormat::dicom;
    if (head.starts_with("ply\n") || head.starts_with("ply\r")) return FileFormat::ply;
    if (looksLikeMetaImage(head)) return FileFormat::metaImage;
    if (looksLikeNifti(path)) return FileFormat::nifti;
    if (looksLikeBareDicom(head)) return FileFormat::dicom;
    const std::string extension = lowerExtension(path);
    if (extension == ".stl") return FileFormat::stl;
    if (extension == ".obj") return FileFormat::obj;
    const auto first = head.find_first_not_of(" \t\r\n");
    if (first != std::string_view::npos && head[first] == '{') return FileFormat::json;
    return FileFormat::unknown;
}

}  // namespace fluorocut
