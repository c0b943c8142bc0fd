// Pictures for an archive: DICOM Secondary Capture in colour, with the patient and the study that they belong to. For
// eyes: what is drawn over them is burned in. Without a patient's data: writeImage (image_file.h).
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/base/result.h"
#include "core/image/image.h"

namespace fluorocut {

// Text is UTF-8; what is longer than DICOM allows is cut off.
struct CaptureTags {
    std::string patient_name;  // "Doe, Jane" and "Doe^Jane" become the archive's Doe^Jane, others stay as they are
    std::string patient_id;    // the archive's; may be empty
    std::string side;          // "left", "right"; anything else: not said
    std::string study_uid, series_uid, instance_uid;
    std::string study_id, study_description, series_description;
    std::string study_utc;  // when it was begun, ISO 8601 in UTC
    int series_number = 1, instance_number = 1;
    std::string software;  // version of FluoroCut
};

// 2.25 and the number (PS3.5 B.2) of a UUID of version 8 with these 32 hexadecimal digits, less those that say so. From
// a hash: what is sent twice is archived once. Anything else: std::logic_error.
std::string uidFromHash(std::string_view hex32);

Result<void> writeCapture(const std::filesystem::path& path, const ColorImage& picture, const CaptureTags& tags);

}  // namespace fluorocut
