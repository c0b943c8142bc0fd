// A case to show: a tube of bone with a stem in it, X-rayed from several sides. Simple enough to know where everything
// is: the bone's axis is the femur frame's z, the stem stands in it at the origin.
#pragma once

#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>

#include "core/base/units.h"
#include "core/geometry/primitives.h"
#include "core/imaging/standard_views.h"
#include "core/imaging/volume_projector.h"
#include "ui/session/case_state.h"

namespace fluorocut::test {

// Cortex between 12 and 17 mm from the axis, marrow within, soft tissue out to 55 mm.
inline std::shared_ptr<const Volume> sampleBone() {
    VolumeGrid grid;
    grid.size = {60, 60, 110};
    grid.spacing_mm = {2, 2, 2};
    grid.origin_mm = {-59, -59, -150};
    Volume bone(grid, -1000);
    for (int k = 0; k < grid.size[2]; ++k) {
        for (int j = 0; j < grid.size[1]; ++j) {
            for (int i = 0; i < grid.size[0]; ++i) {
                const double r = grid.pointFromIndex(Vector3(i, j, k)).head<2>().norm();
                if (r < 55) bone(i, j, k) = r < 12 ? 0 : r < 17 ? 1500 : 40;
            }
        }
    }
    return std::make_shared<const Volume>(std::move(bone));
}

// The beam turned by `orbital_rad` about the patient's long axis from an AP view (core/imaging/standard_views.h).
inline Rigid3 sampleView(double orbital_rad) {
    return standardView(StandardView::ap, {0, 0, -45}, kStandardObjectDepthMm) * Rigid3::fromTranslation({0, 0, -45}) *
           Rigid3::fromRotationVector({0, 0, orbital_rad}) * Rigid3::fromTranslation({0, 0, 45});
}

inline ui::CaseState sampleCase(int views, int size_px = 512) {
    ui::CaseState state;
    state.patient = "Sample";
    state.side = "left";
    state.ct = sampleBone();
    StemShape stem;
    state.plan.mesh = std::make_shared<const TriangleMesh>(makeStem(stem));
    for (const double wider : {-2.0, 0.5}) {
        StemShape cavity = stem;
        cavity.tip_width_mm += Vector2::Constant(wider);
        cavity.top_width_mm += Vector2::Constant(wider);
        state.plan.cavities.push_back(std::make_shared<const TriangleMesh>(makeStem(cavity)));
    }
    state.plan.insets_mm = {1, 0};
    state.canal = ui::CanalAxis{{0, 0, -150}, {0, 0, 20}};
    state.beads = {{25, 5, -20}, {-24, 8, -60}, {5, -26, -110}};

    auto projector = VolumeProjector::prepare(state.ct);
    if (!projector) throw std::logic_error(projector.error().message());
    for (int v = 0; v < views; ++v) {
        ui::CaseView view;
        view.carm = standardCArm();
        const double binned = static_cast<double>(view.carm.columns) / size_px;
        view.carm.columns = view.carm.rows = size_px;
        view.carm.pixel_mm *= binned;
        view.carm.principal_point_px = Vector2::Constant(0.5 * (size_px - 1));
        const double angle = v * std::numbers::pi / views;
        view.name = v == 0 ? "AP" : "View " + std::to_string(v + 1);
        view.position.orbital_rad = angle;
        Pose pose{Frame::imager, Frame::femur, sampleView(angle), Matrix6::Zero()};
        pose.covariance->diagonal() << 0.04, 0.04, 1, 1e-6, 1e-6, 1e-6;
        view.before.imager_from_femur = pose;
        view.before.registration_mm = 0.31;
        Image image = projector->project(view.carm, pose.target_from_source);
        for (float& value : image.pixels())
            value = 10000 * std::exp(-value);
        view.before.image = std::make_shared<const Image>(std::move(image));
        state.views.push_back(std::move(view));
    }
    return state;
}

}  // namespace fluorocut::test
