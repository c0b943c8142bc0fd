// DICOM Secondary Capture: a picture in the archive's format. Of images: nothing that identifies a person or a machine,
// UIDs are random (root 2.25, PS3.5 B.2). Of captures: patient and study.
#include <algorithm>
#include <cstring>
#include <random>
#include <stdexcept>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcfilefo.h>
#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>

#include "core/io/atomic_file.h"
#include "core/io/formats/dicom.h"
#include "core/io/formats/raster.h"
#include "core/io/secondary_capture.h"

namespace fluorocut {

namespace fs = std::filesystem;

namespace {

// 2.25 and a random number below 2^126 (38 digits, the first of them not 0).
std::string newUid() {
    std::random_device random;
    std::string uid = "2.25." + std::to_string(1 + random() % 8);
    while (uid.size() < 5 + 38)
        uid += static_cast<char>('0' + random() % 10);
    return uid;
}

// A dataset that remembers the first thing that went wrong.
class Capture {
  public:
    void text(const DcmTagKey& field, const std::string& value) {
        if (status_.good()) status_ = data().putAndInsertOFStringArray(field, value.c_str());
    }
    void number(const DcmTagKey& field, int value) {
        if (status_.good()) status_ = data().putAndInsertUint16(field, static_cast<Uint16>(value));
    }
    void pixels(const std::vector<Uint16>& values) {
        if (status_.good())
            status_ =
                data().putAndInsertUint16Array(DCM_PixelData, values.data(), static_cast<unsigned long>(values.size()));
    }
    void pixels(std::string_view bytes) {
        if (status_.good())
            status_ = data().putAndInsertUint8Array(DCM_PixelData, reinterpret_cast<const Uint8*>(bytes.data()),
                                                    static_cast<unsigned long>(bytes.size()));
    }
    // What both kinds have in common.
    void format(int width, int height, int samples, int bits) {
        text(DCM_SOPClassUID, UID_SecondaryCaptureImageStorage);
        text(DCM_Modality, "OT");
        number(DCM_SamplesPerPixel, samples);
        text(DCM_PhotometricInterpretation, samples == 3 ? "RGB" : "MONOCHROME2");
        if (samples == 3) number(DCM_PlanarConfiguration, 0);
        number(DCM_Rows, height);
        number(DCM_Columns, width);
        number(DCM_BitsAllocated, bits);
        number(DCM_BitsStored, bits);
        number(DCM_HighBit, bits - 1);
        number(DCM_PixelRepresentation, 0);
    }
    Result<void> write(const fs::path& path) {
        return writeWhole(path, [&](const fs::path& temporary) -> Result<void> {
            if (status_.good())
                status_ = file_.saveFile(temporary.c_str(), EXS_LittleEndianExplicit, EET_ExplicitLength);
            if (status_.bad())
                return outputFailed(path.string(), fmt::format("DICOM that cannot be written ({})", status_.text()));
            return {};
        });
    }

