// Reading and writing images: PNG, TIFF (8, 16, 32 bits, float; stacks), MetaImage, NRRD and DICOM (XA, RF, CR, DX,
// secondary capture; multi-frame). The format is told from the content when reading, from the extension when writing.
//
// Pixels are handed out as float with the file's own values, except that bright means more photons: where a file says,
// or its kind implies, that bright means fewer, values are mirrored within the range of the stored type
// (v -> least + most - v). What was done stands in ImageInfo::notes. Colour becomes luminance (Rec. 709 weights).
//
// Every failure is one sentence with ErrorCode::invalidInput that names the path as given. Declared sizes are checked
// against the file's size and against a limit (2^27 pixels) before memory is taken.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"
#include "core/image/image.h"

namespace fluorocut {

// Which plane a pixel spacing's millimetres belong to. Lengths measured with it are lengths in that plane only.
enum class SpacingPlane {
    none,        // the file states no spacing
    unstated,    // a spacing without saying where (MetaImage, NRRD; DICOM PixelSpacing alone in a projection image)
    detector,    // the detector's front: ImagerPixelSpacing
    calibrated,  // an object's plane: PixelSpacing calibrated with a fiducial or by geometry
};
std::string_view name(SpacingPlane plane);

// How pixel values relate to the beam's intensity, after what was done to them.
enum class IntensityScale { unstated, linear, logarithmic, display };
std::string_view name(IntensityScale scale);

struct ImageInfo {
    std::string format;  // "PNG", "TIFF", "MetaImage", "NRRD", "DICOM"
    int width = 0;
    int height = 0;
    int frames = 1;  // pages of a TIFF, slices of a 3D raster, frames of a DICOM file
    int frame = 1;   // the one that was read, counted from 1
    int bits = 0;    // meaningful bits of a stored pixel
    bool is_signed = false;
    bool is_float = false;
    float least = 0;  // of the pixels handed out
    float most = 0;
    std::optional<Vector2> pixel_spacing_mm;  // of `spacing_plane`: between columns, between rows
    SpacingPlane spacing_plane = SpacingPlane::none;
    std::optional<Vector2> imager_pixel_spacing_mm;  // at the detector, when the file states it
    IntensityScale intensity = IntensityScale::unstated;

    // DICOM only
    std::string modality;
    std::string manufacturer;
    std::string transfer_syntax;
    std::string photometric;
    std::optional<double> source_detector_mm;
    std::optional<double> source_patient_mm;
    std::optional<double> primary_angle_deg;    // positioner, LAO positive
    std::optional<double> secondary_angle_deg;  // positioner, cranial positive
    std::string acquired;                       // "20260301093000.125", by the device's clock; empty: not stated
    std::string instance_uid;
    bool has_identifying_fields = false;  // a patient's name, ID, birth date, ...: present, never shown

    std::vector<std::string> notes;  // what was done to the pixels, and warnings
};

struct ImageFile {
    Image image;
    ImageInfo info;
};

// DICOM files that do not state which way their values run are judged by custom (see formats/dicom_image.cpp), which
// can be wrong: then say it here.
enum class BrightnessRule { fromFile, asStored, mirrored };

struct ImageReadOptions {
    int frame = 1;  // counted from 1
    BrightnessRule brightness = BrightnessRule::fromFile;
};

Result<ImageFile> readImage(const std::filesystem::path& path, const ImageReadOptions& options = {});

enum class PixelType { automatic, uint8, uint16, float32 };

struct ImageWriteOptions {
    // automatic: uint16 for PNG and DICOM, float32 for TIFF, MHA and NRRD
    PixelType type = PixelType::automatic;
    // Values mapped to 0 and to the integer type's largest, clamped beyond. Without it integers are written as they are
    // (rounded), and a value that does not fit is an error.
    std::optional<std::pair<float, float>> window;
    bool compressed = false;                  // MHA, NRRD (raw is what every program reads); PNG always is
    std::optional<Vector2> pixel_spacing_mm;  // MHA, NRRD, DICOM (as ImagerPixelSpacing)
};

// By extension: .png, .tif, .tiff, .mha, .nrrd, .dcm (Secondary Capture, without anything that identifies a person).
Result<void> writeImage(const std::filesystem::path& path, const Image& image, const ImageWriteOptions& options = {});

// A figure: .png, 8 bits each of red, green, blue.
Result<void> writeFigure(const std::filesystem::path& path, const ColorImage& figure);

}  // namespace fluorocut
