// DICOM Secondary Capture: a picture in the archive's format, and nothing that identifies a person or a machine. UIDs
// are random (root 2.25, PS3.5 B.2).
#include <cstring>
#include <random>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcfilefo.h>
#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>

#include "core/io/atomic_file.h"
#include "core/io/formats/dicom.h"
#include "core/io/formats/raster.h"

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

}  // namespace

Result<void> writeSecondaryCapture(const fs::path& path, const Image& image, PixelType type,
                                   const ImageWriteOptions& options) {
    if (image.width() > 65535 || image.height() > 65535) {
        return invalidOption(path.string(), fmt::format("{} x {} pixels", image.width(), image.height()),
                             "at most 65535 x 65535 in DICOM");
    }
    const bool wide = type == PixelType::uint16;
    const Result<std::string> bytes =
        encodeElements(path, image.pixels(), wide ? ElementType::uint16 : ElementType::uint8);
    if (!bytes) return bytes.error();
    DcmFileFormat file;
    DcmDataset& data = *file.getDataset();
    OFCondition status = EC_Normal;
    const auto text = [&](const DcmTagKey& field, const std::string& value) {
        if (status.good()) status = data.putAndInsertOFStringArray(field, value.c_str());
    };
    const auto number = [&](const DcmTagKey& field, int value) {
        if (status.good()) status = data.putAndInsertUint16(field, static_cast<Uint16>(value));
    };
    text(DCM_SOPClassUID, UID_SecondaryCaptureImageStorage);
    text(DCM_SOPInstanceUID, newUid());
    text(DCM_StudyInstanceUID, newUid());
    text(DCM_SeriesInstanceUID, newUid());
    text(DCM_Modality, "OT");
    text(DCM_ConversionType, "SYN");  // synthetic image
    for (const DcmTagKey& field :
         {DCM_PatientName, DCM_PatientID, DCM_PatientBirthDate, DCM_PatientSex, DCM_StudyDate, DCM_StudyTime,
          DCM_StudyID, DCM_AccessionNumber, DCM_ReferringPhysicianName, DCM_PatientOrientation}) {
        text(field, "");  // the standard asks for these, if empty
    }
    text(DCM_PatientIdentityRemoved, "YES");
    text(DCM_DeidentificationMethod, "made without patient data");
    text(DCM_BurnedInAnnotation, "NO");
    text(DCM_SeriesNumber, "1");
    text(DCM_InstanceNumber, "1");
    text(DCM_PhotometricInterpretation, "MONOCHROME2");
    number(DCM_SamplesPerPixel, 1);
    number(DCM_Rows, image.height());
    number(DCM_Columns, image.width());
    number(DCM_BitsAllocated, wide ? 16 : 8);
    number(DCM_BitsStored, wide ? 16 : 8);
    number(DCM_HighBit, wide ? 15 : 7);
    number(DCM_PixelRepresentation, 0);
    if (options.pixel_spacing_mm) {  // between rows first
        text(DCM_ImagerPixelSpacing,
             fmt::format("{:.10g}\\{:.10g}", options.pixel_spacing_mm->y(), options.pixel_spacing_mm->x()));
    }
    if (status.good() && wide) {
        std::vector<Uint16> pixels(image.size());
        std::memcpy(pixels.data(), bytes->data(), bytes->size());
        status = data.putAndInsertUint16Array(DCM_PixelData, pixels.data(), static_cast<unsigned long>(pixels.size()));
    } else if (status.good()) {
        status = data.putAndInsertUint8Array(DCM_PixelData, reinterpret_cast<const Uint8*>(bytes->data()),
                                             static_cast<unsigned long>(bytes->size()));
    }
    return writeWhole(path, [&](const fs::path& temporary) -> Result<void> {
        if (status.good()) status = file.saveFile(temporary.c_str(), EXS_LittleEndianExplicit, EET_ExplicitLength);
        if (status.bad())
            return outputFailed(path.string(), fmt::format("DICOM that cannot be written ({})", status.text()));
        return {};
    });
}

}  // namespace fluorocut
