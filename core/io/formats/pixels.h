// What the readers of image formats share.
#pragma once

#include <filesystem>
#include <vector>

#include "core/base/result.h"
#include "core/io/image_file.h"
#include "core/io/volume_file.h"

namespace fluorocut {

// PNG and TIFF through libpng and libtiff. `type` is uint8, uint16 or float32 (TIFF only); values have been brought
// into the integer type's range before.
Result<ImageFile> readPng(const std::filesystem::path& path, const ImageReadOptions& options);
Result<void> writePng(const std::filesystem::path& path, const Image& image, PixelType type);
Result<void> writePng(const std::filesystem::path& path, const ColorImage& figure);
Result<ImageFile> readTiff(const std::filesystem::path& path, const ImageReadOptions& options);
Result<VolumeFile> readTiffStack(const std::filesystem::path& path, const VolumeReadOptions& options,
                                 Progress& progress);
Result<void> writeTiff(const std::filesystem::path& path, const Image& image, PixelType type);

// A frame outside 1..frames, in words.
Result<void> checkFrame(const std::filesystem::path& path, int frame, int frames);

// Width and height within limits, and no more pixels than a file of this size can hold with `bytes_per_pixel` at the
// compression's best `ratio`.
Result<void> checkImageSize(const std::filesystem::path& path, std::uint64_t width, std::uint64_t height,
                            double bytes_per_pixel, double ratio);

// Interleaved red, green, blue (and more) to luminance; says so unless all pixels are grey.
std::vector<float> luminance(const std::vector<float>& samples, std::size_t channels, std::vector<std::string>& notes);

// least + most - v for every pixel.
void mirrorValues(std::vector<float>& values, double least, double most);

}  // namespace fluorocut
