// A CT series from a folder of single-frame slices.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/parallel.h"
#include "core/base/units.h"
#include "core/io/file_format.h"
#include "core/io/formats/dicom.h"
#include "core/io/formats/dicom_file.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMaxFiles = 100000;
constexpr std::string_view kCtImageStorage = "1.2.840.10008.5.1.4.1.1.2";
constexpr float kAir_hu = -1000;
// Positions are written with two or three decimals; 0.05 mm is below what any image here can show.
constexpr double kPositionTolerance_mm = 0.05;

struct Slice {
    fs::path path;
    std::string instance_uid, series_uid, manufacturer, transfer_syntax;
    DicomPixelFormat format;
    Vector3 position, row, column;  // LPS: centre of the first pixel, along a row, down a column
    double between_columns_mm = 0, between_rows_mm = 0;
    std::optional<double> thickness_mm;
    double slope = 1, intercept = 0;
    std::optional<std::pair<double, double>> padding;  // stored values, inclusive
    bool identifying = false;
    double along_normal_mm = 0;
};

// Files of the folder and below it in a fixed order.
Result<std::vector<fs::path>> listFiles(const fs::path& folder) {
    std::vector<fs::path> files;
    std::error_code code;
    fs::recursive_directory_iterator at(folder, fs::directory_options::skip_permission_denied, code);
    for (; !code && at != fs::recursive_directory_iterator(); at.increment(code)) {
        std::error_code ignored;
        if (at->is_regular_file(ignored)) files.push_back(at->path());
        if (files.size() > kMaxFiles) {
            return invalidInput(folder.string(), fmt::format("more than {} files", kMaxFiles), "the folder of a series",
                                "give the folder of one series");
        }
    }
    if (code) return invalidInput(folder.string(), code.message(), "a readable folder");
    std::sort(files.begin(), files.end());
    return files;
}

Result<Slice> readSliceHeader(const fs::path& path, const DicomFile& file) {
    const auto bad = [&](const char* field, std::string found, std::string expected) {
        return invalidInput(path.string() + ", DICOM " + field, std::move(found), std::move(expected),
                            "export the series again");
    };
    Slice slice;
    slice.path = path;
    slice.instance_uid = file.text(tag::kSopInstance);
    slice.series_uid = file.text(tag::kSeriesInstance);
    slice.manufacturer = file.text(tag::kManufacturer);
    slice.transfer_syntax = file.transferSyntax();
    slice.identifying = file.hasIdentifyingFields();
    const Result<DicomPixelFormat> format = file.pixelFormat();
    if (!format) return format.error();
    slice.format = *format;
    if (format->frames > 1) {
        return bad("NumberOfFrames", fmt::format("{} (an enhanced multi-frame CT)", format->frames),
                   "one slice a file (export as classic CT)");
    }
    if (format->samples != 1) return bad("SamplesPerPixel", "colour", "greyscale");

    const std::vector<double> position = file.numbers(tag::kPosition);
    if (position.size() != 3 || !(Vector3(position[0], position[1], position[2]).cwiseAbs().maxCoeff() <= 1e5)) {
        return bad("ImagePositionPatient", shown(file.text(tag::kPosition)), "three finite coordinates in mm");
    }
    slice.position = Vector3(position[0], position[1], position[2]);
    const std::vector<double> o = file.numbers(tag::kOrientation);
    if (o.size() == 6) {
        slice.row = Vector3(o[0], o[1], o[2]);
        slice.column = Vector3(o[3], o[4], o[5]);
    }
    // 1e-3: four decimals are usual
    if (o.size() != 6 || !(std::abs(slice.row.norm() - 1) < 1e-3 && std::abs(slice.column.norm() - 1) < 1e-3 &&
                           std::abs(slice.row.dot(slice.column)) < 1e-3)) {
        return bad("ImageOrientationPatient", shown(file.text(tag::kOrientation)), "two perpendicular unit vectors");
    }
    slice.row.normalize();
    slice.column = (slice.column - slice.column.dot(slice.row) * slice.row).normalized();
    const std::vector<double> spacing = file.numbers(tag::kPixelSpacing);
    const auto sane = [](double v) { return v >= 1e-3 && v <= 100; };
    if (!(spacing.size() == 2 && sane(spacing[0]) && sane(spacing[1]))) {
        return bad("PixelSpacing", shown(file.text(tag::kPixelSpacing)), "two distances from 0.001 to 100 mm");
    }
    slice.between_rows_mm = spacing[0];
    slice.between_columns_mm = spacing[1];
    const std::optional<double> thickness = file.number(tag::kSliceThickness);
    if (thickness && *thickness > 0 && *thickness < 1000) slice.thickness_mm = thickness;
    slice.slope = file.number(tag::kSlope).value_or(1);
    slice.intercept = file.number(tag::kIntercept).value_or(0);
    if (!(std::isfinite(slice.slope) && slice.slope != 0 && std::isfinite(slice.intercept))) {
        return bad("RescaleSlope and RescaleIntercept", fmt::format("{} and {}", slice.slope, slice.intercept),
                   "finite numbers, a slope that is not 0");
    }
    if (const std::optional<double> padding = file.number(tag::kPadding)) {
        // DCMTK hands out the 16 bits unsigned where the file leaves the sign to PixelRepresentation
        const auto stored = [&](double v) { return slice.format.is_signed && v > 32767 ? v - 65536 : v; };
        const double limit = file.number(tag::kPaddingLimit).value_or(*padding);
        slice.padding = std::minmax(stored(*padding), stored(limit));
    }
    return slice;
}

