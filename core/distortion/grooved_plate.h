// GroovedPlate: the paper's device against distortion, an aluminium plate with two crossing sets of equally spaced
// grooves that lies on the detector. Files: fluorocut/plate/1
//     {"schema": "fluorocut/plate/1", "pitch_mm": 6.35, "groove_width_mm": 1.5875, "groove_depth_mm": 4.7625,
//      "thickness_mm": 6.35, "material": "aluminium", "grooves": [35, 35]}
// `grooves`: how many run along y (columns) and along x (rows); null: as many as are seen.
//
// Frame `plate`: origin at the middle of a groove crossing, x and y along the grooves, mm; groove i along y has its
// middle line at x = i * pitch_mm, groove j along x at y = j * pitch_mm. z points away from the X-ray source, z = 0 at
// half the depth of the grooves: seen obliquely, a groove's shadow lies symmetrically about its middle line there.
// This plane is what FluoroCut calls the detector plane: the plate gives it its millimetres. Nothing tells one crossing
// from another: which one is the origin is a choice that each image makes anew.
#pragma once

#include <array>
#include <filesystem>
#include <optional>

#include "core/base/result.h"
#include "core/imaging/materials.h"

namespace fluorocut {

struct GroovedPlate {
    double pitch_mm = 6.35;
    double groove_width_mm = 1.5875;
    double groove_depth_mm = 4.7625;
    double thickness_mm = 6.35;
    Material material = Material::aluminium;
    std::optional<std::array<int, 2>> grooves;  // along y (columns), along x (rows)

    // Names the field, the value and the limit.
    Result<void> validate() const;

    // What a groove adds to the log intensity: mu * depth.
    double grooveContrast(double energy_kev = kEffectiveEnergyKev) const;
};

Result<GroovedPlate> readGroovedPlate(const std::filesystem::path& path);
Result<void> writeGroovedPlate(const std::filesystem::path& path, const GroovedPlate& plate);

}  // namespace fluorocut
