// What a file is, by its content (the extension decides only where a format has no mark of its own: OBJ, and STL).
#pragma once

#include <filesystem>
#include <string_view>

#include "core/base/result.h"

namespace fluorocut {

enum class FileFormat { png, tiff, metaImage, nrrd, nifti, dicom, dicomFolder, stl, obj, ply, json, unknown };

std::string_view name(FileFormat format);

// Fails when the path does not exist, cannot be read or is empty. A folder is taken for a DICOM folder.
Result<FileFormat> detectFormat(const std::filesystem::path& path);

}  // namespace fluorocut