struct Found {
    std::vector<Slice> slices;
    int other_files = 0, other_images = 0, localizers = 0;
};

Result<Found> findSlices(const fs::path& folder, Progress& progress) {
    const Result<std::vector<fs::path>> files = listFiles(folder);
    if (!files) return files.error();
    Found found;
    std::set<std::string> other_modalities;
    for (std::size_t i = 0; i < files->size(); ++i) {
        if (progress.isCancelled()) return cancelled("reading " + folder.string());
        progress.report(static_cast<double>(i) / static_cast<double>(files->size()), "looking at files");
        const fs::path& path = (*files)[i];
        std::error_code ignored;
        const Result<FileFormat> format =
            fs::file_size(path, ignored) == 0 ? Result<FileFormat>(FileFormat::unknown) : detectFormat(path);
        if (!format) return format.error();
        if (*format != FileFormat::dicom) {
            ++found.other_files;
            continue;
        }
        const Result<DicomFile> file = DicomFile::open(path);
        if (!file) return file.error();
        const std::string modality = file->text(tag::kModality);
        const bool is_ct = modality == "CT" || (modality.empty() && file->text(tag::kSopClass) == kCtImageStorage);
        if (!file->hasPixelData() || !is_ct) {
            ++found.other_images;
            if (!modality.empty()) other_modalities.insert(shown(modality));
            continue;
        }
        if (file->text(tag::kImageType).find("LOCALIZER") != std::string::npos) {
            ++found.localizers;
            continue;
        }
        Result<Slice> slice = readSliceHeader(path, *file);
        if (!slice) return slice.error();
        found.slices.push_back(std::move(*slice));
    }
    if (found.slices.empty()) {
        return invalidInput(
            folder.string(),
            files->empty() ? "an empty folder"
                           : fmt::format("{} files, no CT slice among them{}{}", files->size(),
                                         other_modalities.empty() ? "" : ", but ", fmt::join(other_modalities, ", ")),
            "the DICOM files of a CT series");
    }
    return found;
}

