// What templating from a CT and from views share: trying sizes from the largest downward.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "core/planning/stem_fit.h"
#include "core/planning/templating.h"

namespace fluorocut {

struct TemplateBone {
    const Filling& filling;
    // What is wrong with a point that has an excess, after "it ": "cuts 0.9 mm into the cortex (allowed 0.5 mm)".
    std::function<std::string(const Vector3& point, double excess_mm)> complaint;
    Vector3 lowest;  // on the axis: below it nothing of the bone is known
    std::vector<Rigid3> starts;
};

// The surface that lies in bone, without the cap at the resection.
std::vector<Vector3> stemSurface(const Implant& implant, std::size_t most);

// "medial", "antero-lateral": where a point lies seen from the stem's axis at its level.
std::string sideOf(const Vector3& point_in_cavity, Side side);

// Everything but fill and walls.
Result<TemplateProposal> searchSizes(const std::vector<Implant>& sizes, const StemSeat& seat, const TemplateBone& bone,
                                     const TemplateOptions& options, Progress& progress);

const Implant& implantOfSize(const std::vector<Implant>& sizes, const std::string& size);

}  // namespace fluorocut
