#include "core/io/volume_file.h"

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

namespace {

Result<VolumeFile> readRasterVolume(const fs::path& path, Result<RasterHeader> header, Progress& progress) {
    if (!header) return header.error();
    if (header->dimensions != 3) {
        return invalidInput(path.string(), fmt::format("an image of {} dimensions", header->dimensions),
                            "a volume of 3 dimensions");
    }
    if (!header->has_spacing) {
        return invalidInput(path.string() + ", header", "no voxel spacing", "the spacing in mm",
                            "export it again with its spacing");
    }
    if (Result<void> checked = checkRaster(path, *header, kMaxVolumeVoxels); !checked) return checked.error();
    Result<std::vector<float>> values = readRaster(path, *header, 0, header->count(), progress);
    if (!values) return values.error();
    VolumeGrid grid;
    for (std::size_t axis = 0; axis < 3; ++axis)
        grid.size[axis] = static_cast<int>(header->size[axis]);
    grid.spacing_mm = header->spacing_mm;
    grid.origin_mm = header->origin_mm;
    grid.direction = header->direction;
    VolumeFile result{Volume(grid, std::move(*values)), {}};
    result.info.format = header->format;
    result.info.bits = static_cast<int>(8 * byteCount(header->type));
    result.info.is_float = isFloating(header->type);
    result.info.is_signed = isSigned(header->type);
    result.info.notes = header->notes;
    if (header->slope != 1 || header->intercept != 0) {
        result.info.notes.push_back(fmt::format("rescaled: {} x stored + {}", header->slope, header->intercept));
    }
    return result;
}

Result<VolumeFile> readByFormat(const fs::path& path, const VolumeReadOptions& options, Progress& progress) {
    const Result<FileFormat> format = detectFormat(path);
    if (!format) return format.error();
    switch (*format) {
        case FileFormat::metaImage:
            return readRasterVolume(path, readMetaImageHeader(path), progress);
        case FileFormat::nrrd:
            return readRasterVolume(path, readNrrdHeader(path), progress);
        case FileFormat::nifti:
            return readRasterVolume(path, readNiftiHeader(path), progress);
        case FileFormat::tiff:
            return readTiffStack(path, options, progress);
        case FileFormat::dicomFolder:
            return readDicomFolder(path, options, progress);
        case FileFormat::dicom:
            return invalidInput(path.string(), "a single DICOM file", "a CT series of one file a slice",
                                "give the folder that holds the series");
        default:
            return invalidInput(
                path.string(),
                *format == FileFormat::unknown ? std::string("content of no known format") : std::string(name(*format)),
                "a volume (DICOM folder, NIfTI, NRRD or MHA)");
    }
}

}  // namespace

Result<VolumeFile> readVolume(const fs::path& path, const VolumeReadOptions& options, Progress& progress) {
    if (options.spacing_mm && !(options.spacing_mm->minCoeff() >= 1e-4 && options.spacing_mm->maxCoeff() <= 1e4)) {
        return invalidOption(
            "voxel spacing",
            fmt::format("{} {} {}", options.spacing_mm->x(), options.spacing_mm->y(), options.spacing_mm->z()),
            "0.0001 to 10000 mm");
    }
    Result<VolumeFile> file = withinMemory(path, [&] { return readByFormat(path, options, progress); });
    if (!file) return file;
    std::size_t unknown = 0;
    float least = INFINITY, most = -INFINITY;
    for (const float value : file->volume.voxels()) {
        if (!std::isfinite(value)) ++unknown;
        least = std::min(least, value);
        most = std::max(most, value);
    }
    if (unknown > 0) {
        return invalidInput(path.string(), fmt::format("{} voxels that are NaN or infinite", unknown), "finite voxels",
                            "fill them (air is -1000 HU)");
    }
    file->info.least = least;
    file->info.most = most;
    file->info.grid = file->volume.grid();
    return file;
}

Result<void> writeVolume(const fs::path& path, const Volume& volume, const VolumeWriteOptions& options) {
    if (volume.empty()) throw std::logic_error("writeVolume: an empty volume");
    const std::string file_name = lower(path.filename().string());
    RasterView raster;
    raster.size = volume.grid().size;
    raster.spacing_mm = volume.grid().spacing_mm;
    raster.origin_mm = volume.grid().origin_mm;
    raster.direction = volume.grid().direction;
    raster.values = &volume.voxels();
    raster.type = options.type == VoxelType::int16 ? ElementType::int16 : ElementType::float32;
    raster.compressed = options.compressed;
    if (file_name.ends_with(".mha")) return writeMetaImage(path, raster);
    if (file_name.ends_with(".nrrd")) return writeNrrd(path, raster);
    if (file_name.ends_with(".nii") || file_name.ends_with(".nii.gz")) {
        raster.compressed = file_name.ends_with(".gz");
        return writeNifti(path, raster);
    }
    return invalidOption(path.string(), "the extension " + shown(path.extension().string()),
                         ".mha, .nrrd, .nii or .nii.gz");
}

}  // namespace fluorocut
