// Pictures of a corkscrew among metal and bone for tests: exact path lengths through closed meshes, then the imaging
// chain. Nothing of the code under test.
#pragma once

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "core/fiducial/corkscrew_layout.h"
#include "core/fiducial/corkscrew_solid.h"
#include "core/geometry/primitives.h"
#include "core/imaging/mesh_projector.h"
#include "core/imaging/xray_physics.h"

namespace fluorocut::test {

struct RoundBar {
    Vector3 middle_mm;  // imager frame
    Vector3 axis;
    double radius_mm = 4, length_mm = 150;
    Material material = Material::steel;
    Material displaced = Material::air;
};

struct CorkscrewView {
    CArm carm;
    CorkscrewLayout layout;
    Rigid3 imager_from_corkscrew;
    std::vector<RoundBar> bars;
    bool corkscrew = true;  // in the image at all
    double photons = 1000;
    double soft_tissue_mm = 20;
    double blur_px = 0.7;
    bool metal_is_bright = false;
    std::uint64_t seed = 1;
};

inline void addLengths(Image& sum, const CArm& carm, const TriangleMesh& mesh, const Rigid3& pose, double mu_per_mm) {
    if (mesh.triangles.empty()) return;
    const auto projector = MeshProjector::prepare(mesh);
    if (!projector) throw std::runtime_error(projector.error().message());
    const Image lengths = projector->project(carm, pose);
    for (std::size_t i = 0; i < sum.size(); ++i)
        sum.pixels()[i] += static_cast<float>(mu_per_mm) * lengths.pixels()[i];
}

inline Image pictureOf(const CorkscrewView& view) {
    const auto mu = [](Material material) { return attenuationPerMm(material); };
    Image sum(view.carm.columns, view.carm.rows, static_cast<float>(view.soft_tissue_mm * mu(Material::softTissue)));
    if (view.corkscrew) {
        const CorkscrewLayout& layout = view.layout;
        const auto solid = corkscrewSolid(layout, CorkscrewFineness::coarse());
        if (!solid) throw std::runtime_error(solid.error().message());
        const auto add = [&](const TriangleMesh& mesh, double mu_per_mm) {
            addLengths(sum, view.carm, mesh, view.imager_from_corkscrew, mu_per_mm);
        };
        add(solid->rod, mu(layout.rod));
        add(solid->shaft_inside, mu(layout.shaft) - mu(layout.rod));
        add(solid->shaft_outside, mu(layout.shaft));
        add(solid->helix, mu(layout.wire) - mu(layout.rod));
        for (const TriangleMesh& ring : solid->rings)
            add(ring, mu(layout.wire) - mu(layout.rod));
        for (const TriangleMesh& bead : solid->beads)
            add(bead, mu(layout.shaft) - mu(layout.rod));
    }
    for (const RoundBar& bar : view.bars) {
        const Rigid3 pose(Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), bar.axis), bar.middle_mm);
        addLengths(sum, view.carm, makeCylinder(bar.radius_mm, bar.length_mm, 48), pose,
                   mu(bar.material) - mu(bar.displaced));
    }
    XrayOptions options;
    options.photons_per_pixel = view.photons;
    options.detector_blur_px = view.blur_px;
    options.bits = 0;
    options.seed = view.seed;
    const auto exposure = expose(sum, view.carm, options);
    if (!exposure) throw std::runtime_error(exposure.error().message());
    Image image = exposure->image;
    if (view.metal_is_bright) {
        const float brightest = *std::max_element(image.pixels().begin(), image.pixels().end());
        for (float& value : image.pixels())
            value = brightest - value;
    }
    return image;
}

}  // namespace fluorocut::test
