// A simple patient: a bone of elliptic section, cortex around spongy bone, bent a little, in soft tissue; a stem cut
// into it, and two views 55 degrees apart from before and after the cut. Small and quick.
#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include "core/base/random.h"
#include "core/base/units.h"
#include "core/cavity/cavity_location.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/primitives.h"
#include "core/imaging/standard_views.h"
#include "core/imaging/volume_projector.h"
#include "core/imaging/xray_physics.h"
#include "core/simulation/cutting.h"

namespace fluorocut::test {

struct TubePhantom {
    std::shared_ptr<const Volume> ct;
    TriangleMesh stem;
    Vector3 middle;
    Rigid3 planned;
};

inline const TubePhantom& tubePhantom() {
    static const TubePhantom made = [] {
        VolumeGrid grid;
        grid.size = {70, 66, 130};
        grid.spacing_mm = Vector3::Constant(1);
        grid.origin_mm = Vector3(-35, -33, -65);
        auto ct = std::make_shared<Volume>(grid);
        for (int k = 0; k < 130; ++k) {
            for (int j = 0; j < 66; ++j) {
                for (int i = 0; i < 70; ++i) {
                    const Vector3 p = grid.pointFromIndex({double(i), double(j), double(k)});
                    const double x = p.x() - 1e-3 * p.z() * p.z(), swell = 1 + 0.002 * p.z();
                    const double r = std::hypot(x / 18, p.y() / 16) / swell;
                    // Cortex from 0.8 to 1, each border over a voxel; a pattern of spongy bone.
                    const auto step = [](double t) { return 1 / (1 + std::exp(-60 * t)); };
                    const double flesh = step((30 - std::hypot(p.x(), p.y())) / 18);
                    const double cortex = step(1 - r) * step(r - 0.8), inside = step(0.8 - r);
                    const double spongy = 250 + 80 * std::sin(p.x() / 2) * std::sin(p.y() / 2.5) * std::sin(p.z() / 3);
                    (*ct)(i, j, k) = static_cast<float>(1040 * flesh - 1000 + 1300 * cortex + spongy * inside);
                }
            }
        }
        StemShape shape;
        shape.length_mm = 80;
        shape.segments = 40;
        shape.sections = 30;
        shape.top_width_mm = {22, 14};
        TubePhantom phantom{ct, makeStem(shape), Vector3::Zero(), Rigid3::fromTranslation({2, 0, 38})};
        phantom.middle = meshProperties(phantom.stem).centroid;
        return phantom;
    }();
    return made;
}

struct TubeScene {
    Rigid3 truth;
    std::vector<CavityView> views;
};

// `off`: planned_from_cut, about the stem's middle. Between before and after the C-arm moved by `way` (as
// Rigid3::perturbed has it, about the stem's middle) in each view, and the other way in the second one. Poses are
// exact.
inline TubeScene tubeScene(const Rigid3& off, const Vector6& way, std::uint64_t seed = 1) {
    const TubePhantom& phantom = tubePhantom();
    const Rigid3 to_stem = Rigid3::fromTranslation(phantom.middle), from_stem = to_stem.inverse();
    TubeScene scene;
    scene.truth = phantom.planned * to_stem * off * from_stem;
    const auto whole = VolumeProjector::prepare(phantom.ct);
    const auto cut =
        VolumeProjector::prepare(std::make_shared<Volume>(cutMesh(*phantom.ct, phantom.stem, scene.truth)->volume));
    CArm carm = standardCArm();
    carm.columns = carm.rows = 480;
    carm.pixel_mm = {0.4, 0.4};
    carm.principal_point_px = {239.5, 239.5};
    const Vector3 middle = phantom.planned * phantom.middle;
    const Rigid3 to_middle = Rigid3::fromTranslation(middle), from_middle = to_middle.inverse();
    for (const int side : {-1, 1}) {
        const Rigid3 nominal = standardView(StandardView::ap, middle, kStandardObjectDepthMm) * to_middle *
                               Rigid3::fromRotationVector({0, 0, side * radiansFromDegrees(27.5)});
        CavityView view;
        view.name = side < 0 ? "left" : "right";
        view.carm = carm;
        view.after_imager_from_femur = nominal * from_middle;
        view.before_imager_from_femur = nominal.perturbed(side * way) * from_middle;
        XrayOptions xray;
        xray.seed = 2 * seed;
        view.after = expose(cut->project(carm, view.after_imager_from_femur), carm, xray)->image;
        xray.seed = 2 * seed + 1;
        view.before = expose(whole->project(carm, view.before_imager_from_femur), carm, xray)->image;
        scene.views.push_back(std::move(view));
    }
    return scene;
}

}  // namespace fluorocut::test
