#include "core/io/image_file.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "core/io/file_format.h"
#include "core/io/formats/byte_reader.h"
#include "core/io/formats/dicom.h"
#include "core/io/formats/pixels.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

namespace fs = std::filesystem;

std::string_view name(SpacingPlane plane) {
    switch (plane) {
        case SpacingPlane::none:
            return "none";
        case SpacingPlane::unstated:
            return "unstated";
        case SpacingPlane::detector:
            return "detector";
        case SpacingPlane::calibrated:
            return "calibrated";
    }
    throw std::logic_error("SpacingPlane outside its enumeration");
}

std::string_view name(IntensityScale scale) {
    switch (scale) {
        case IntensityScale::unstated:
            return "unstated";
        case IntensityScale::linear:
            return "linear";
        case IntensityScale::logarithmic:
            return "logarithmic";
        case IntensityScale::display:
            return "display";
    }
    throw std::logic_error("IntensityScale outside its enumeration");
}

namespace {

Result<ImageFile> readRasterImage(const fs::path& path, Result<RasterHeader> header, const ImageReadOptions& options) {
    if (!header) return header.error();
    if (Result<void> checked = checkRaster(path, *header, kMaxVolumeVoxels); !checked) return checked.error();
    const int frames = static_cast<int>(header->size[2]);
    if (Result<void> frame = checkFrame(path, options.frame, frames); !frame) return frame.error();
    const std::uint64_t pixels = header->count() / static_cast<std::uint64_t>(frames);
    if (pixels > kMaxImagePixels) {
        return invalidInput(path.string(), fmt::format("{} pixels", pixels),
                            fmt::format("at most {}", kMaxImagePixels));
    }
    Result<std::vector<float>> values =
        readRaster(path, *header, static_cast<std::uint64_t>(options.frame - 1) * pixels, pixels, Progress::none());
    if (!values) return values.error();
    ImageFile result;
    result.info.format = header->format;
    result.info.frames = frames;
    result.info.frame = options.frame;
    result.info.bits = static_cast<int>(8 * byteCount(header->type));
    result.info.is_float = isFloating(header->type);
    result.info.is_signed = isSigned(header->type);
    if (header->has_spacing) {
        result.info.pixel_spacing_mm = header->spacing_mm.head<2>();
        result.info.spacing_plane = SpacingPlane::unstated;
    }
    result.image = Image(static_cast<int>(header->size[0]), static_cast<int>(header->size[1]), std::move(*values));
    return result;
}

Result<ImageFile> readByFormat(const fs::path& path, const ImageReadOptions& options) {
    const Result<FileFormat> format = detectFormat(path);
    if (!format) return format.error();
    switch (*format) {
        case FileFormat::png:
            return readPng(path, options);
        case FileFormat::tiff:
            return readTiff(path, options);
        case FileFormat::metaImage:
            return readRasterImage(path, readMetaImageHeader(path), options);
        case FileFormat::nrrd:
            return readRasterImage(path, readNrrdHeader(path), options);
        case FileFormat::dicom:
            return readDicomImage(path, options);
        default:
            return invalidInput(
                path.string(),
                *format == FileFormat::unknown ? std::string("content of no known format") : std::string(name(*format)),
                "an image (PNG, TIFF, MHA, NRRD or DICOM)");
    }
}

// Least and most of the finite pixels; how many are not.
void survey(ImageFile& file) {
    std::size_t unknown = 0;
    float least = INFINITY, most = -INFINITY;
    for (const float value : file.image.pixels()) {
        if (!std::isfinite(value)) {
            ++unknown;
            continue;
        }
        least = std::min(least, value);
        most = std::max(most, value);
    }
    if (unknown > 0) file.info.notes.push_back(fmt::format("{} pixels are not finite (no measurement there)", unknown));
    if (least <= most) {
        file.info.least = least;
        file.info.most = most;
    }
    file.info.width = file.image.width();
    file.info.height = file.image.height();
}

}  // namespace

Result<ImageFile> readImage(const fs::path& path, const ImageReadOptions& options) {
    Result<ImageFile> file = withinMemory(path, [&] { return readByFormat(path, options); });
    if (file) survey(*file);
    return file;
}

Result<void> writeImage(const fs::path& path, const Image& image, const ImageWriteOptions& options) {
    if (image.empty()) throw std::logic_error("writeImage: an empty image");
    const std::string extension = lower(path.extension().string());
    const bool integers_only = extension == ".png" || extension == ".dcm";
    PixelType type = options.type;
    if (type == PixelType::automatic) type = integers_only ? PixelType::uint16 : PixelType::float32;
    if (type == PixelType::float32 && integers_only) {
        return invalidOption(path.string(), "float pixels for " + extension, "8 or 16 bits",
                             "write .tif, .mha or .nrrd to keep floats");
    }
    Image mapped;
    if (options.window && type != PixelType::float32) {
        const auto [low, high] = *options.window;
        if (!(high > low && std::isfinite(low) && std::isfinite(high))) {
            return invalidOption("window", fmt::format("{} to {}", low, high), "two finite values in rising order");
        }
        const float top = type == PixelType::uint8 ? 255 : 65535;
        mapped = image;
        for (float& value : mapped.pixels())
            value = std::clamp((value - low) / (high - low), 0.f, 1.f) * top;
    }
    const Image& pixels = mapped.empty() ? image : mapped;
    if (extension == ".png") return writePng(path, pixels, type);
    if (extension == ".dcm") return writeSecondaryCapture(path, pixels, type, options);
    if (extension == ".tif" || extension == ".tiff") return writeTiff(path, pixels, type);
    if (extension == ".mha" || extension == ".nrrd") {
        RasterView raster;
        raster.dimensions = 2;
        raster.size = {pixels.width(), pixels.height(), 1};
        if (options.pixel_spacing_mm) raster.spacing_mm.head<2>() = *options.pixel_spacing_mm;
        raster.values = &pixels.pixels();
        raster.compressed = options.compressed;
        if (type == PixelType::uint8) raster.type = ElementType::uint8;
        if (type == PixelType::uint16) raster.type = ElementType::uint16;
        return extension == ".mha" ? writeMetaImage(path, raster) : writeNrrd(path, raster);
    }
    return invalidOption(path.string(), "the extension " + shown(extension), ".png, .tif, .mha, .nrrd or .dcm");
}

Result<void> writeFigure(const fs::path& path, const ColorImage& figure) {
    if (figure.empty()) throw std::logic_error("writeFigure: an empty image");
    const std::string extension = lower(path.extension().string());
    if (extension != ".png") return invalidOption(path.string(), "the extension " + shown(extension), ".png");
    return writePng(path, figure);
}

}  // namespace fluorocut