  private:
    DcmDataset& data() { return *file_.getDataset(); }
    DcmFileFormat file_;
    OFCondition status_ = EC_Normal;
};

Result<void> checkSize(const fs::path& path, int width, int height) {
    if (width >= 1 && height >= 1 && width <= 65535 && height <= 65535) return {};
    return invalidOption(path.string(), fmt::format("{} x {} pixels", width, height),
                         "1 x 1 to 65535 x 65535 in DICOM");
}

// Of one value: no control characters, nothing that separates values or parts of a name, at most so many characters.
std::string value(std::string_view text, std::size_t most, std::string_view without = "\\") {
    std::string out;
    std::size_t characters = 0;
    for (const char c : text) {
        const bool begins = (static_cast<unsigned char>(c) & 0xC0U) != 0x80U;
        if (begins && ++characters > most) break;
        const bool bad = static_cast<unsigned char>(c) < 0x20 || c == 0x7F || without.find(c) != std::string_view::npos;
        out += bad ? ' ' : c;
    }
    return out;
}

std::string personName(const std::string& name) {
    std::string text = value(name, 64, "\\=");
    const std::size_t comma = text.find(',');
    if (comma == std::string::npos || text.find('^') != std::string::npos) return text;
    const std::size_t given = text.find_first_not_of(' ', comma + 1);
    return text.substr(0, comma) + "^" + (given == std::string::npos ? "" : text.substr(given));
}

// The digits of a point in time, from one place to another: "2026-03-01T09:30:00.125Z".
std::string digits(std::string_view utc, std::size_t from, std::size_t count) {
    std::string out;
    for (const char c : utc.substr(std::min(from, utc.size()), count))
        if (c >= '0' && c <= '9') out += c;
    return out;
}

}  // namespace

std::string uidFromHash(std::string_view hex32) {
    std::string hex(hex32);
    if (hex.size() != 32 || hex.find_first_not_of("0123456789abcdef") != std::string::npos)
        throw std::logic_error("uidFromHash: 32 hexadecimal digits, lower case, expected");
    hex[12] = '8';                                                            // version
    hex[16] = "89ab"[hex[16] < 'a' ? hex[16] % 4 : (hex[16] - 'a' + 2) % 4];  // variant
    std::vector<int> decimal{0};                                              // the least digit first
    for (const char c : hex) {
        int carry = c < 'a' ? c - '0' : c - 'a' + 10;
        for (int& digit : decimal) {
            carry += 16 * digit;
            digit = carry % 10;
            carry /= 10;
        }
        for (; carry > 0; carry /= 10)
            decimal.push_back(carry % 10);
    }
    std::string uid = "2.25.";
    for (auto digit = decimal.rbegin(); digit != decimal.rend(); ++digit)
        uid += static_cast<char>('0' + *digit);
    return uid;
}

Result<void> writeCapture(const fs::path& path, const ColorImage& picture, const CaptureTags& tags) {
    if (Result<void> good = checkSize(path, picture.width(), picture.height()); !good) return good;
    std::string bytes;
    bytes.reserve(3 * picture.size());
    for (const auto& pixel : picture.pixels())
        bytes.append(reinterpret_cast<const char*>(pixel.data()), 3);
    Capture capture;
    capture.text(DCM_SpecificCharacterSet, "ISO_IR 192");  // UTF-8
    capture.format(picture.width(), picture.height(), 3, 8);
    capture.text(DCM_SOPInstanceUID, tags.instance_uid);
    capture.text(DCM_StudyInstanceUID, tags.study_uid);
    capture.text(DCM_SeriesInstanceUID, tags.series_uid);
    capture.text(DCM_PatientName, personName(tags.patient_name));
    capture.text(DCM_PatientID, value(tags.patient_id, 64));
    for (const DcmTagKey& field : {DCM_PatientBirthDate, DCM_PatientSex, DCM_AccessionNumber,
                                   DCM_ReferringPhysicianName, DCM_PatientOrientation})
        capture.text(field, "");  // not known here; the standard asks for these, if empty
    capture.text(DCM_StudyDate, digits(tags.study_utc, 0, 10));
    capture.text(DCM_StudyTime, digits(tags.study_utc, 11, 8));
    if (!tags.study_utc.empty()) capture.text(DCM_TimezoneOffsetFromUTC, "+0000");
    capture.text(DCM_StudyID, value(tags.study_id, 16));
    capture.text(DCM_StudyDescription, value(tags.study_description, 64));
    capture.text(DCM_SeriesDescription, value(tags.series_description, 64));
    capture.text(DCM_SeriesNumber, std::to_string(tags.series_number));
    capture.text(DCM_InstanceNumber, std::to_string(tags.instance_number));
    capture.text(DCM_BodyPartExamined, "HIP");
    capture.text(DCM_Laterality, tags.side == "left" ? "L" : tags.side == "right" ? "R" : "");
    capture.text(DCM_ConversionType, "WSD");  // workstation
    capture.text(DCM_SecondaryCaptureDeviceManufacturer, "FluoroCut");
    capture.text(DCM_SecondaryCaptureDeviceManufacturerModelName, "FluoroCut");
    capture.text(DCM_SecondaryCaptureDeviceSoftwareVersions, value(tags.software, 64));
    capture.text(DCM_ImageType, "DERIVED\\SECONDARY");
    capture.text(DCM_BurnedInAnnotation, "YES");
    capture.pixels(bytes);
    return capture.write(path);
}

Result<void> writeSecondaryCapture(const fs::path& path, const Image& image, PixelType type,
                                   const ImageWriteOptions& options) {
    if (Result<void> good = checkSize(path, image.width(), image.height()); !good) return good;
    const bool wide = type == PixelType::uint16;
    const Result<std::string> bytes =
        encodeElements(path, image.pixels(), wide ? ElementType::uint16 : ElementType::uint8);
    if (!bytes) return bytes.error();
    Capture capture;
    capture.format(image.width(), image.height(), 1, wide ? 16 : 8);
    capture.text(DCM_SOPInstanceUID, newUid());
    capture.text(DCM_StudyInstanceUID, newUid());
    capture.text(DCM_SeriesInstanceUID, newUid());
    capture.text(DCM_ConversionType, "SYN");  // synthetic image
    for (const DcmTagKey& field :
         {DCM_PatientName, DCM_PatientID, DCM_PatientBirthDate, DCM_PatientSex, DCM_StudyDate, DCM_StudyTime,
          DCM_StudyID, DCM_AccessionNumber, DCM_ReferringPhysicianName, DCM_PatientOrientation}) {
        capture.text(field, "");  // the standard asks for these, if empty
    }
    capture.text(DCM_PatientIdentityRemoved, "YES");
    capture.text(DCM_DeidentificationMethod, "made without patient data");
    capture.text(DCM_BurnedInAnnotation, "NO");
    capture.text(DCM_SeriesNumber, "1");
    capture.text(DCM_InstanceNumber, "1");
    if (options.pixel_spacing_mm) {  // between rows first
        capture.text(DCM_ImagerPixelSpacing,
                     fmt::format("{:.10g}\\{:.10g}", options.pixel_spacing_mm->y(), options.pixel_spacing_mm->x()));
    }
    if (wide) {
        std::vector<Uint16> pixels(image.size());
        std::memcpy(pixels.data(), bytes->data(), bytes->size());
        capture.pixels(pixels);
    } else {
        capture.pixels(*bytes);
    }
    return capture.write(path);
}

}  // namespace fluorocut