Result<void> chooseSeries(const fs::path& folder, const std::string& wanted, std::vector<Slice>& slices) {
    std::map<std::string, int> series;
    for (const Slice& slice : slices)
        ++series[slice.series_uid];
    std::string list;
    int listed = 0;
    for (const auto& [uid, count] : series) {
        if (++listed > 8) {
            list += fmt::format(", and {} more", series.size() - 8);
            break;
        }
        list += fmt::format("{}{} ({} slices)", listed == 1 ? "" : ", ", uid.empty() ? "without UID" : printable(uid),
                            count);
    }
    if (wanted.empty()) {
        if (series.size() == 1) return {};
        return invalidInput(folder.string(), fmt::format("{} series: {}", series.size(), list), "one series",
                            "give its folder, or choose one by its UID");
    }
    if (!series.contains(wanted)) {
        return invalidInput(folder.string(), "the series " + list, "the series " + shown(wanted));
    }
    std::erase_if(slices, [&](const Slice& slice) { return slice.series_uid != wanted; });
    return {};
}

// All slices must be cut from one block: sizes, spacing and orientation of the first.
Result<void> checkAlike(const std::vector<Slice>& slices) {
    const Slice& first = slices.front();
    for (const Slice& slice : slices) {
        const auto mixed = [&](const char* what, std::string found, std::string expected) {
            return invalidInput(slice.path.string(), fmt::format("{} {}", what, found),
                                fmt::format("{} as in {}", expected, first.path.filename().string()),
                                "the folder mixes images that are not one volume: export the series alone");
        };
        if (slice.format.width != first.format.width || slice.format.height != first.format.height) {
            return mixed("a size of", fmt::format("{} x {}", slice.format.width, slice.format.height),
                         fmt::format("{} x {}", first.format.width, first.format.height));
        }
        // 1e-4 of a pixel is 0.05 mm over 512 of them
        if (!(std::abs(slice.between_columns_mm - first.between_columns_mm) <= 1e-4 * first.between_columns_mm &&
              std::abs(slice.between_rows_mm - first.between_rows_mm) <= 1e-4 * first.between_rows_mm)) {
            return mixed("a pixel spacing of",
                         fmt::format("{} x {} mm", slice.between_columns_mm, slice.between_rows_mm),
                         fmt::format("{} x {} mm", first.between_columns_mm, first.between_rows_mm));
        }
        const double angle = degreesFromRadians(
            std::acos(std::clamp(std::min(slice.row.dot(first.row), slice.column.dot(first.column)), -1.0, 1.0)));
        if (!(angle <= 0.05)) {  // 0.05 degrees: 0.2 mm at 250 mm
            return mixed("an orientation", fmt::format("{:.2f} degrees away", angle), "the orientation");
        }
    }
    return {};
}

