// A frame of a DICOM image, brought to "bright means more photons".
//
// Which way stored values run (DICOM PS3.3 C.8.11.3, C.8.7.1):
//  * PixelIntensityRelationshipSign says it about the stored values: 1 more photons, -1 fewer.
//  * Without it, what is displayed white is known from PhotometricInterpretation, and what white means from the kind of
//    image: radiographs (CR, DX, MG, PX, IO) are shown with bone white, so white is fewer photons; fluoroscopy (XA, RF)
//    and everything else is taken to show bone dark. That is custom, not a rule, so a note says which was assumed.
// Values are mirrored within the stored range; then ModalityLUT or rescale is applied.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "core/io/formats/dicom.h"
#include "core/io/formats/dicom_file.h"
#include "core/io/formats/pixels.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

namespace fs = std::filesystem;

namespace {

bool isRadiograph(const std::string& modality) {
    return modality == "CR" || modality == "DX" || modality == "MG" || modality == "PX" || modality == "IO";
}

// DICOM lists the distance between rows first; ours is x (between columns), y (between rows).
Result<std::optional<Vector2>> spacing(const fs::path& path, const DicomFile& file, DicomTag tag, const char* name) {
    if (!file.has(tag)) return {std::nullopt};
    const std::vector<double> values = file.numbers(tag);
    const auto sane = [](double v) { return v >= 1e-4 && v <= 100; };
    if (!(values.size() == 2 && sane(values[0]) && sane(values[1]))) {
        return invalidInput(path.string() + ", DICOM " + name, shown(file.text(tag)),
                            "two distances from 0.0001 to 100 mm", "export it again");
    }
    return {Vector2(values[1], values[0])};
}

Result<void> readSpacing(const fs::path& path, const DicomFile& file, ImageInfo& info) {
    const auto imager = spacing(path, file, tag::kImagerPixelSpacing, "ImagerPixelSpacing");
    if (!imager) return imager.error();
    const auto pixel = spacing(path, file, tag::kPixelSpacing, "PixelSpacing");
    if (!pixel) return pixel.error();
    const std::string calibration = file.text(tag::kCalibrationType);
    info.imager_pixel_spacing_mm = *imager;
    // Equal spacings: PS3.3 10.7.1.3 says PixelSpacing was not corrected and belongs to the detector.
    const bool corrected = pixel->has_value() && imager->has_value() && !(*pixel)->isApprox(**imager, 1e-3);
    if (pixel->has_value() && (corrected || !calibration.empty())) {
        info.pixel_spacing_mm = *pixel;
        info.spacing_plane = SpacingPlane::calibrated;
        info.notes.push_back(fmt::format("PixelSpacing is calibrated to an object's plane ({})",
                                         calibration.empty() ? "how is not stated" : calibration));
    } else if (imager->has_value()) {
        info.pixel_spacing_mm = *imager;
        info.spacing_plane = SpacingPlane::detector;
    } else if (pixel->has_value()) {
        info.pixel_spacing_mm = *pixel;
        info.spacing_plane = SpacingPlane::unstated;
        if (info.modality != "CT" && info.modality != "MR") {
            info.notes.push_back("PixelSpacing alone: the file does not say which plane its millimetres belong to");
        }
    }
    return {};
}

// The exposure's time, or that of its content; digits, as they can be compared. What is not one is not stated.
std::string acquiredAt(const DicomFile& file) {
    const auto digits = [](const std::string& text, std::size_t least) {
        const std::size_t end = std::min(text.find_first_not_of("0123456789."), text.size());
        return end >= least ? text.substr(0, end) : std::string();
    };
    if (const std::string both = digits(file.text(tag::kAcquisitionDateTime), 14); !both.empty()) return both;
    for (const auto& [date, time] :
         {std::pair(tag::kAcquisitionDate, tag::kAcquisitionTime), std::pair(tag::kContentDate, tag::kContentTime)}) {
        const std::string day = digits(file.text(date), 8), hour = digits(file.text(time), 6);
        if (day.size() == 8 && !hour.empty()) return day + hour;
    }
    return {};
}

Result<void> readGeometry(const fs::path& path, const DicomFile& file, ImageInfo& info) {
    struct Field {
        DicomTag tag;
        const char* name;
        double least, most;
        std::optional<double>* value;
    };
    for (const Field& field :
         {Field{tag::kSourceDetector, "DistanceSourceToDetector", 1, 10000, &info.source_detector_mm},
          Field{tag::kSourcePatient, "DistanceSourceToPatient", 1, 10000, &info.source_patient_mm},
          Field{tag::kPrimaryAngle, "PositionerPrimaryAngle", -360, 360, &info.primary_angle_deg},
          Field{tag::kSecondaryAngle, "PositionerSecondaryAngle", -360, 360, &info.secondary_angle_deg}}) {
        const std::optional<double> value = file.number(field.tag);
        if (!value) continue;
        if (*value >= field.least && *value <= field.most) {
            *field.value = value;
        } else if (*value == 0) {
            info.notes.push_back(fmt::format("{} is 0: taken as not stated", field.name));
        } else {
            return invalidInput(path.string() + ", DICOM " + field.name, shown(file.text(field.tag)),
                                fmt::format("{} to {}", field.least, field.most), "export it again");
        }
    }
    info.acquired = acquiredAt(file);
    info.instance_uid = file.text(tag::kSopInstance);
    return readSpacing(path, file, info);
}

// Whether high stored values mean fewer photons; says why in a note.
bool highIsFewer(const DicomFile& file, const std::string& photometric, BrightnessRule rule, ImageInfo& info) {
    if (rule != BrightnessRule::fromFile) {
        const bool mirror = rule == BrightnessRule::mirrored;
        info.notes.push_back(mirror ? "values were mirrored, as asked" : "values are as stored, as asked");
        return mirror;
    }
    if (const std::optional<double> sign = file.number(tag::kRelationshipSign); sign && std::abs(*sign) == 1) {
        if (*sign < 0) info.notes.push_back("values were mirrored: PixelIntensityRelationshipSign is -1");
        return *sign < 0;
    }
    const bool white_is_high = photometric != "MONOCHROME1";
    const bool radiograph = isRadiograph(info.modality);
    const bool fewer = radiograph == white_is_high;
    info.notes.push_back(fmt::format("{}: PixelIntensityRelationshipSign is absent; {}, {}, is taken to show bone {}",
                                     fewer ? "values were mirrored" : "values were not mirrored",
                                     info.modality.empty() ? "an image without modality" : info.modality, photometric,
                                     radiograph ? "white" : "dark"));
    return fewer;
}

}  // namespace

