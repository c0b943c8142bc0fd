// Reading and writing volumes: MetaImage, NRRD, NIfTI-1, TIFF stacks, and CT series in a DICOM folder. The format is
// told from the content when reading, from the extension when writing. Frame: DICOM LPS, mm, whatever the file uses
// (NIfTI is RAS). A CT holds Hounsfield units.
//
// DICOM folder: every DICOM image in it and below it. Slices are sorted by position along the normal of their plane.
// Gaps, duplicate slices, mixed orientations, sizes or spacings, a tilted gantry and more than one series are errors
// that name the files; slices thicker than their distance are a warning in VolumeInfo::notes.
//
// Every failure is one sentence with ErrorCode::invalidInput that names the path as given (or cancelled). Declared
// sizes are checked against the file's size and against a limit (2^30 voxels) before memory is taken; voxels are
// finite.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/image/volume.h"

namespace fluorocut {

enum class VoxelType { int16, float32 };

struct VolumeInfo {
    std::string format;  // "MetaImage", "NRRD", "NIfTI", "TIFF", "DICOM"
    VolumeGrid grid;
    int bits = 0;  // meaningful bits of a stored voxel
    bool is_signed = false;
    bool is_float = false;
    float least = 0;
    float most = 0;

    // DICOM only
    int files = 1;
    std::string modality;
    std::string manufacturer;
    std::string transfer_syntax;
    std::string series_uid;
    std::optional<double> slice_thickness_mm;
    bool has_identifying_fields = false;  // a patient's name, ID, birth date, ...: present, never shown

    std::vector<std::string> notes;  // what was done to the voxels, and warnings
};

struct VolumeFile {
    Volume volume;
    VolumeInfo info;
};

struct VolumeReadOptions {
    std::string series_uid;             // which series of a DICOM folder that holds several
    std::optional<Vector3> spacing_mm;  // for a TIFF stack, which has none; other files state their own
};

Result<VolumeFile> readVolume(const std::filesystem::path& path, const VolumeReadOptions& options = {},
                              Progress& progress = Progress::none());

struct VolumeWriteOptions {
    VoxelType type = VoxelType::float32;
    bool compressed = false;  // MHA, NRRD: raw is what every program reads, and quick; .nii is never, .nii.gz always
};

// By extension: .mha, .nrrd, .nii, .nii.gz. int16 rounds; a voxel that does not fit is an error.
Result<void> writeVolume(const std::filesystem::path& path, const Volume& volume,
                         const VolumeWriteOptions& options = {});

inline Result<void> writeVolume(const std::filesystem::path& path, const Volume& volume, VoxelType type) {
    return writeVolume(path, volume, VolumeWriteOptions{type});
}

}  // namespace fluorocut
