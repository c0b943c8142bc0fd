// C-arm files, fluorocut/carm/1:
//     {"schema": "fluorocut/carm/1", "name": "GE Polarix 2", "columns": 512, "rows": 512, "pixel_mm": [0.32, 0.32],
//      "focal_length_mm": 1000.0, "principal_point_px": [255.5, 255.5], "distortion": null}
// Fields and limits are those of CArm; pixel centres at integers. `distortion` is null, or the path of a distortion
// file, relative to this file.
//
// Which models of distortion there are is not known here: their folder comes after this one. It hands over their
// readers, one for each schema; a file whose schema is not among them is refused by name. A reader is given the C-arm
// as far as it is known, without distortion: its pixels are what a map from pixels to mm has to be turned by.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "core/base/result.h"
#include "core/imaging/carm.h"

namespace fluorocut {

// From the schema of a distortion file to what reads it.
using DistortionReader = std::function<Result<std::shared_ptr<const Distortion>>(const std::filesystem::path&,
                                                                                 const CArm& without_distortion)>;
using DistortionReaders = std::map<std::string, DistortionReader>;

Result<CArm> readCArm(const std::filesystem::path& path, const DistortionReaders& readers = {});

// `distortion_file` is where the C-arm's distortion was written; it is named relative to `path` when it is absolute. A
// C-arm with a distortion but no file of it (or the other way round) is a broken contract and throws std::logic_error.
Result<void> writeCArm(const std::filesystem::path& path, const CArm& carm,
                       const std::filesystem::path& distortion_file = {});

}  // namespace fluorocut
