// DistortionMapSet: maps measured beforehand at key poses of the C-arm, for images taken without the plate.
//
// The distortion of an image intensifier turns with its place in the Earth's magnetic field and sags with gravity: it
// is a smooth function of where the detector looks. A map for another pose is interpolated between measured ones:
// exactly the measured map at a measured pose, refused in words when the pose is too far from all that were measured or
// when those near it are too old. Poses differ by the angle between the beams' directions
// (core/imaging/carm_position.h).
//
// Files: fluorocut/distortion-set/1
//     {"schema": "fluorocut/distortion-set/1",
//      "maps": [{"file": "ap.json", "orbital_deg": 0, "angulation_deg": 0, "measured_at": "2026-03-01T09:30:00Z"},
//      ...]}
// Files are relative to this one, of the schema fluorocut/distortion/1; angles and time win over those in them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/units.h"
#include "core/distortion/distortion_map.h"

namespace fluorocut {

struct DistortionSetLimits {
    // From the nearest measured pose. A grid of poses every 30 degrees has its middles 21 degrees away; on the
    // simulated intensifier it interpolates to 0.001 mm (60 degrees: 0.025; the nearest map alone: 0.06 and 0.1).
    double max_angle_rad = radiansFromDegrees(25);
    double max_age_days = 180;

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

class DistortionMapSet {
  public:
    // Every map with a position and a time, all of one image size; invalidInput in words. Of maps less than half a
    // degree apart the newest is used.
    static Result<DistortionMapSet> create(std::vector<DistortionMap> maps);

    const std::vector<DistortionMap>& maps() const { return maps_; }

    // `now`: "2026-03-05T08:00:00Z". The map's pixel_mm is that of the nearest measured one.
    Result<DistortionMap> mapAt(const CArmPosition& position, const std::string& now,
                                const DistortionSetLimits& limits = {}) const;

  private:
    explicit DistortionMapSet(std::vector<DistortionMap> maps) : maps_(std::move(maps)) {}

    std::vector<DistortionMap> maps_;
};

// The angle between two views' beams.
double angleBetween(const CArmPosition& a, const CArmPosition& b);

Result<DistortionMapSet> readDistortionMapSet(const std::filesystem::path& path);
// Each map's file, in the order of `set.maps()`, is named relative to `path`; they are written by writeDistortionMap.
Result<void> writeDistortionMapSet(const std::filesystem::path& path, const DistortionMapSet& set,
                                   const std::vector<std::filesystem::path>& map_files);

}  // namespace fluorocut
