// The exact ray tracer of plastimatch (`plastimatch drr`), run as a program: the peer that the CT projector is measured
// against. Siddon's algorithm: voxels are boxes.
#pragma once

#include <filesystem>

#include "core/geometry/rigid3.h"
#include "core/image/image.h"
#include "core/image/volume.h"
#include "core/imaging/carm.h"

namespace fluorocut::test {

bool plastimatchIsInstalled();

// Writes a CT as what it shall integrate: HU + 1000, float32, raw MHA. Throws std::runtime_error on failure.
void writeForPlastimatch(const Volume& hounsfield, const std::filesystem::path& path);

struct PlastimatchProjection {
    Image line_integrals;   // of the volume file's values, mm
    double elapsed_ms = 0;  // what it reports itself: no reading of the volume, no start of the program
};

// The C-arm must look through the middle of its image and have no distortion. Throws std::runtime_error on failure.
PlastimatchProjection runPlastimatch(const std::filesystem::path& volume, const CArm& carm,
                                     const Rigid3& imager_from_volume, const std::filesystem::path& scratch);

}  // namespace fluorocut::test