// Sorts along the normal and gives the step between slices.
Result<double> sortSlices(const fs::path& folder, std::vector<Slice>& slices) {
    const Vector3 normal = slices.front().row.cross(slices.front().column);
    for (Slice& slice : slices)
        slice.along_normal_mm = slice.position.dot(normal);
    std::sort(slices.begin(), slices.end(), [](const Slice& a, const Slice& b) {
        return a.along_normal_mm != b.along_normal_mm ? a.along_normal_mm < b.along_normal_mm : a.path < b.path;
    });
    if (slices.size() < 2) {
        return invalidInput(folder.string(), "one CT slice", "at least 2", "give the folder of the whole series");
    }
    std::vector<double> steps;
    for (std::size_t i = 1; i < slices.size(); ++i) {
        const Slice &a = slices[i - 1], &b = slices[i];
        steps.push_back(b.along_normal_mm - a.along_normal_mm);
        if (!(steps.back() > kPositionTolerance_mm)) {
            return invalidInput(
                folder.string(),
                fmt::format("{} at the same position, {:.2f} mm: {} and {}",
                            a.instance_uid == b.instance_uid ? "the same slice twice" : "two slices", a.along_normal_mm,
                            a.path.filename().string(), b.path.filename().string()),
                "one slice at each position",
                a.instance_uid == b.instance_uid ? "remove the copy" : "export one phase or reconstruction alone");
        }
    }
    const double usual = median(steps);
    const double step =
        (slices.back().along_normal_mm - slices.front().along_normal_mm) / static_cast<double>(slices.size() - 1);
    for (std::size_t i = 1; i < slices.size(); ++i) {
        const double planned = slices.front().along_normal_mm + static_cast<double>(i) * step;
        const bool regular = std::abs(steps[i - 1] - usual) <= 2 * kPositionTolerance_mm;
        if (regular && std::abs(slices[i].along_normal_mm - planned) <= 2 * kPositionTolerance_mm) continue;
        // name the largest irregularity rather than the first slice that it pushed off the grid
        std::size_t worst = 0;
        for (std::size_t k = 0; k < steps.size(); ++k) {
            if (std::abs(steps[k] - usual) > std::abs(steps[worst] - usual)) worst = k;
        }
        const int missing = static_cast<int>(std::lround(steps[worst] / usual)) - 1;
        return invalidInput(
            folder.string(),
            fmt::format("a {} of {:.2f} mm between {} and {}", steps[worst] > usual ? "gap" : "step", steps[worst],
                        slices[worst].path.filename().string(), slices[worst + 1].path.filename().string()),
            fmt::format("steps of {:.2f} mm", usual),
            missing > 0
                ? fmt::format("{} slice{} missing: export the series again", missing, missing > 1 ? "s are" : " is")
                : "the series is not evenly spaced: export one reconstruction alone");
    }
    // The line through the first pixels must follow the normal, or the block is sheared.
    const Vector3 way = slices.back().position - slices.front().position;
    const double aside = (way - way.dot(normal) * normal).norm();
    if (!(aside <= 2 * kPositionTolerance_mm)) {
        return invalidInput(folder.string(),
                            fmt::format("slices that shift sideways by {:.2f} mm: a gantry tilt of {:.1f} degrees",
                                        aside, degreesFromRadians(std::atan2(aside, std::abs(way.dot(normal))))),
                            "an upright stack", "reconstruct or resample it without tilt");
    }
    return step;
}

void describe(const Found& found, const std::vector<Slice>& slices, double step, VolumeInfo& info) {
    const Slice& first = slices.front();
    info.format = "DICOM";
    info.bits = first.format.bits_stored;
    info.is_signed = first.format.is_signed;
    info.files = static_cast<int>(slices.size());
    info.modality = "CT";
    info.manufacturer = first.manufacturer;
    info.transfer_syntax = first.transfer_syntax;
    info.series_uid = first.series_uid;
    info.slice_thickness_mm = first.thickness_mm;
    bool rescale_differs = false, thickness_differs = false;
    for (const Slice& slice : slices) {
        info.has_identifying_fields = info.has_identifying_fields || slice.identifying;
        rescale_differs = rescale_differs || slice.slope != first.slope || slice.intercept != first.intercept;
        thickness_differs = thickness_differs || slice.thickness_mm != first.thickness_mm;
    }
    const auto note = [&](std::string text) { info.notes.push_back(std::move(text)); };
    if (rescale_differs) {
        note("slices have different rescale values: each was applied to its own");
    } else {
        note(fmt::format("Hounsfield units: {} x stored + {}", first.slope, first.intercept));
    }
    if (thickness_differs) note("slices have different thicknesses");
    // 1 %: thicknesses are written with one or two decimals
    if (first.thickness_mm && *first.thickness_mm > 1.01 * step) {
        note(fmt::format("slices are {:g} mm thick and {:.4g} mm apart: they overlap", *first.thickness_mm, step));
    }
    if (first.thickness_mm && *first.thickness_mm < 0.99 * step) {
        note(fmt::format("slices are {:g} mm thick and {:.4g} mm apart: what lies between was not imaged",
                         *first.thickness_mm, step));
    }
    if (found.other_files > 0) note(fmt::format("{} files that are not DICOM were passed over", found.other_files));
    if (found.other_images > 0)
        note(fmt::format("{} DICOM files that are not CT were passed over", found.other_images));
    if (found.localizers > 0) note(fmt::format("{} localizers were passed over", found.localizers));
}