Result<ImageFile> readDicomImage(const fs::path& path, const ImageReadOptions& options) {
    const Result<DicomFile> file = DicomFile::open(path);
    if (!file) return file.error();
    const Result<DicomPixelFormat> format = file->pixelFormat();
    if (!format) return format.error();
    if (Result<void> frame = checkFrame(path, options.frame, format->frames); !frame) return frame.error();

    ImageFile result;
    ImageInfo& info = result.info;
    info.format = "DICOM";
    info.frames = format->frames;
    info.frame = options.frame;
    info.bits = format->bits_stored;
    info.is_signed = format->is_signed;
    info.modality = file->text(tag::kModality);
    info.manufacturer = file->text(tag::kManufacturer);
    info.transfer_syntax = file->transferSyntax();
    info.photometric = format->photometric;
    info.has_identifying_fields = file->hasIdentifyingFields();
    if (Result<void> geometry = readGeometry(path, *file, info); !geometry) return geometry.error();
    const std::string relationship = file->text(tag::kRelationship);
    if (relationship == "LIN") info.intensity = IntensityScale::linear;
    if (relationship == "LOG") info.intensity = IntensityScale::logarithmic;
    if (relationship == "DISP") info.intensity = IntensityScale::display;

    Result<std::vector<float>> pixels = file->frame(*format, options.frame - 1);
    if (!pixels) return pixels.error();
    std::vector<float> values = std::move(*pixels);
    if (format->samples == 3) values = luminance(values, 3, info.notes);

    double least = format->least(), most = format->most();
    const bool is_ct = info.modality == "CT";  // attenuation: bright is denser, and stays so
    bool mirror = !is_ct && highIsFewer(*file, format->photometric, options.brightness, info);
    const Result<std::optional<DicomLut>> lut = file->modalityLut(*format);
    if (!lut) return lut.error();
    if (lut->has_value()) {
        const std::vector<float>& table = (*lut)->values;
        for (float& value : values) {
            const double index =
                std::clamp<double>(value - static_cast<float>((*lut)->first), 0, static_cast<double>(table.size() - 1));
            value = table[static_cast<std::size_t>(index)];
        }
        const auto [low, high] = std::minmax_element(table.begin(), table.end());
        least = *low;
        most = *high;
        if (table.back() < table.front()) mirror = !mirror;  // the table has turned them already
        info.notes.push_back("ModalityLUT was applied");
        if (info.intensity == IntensityScale::logarithmic) info.intensity = IntensityScale::linear;
    } else if (file->has(tag::kSlope) || file->has(tag::kIntercept)) {
        const double slope = file->number(tag::kSlope).value_or(1),
                     intercept = file->number(tag::kIntercept).value_or(0);
        if (!(std::isfinite(slope) && std::isfinite(intercept) && slope != 0)) {
            return invalidInput(path.string() + ", DICOM RescaleSlope and RescaleIntercept",
                                fmt::format("{} and {}", slope, intercept), "finite numbers, a slope that is not 0");
        }
        if (slope != 1 || intercept != 0) {
            for (float& value : values)
                value = static_cast<float>(slope * static_cast<double>(value) + intercept);
            info.notes.push_back(fmt::format("rescaled: {} x stored + {}", slope, intercept));
        }
        const double a = slope * least + intercept, b = slope * most + intercept;
        least = std::min(a, b);
        most = std::max(a, b);
        if (slope < 0 && !is_ct) mirror = !mirror;
    }
    if (mirror) mirrorValues(values, least, most);
    if (info.intensity == IntensityScale::logarithmic) {
        info.notes.push_back("values are the logarithm of the beam's intensity: they were not made linear");
    }
    result.image = Image(format->width, format->height, std::move(values));
    return result;
}

}  // namespace fluorocut
