// DICOM as images, as volumes, and Secondary Capture as output; see image_file.h and volume_file.h for what they
// promise.
#pragma once

#include <filesystem>

#include "core/io/image_file.h"
#include "core/io/volume_file.h"

namespace fluorocut {

Result<ImageFile> readDicomImage(const std::filesystem::path& path, const ImageReadOptions& options);
Result<VolumeFile> readDicomFolder(const std::filesystem::path& folder, const VolumeReadOptions& options,
                                   Progress& progress);
// `type` is uint8 or uint16; values have been brought into its range before.
Result<void> writeSecondaryCapture(const std::filesystem::path& path, const Image& image, PixelType type,
                                   const ImageWriteOptions& options);

}  // namespace fluorocut
