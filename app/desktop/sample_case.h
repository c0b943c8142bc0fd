// The sample case: the built-in femur on the table of the virtual operating room, with beads in its bone, pictures of
// it from six sides, and a straight stem planned in its canal. What can be worked out is worked out by the estimators
// that a real case is worked out with: the views are registered by the beads (core/fiducial/femur_beads.h), the stem is
// proposed from the CT (core/planning/templating.h). Nobody looks at the room's truth.
//
// Made once (a few seconds) and kept as a case file in the user's cache, so that the next time it is there at once.
#pragma once

#include <filesystem>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "ui/session/case_state.h"

namespace fluorocut::desktop {

// To be raised when another sample is made than before: a cache holds the old one for ever.
inline constexpr int kSampleRevision = 2;

struct SampleOptions {
    double voxel_mm = 0.8;
    double photons_per_pixel = 50'000;  // some 1000 arrive behind the hip
    int stages = 3;                     // of the cavity
    double first_inset_mm = 1.5;        // of the first of them
};

Result<ui::CaseState> makeSampleCase(const SampleOptions& options, Progress& progress);

// The one kept at `cache`; made and put there when there is none, or none that can be read. A cache that cannot be
// written costs only time.
Result<ui::CaseState> sampleCase(const std::filesystem::path& cache, Progress& progress);

}  // namespace fluorocut::desktop