// Hounsfield units of one slice, into its place; how many pixels were padding.
Result<std::size_t> readSlice(const Slice& slice, float* to) {
    const Result<DicomFile> file = DicomFile::open(slice.path);
    if (!file) return file.error();
    const Result<DicomPixelFormat> format = file->pixelFormat();
    if (!format) return format.error();
    if (format->width != slice.format.width || format->height != slice.format.height) {
        return invalidInput(slice.path.string(), "a file that changed while it was read", "the same file");
    }
    const Result<std::vector<float>> stored = file->frame(*format, 0);
    if (!stored) return stored.error();
    std::size_t padded = 0;
    for (std::size_t i = 0; i < stored->size(); ++i) {
        const double value = static_cast<double>((*stored)[i]);
        const bool padding = slice.padding && value >= slice.padding->first && value <= slice.padding->second;
        padded += padding;
        to[i] = padding ? kAir_hu : static_cast<float>(slice.slope * value + slice.intercept);
    }
    return padded;
}

}  // namespace

Result<VolumeFile> readDicomFolder(const fs::path& folder, const VolumeReadOptions& options, Progress& progress) {
    SubProgress looking(progress, 0, 0.3), reading(progress, 0.3, 1);
    Result<Found> found = findSlices(folder, looking);
    if (!found) return found.error();
    std::vector<Slice> slices = std::move(found->slices);
    if (Result<void> chosen = chooseSeries(folder, options.series_uid, slices); !chosen) return chosen.error();
    if (Result<void> alike = checkAlike(slices); !alike) return alike.error();
    const Result<double> step = sortSlices(folder, slices);
    if (!step) return step.error();

    const Slice& first = slices.front();
    VolumeGrid grid;
    grid.size = {first.format.width, first.format.height, static_cast<int>(slices.size())};
    grid.spacing_mm = {first.between_columns_mm, first.between_rows_mm, *step};
    grid.origin_mm = first.position;
    grid.direction << first.row, first.column, first.row.cross(first.column);
    if (grid.voxelCount() > kMaxVolumeVoxels) {
        return invalidInput(folder.string(), fmt::format("{} voxels", grid.voxelCount()),
                            fmt::format("at most {}", kMaxVolumeVoxels));
    }
    VolumeFile result{Volume(grid), {}};
    describe(*found, slices, *step, result.info);

    const std::size_t per_slice = grid.voxelCount() / slices.size();
    std::vector<std::size_t> padded(slices.size(), 0);
    std::vector<std::optional<Error>> errors(slices.size());
    const std::size_t batch = 2 * static_cast<std::size_t>(parallelThreads());
    for (std::size_t begin = 0; begin < slices.size(); begin += batch) {
        if (reading.isCancelled()) return cancelled("reading " + folder.string());
        const std::size_t count = std::min(batch, slices.size() - begin);
        parallelFor(count, 1, [&](std::size_t from, std::size_t end) {
            for (std::size_t k = begin + from; k < begin + end; ++k) {
                const Result<std::size_t> read = readSlice(slices[k], result.volume.voxels().data() + k * per_slice);
                if (read) {
                    padded[k] = *read;
                } else {
                    errors[k] = read.error();
                }
            }
        });
        for (std::size_t k = begin; k < begin + count; ++k) {
            if (errors[k]) return *errors[k];
        }
        reading.report(static_cast<double>(begin + count) / static_cast<double>(slices.size()), "reading slices");
    }
    std::size_t all = 0;
    for (const std::size_t count : padded)
        all += count;
    if (all > 0) result.info.notes.push_back(fmt::format("{} padding pixels were set to air, -1000 HU", all));
    return result;
}

}  // namespace fluorocut
