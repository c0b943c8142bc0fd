// Rasters: what MetaImage, NRRD and NIfTI have in common. Each format's file knows its header; reading the elements
// (raw or zlib/gzip, either byte order, any number type) and checking what the header declares is done once, here.
//
// These three headers are a page each, and hostile ones must be refused before any memory is taken, so we read them
// ourselves; ITK is what the tests compare us with.
//
// A header is believed only after checkRaster: sizes within limits and within what the file can hold, spacing finite
// and between 1e-4 and 1e4 mm, directions orthonormal within 1e-3. Geometry is in DICOM LPS, mm.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

constexpr std::int64_t kMaxAxis = 1 << 17;              // pixels along any axis
constexpr std::uint64_t kMaxImagePixels = 1ull << 27;   // 512 MB as float
constexpr std::uint64_t kMaxVolumeVoxels = 1ull << 30;  // 4 GB as float: 512 x 512 x 4096

enum class ElementType { uint8, int8, uint16, int16, uint32, int32, uint64, int64, float32, float64 };

std::size_t byteCount(ElementType type);
bool isSigned(ElementType type);
bool isFloating(ElementType type);

struct RasterHeader {
    std::string format;
    int dimensions = 3;  // 2 or 3 as declared
    std::array<std::int64_t, 3> size{1, 1, 1};
    bool has_spacing = true;
    Vector3 spacing_mm = Vector3::Ones();
    Vector3 origin_mm = Vector3::Zero();
    Matrix3 direction = Matrix3::Identity();  // columns: the axes
    ElementType type = ElementType::uint8;
    bool big_endian = false;
    bool compressed = false;
    std::filesystem::path data_file;
    std::uint64_t data_offset = 0;    // in the file
    std::uint64_t inflated_skip = 0;  // bytes to pass over after inflating (the header of a .nii.gz)
    double slope = 1;                 // value = slope * stored + intercept
    double intercept = 0;
    std::vector<std::string> notes;

    std::uint64_t count() const {
        return static_cast<std::uint64_t>(size[0]) * static_cast<std::uint64_t>(size[1]) *
               static_cast<std::uint64_t>(size[2]);
    }
};

Result<RasterHeader> readMetaImageHeader(const std::filesystem::path& path);
Result<RasterHeader> readNrrdHeader(const std::filesystem::path& path);
Result<RasterHeader> readNiftiHeader(const std::filesystem::path& path);
bool looksLikeNifti(const std::filesystem::path& path);

Result<void> checkRaster(const std::filesystem::path& path, RasterHeader& header, std::uint64_t max_elements);

// `count` elements from element `first` on, as float. Memory grows with what is really in the file.
Result<std::vector<float>> readRaster(const std::filesystem::path& path, const RasterHeader& header,
                                      std::uint64_t first, std::uint64_t count, Progress& progress);

// What a writer is given. `type` is one of uint8, int16, uint16, float32; values must fit (see encodeElements).
struct RasterView {
    int dimensions = 3;
    std::array<int, 3> size{1, 1, 1};
    Vector3 spacing_mm = Vector3::Ones();
    Vector3 origin_mm = Vector3::Zero();
    Matrix3 direction = Matrix3::Identity();
    const std::vector<float>* values = nullptr;
    ElementType type = ElementType::float32;
    bool compressed = false;
};

Result<void> writeMetaImage(const std::filesystem::path& path, const RasterView& raster);
Result<void> writeNrrd(const std::filesystem::path& path, const RasterView& raster);
Result<void> writeNifti(const std::filesystem::path& path, const RasterView& raster);  // compressed for .nii.gz

// Little-endian elements. Integers are rounded; a value outside the type's range, or NaN, is an invalidOption error.
Result<std::string> encodeElements(const std::filesystem::path& path, const std::vector<float>& values,
                                   ElementType type);

// Header text: "a, b c" split at blanks and commas; whole-text number parsing that refuses rests and NaN.
std::string_view trimmed(std::string_view text);
std::vector<std::string_view> words(std::string_view text, std::string_view separators = " \t");
bool parseNumber(std::string_view text, double& value);
bool parseInteger(std::string_view text, std::int64_t& value);
std::string lower(std::string_view text);

// A text from a file, safe to show in a message: printable, at most 60 characters; `printable` without the quotes.
std::string shown(std::string_view text);
std::string printable(std::string_view text);

}  // namespace fluorocut
