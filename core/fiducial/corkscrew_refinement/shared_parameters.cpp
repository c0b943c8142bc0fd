#include <stdexcept>

#include <fmt/format.h>

#include "core/fiducial/corkscrew_refinement.h"

namespace fluorocut {
namespace {

// The layout's dimensions, in the order of corkscrewParameters(): `visit` gets the name and what to change.
template <class Layout, class Visit>
void forDimensions(Layout& layout, const Visit& visit) {
    for (std::size_t i = 0; i < layout.rings.size(); ++i) {
        visit(fmt::format("ring {} x", i + 1), layout.rings[i].x_mm);
        visit(fmt::format("ring {} radius", i + 1), layout.rings[i].radius_mm);
    }
    visit("helix start x", layout.helix.x_start_mm);
    visit("helix end x", layout.helix.x_end_mm);
    visit("helix radius", layout.helix.radius_mm);
    visit("helix phase", layout.helix.phase_rad);
    for (std::size_t i = 0; i < layout.beads.size(); ++i) {
        const char* names[] = {"x", "y", "z"};
        for (int k = 0; k < 3; ++k)
            visit(fmt::format("bead {} {}", i + 1, names[k]), layout.beads[i].center_mm[k]);
    }
}

}  // namespace

std::vector<std::string> corkscrewParameters(const CorkscrewLayout& layout) {
    std::vector<std::string> names{"focal length", "image centre u", "image centre v"};
    forDimensions(layout, [&](const std::string& name, const double&) { names.push_back(name); });
    return names;
}

CArm withParameters(const CArm& carm, const Eigen::VectorXd& parameters) {
    if (parameters.size() < 3) throw std::logic_error("withParameters: fewer than three parameters");
    CArm changed = carm;
    changed.focal_length_mm *= 1 + parameters[0];
    changed.principal_point_px += parameters.segment<2>(1);
    return changed;
}

CorkscrewLayout withParameters(const CorkscrewLayout& layout, const Eigen::VectorXd& parameters) {
    if (parameters.size() != static_cast<Eigen::Index>(corkscrewParameters(layout).size()))
        throw std::logic_error("withParameters: another number of parameters");
    CorkscrewLayout changed = layout;
    Eigen::Index next = 3;
    forDimensions(changed, [&](const std::string&, double& value) { value += parameters[next++]; });
    return changed;
}

}  // namespace fluorocut
