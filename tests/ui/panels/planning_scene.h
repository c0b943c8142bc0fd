// A case to plan in: a left femur's stem in two registered views, AP and lateral, and one that is not registered.
#pragma once

#include "core/imaging/standard_views.h"
#include "core/planning/implant_file.h"
#include "ui/panels/plan_edits.h"

namespace fluorocut::test {

inline Rigid3 stemInFemur() {
    StemSeat seat;
    seat.medial = {-1, 0, 0};
    return femurFromCavity(seat, {.varus_rad = 0.02, .version_rad = 0.1, .height_mm = 5});
}

inline ui::CaseState planningCase(const std::string& size = "12", int triangles = 6000) {
    ui::CaseState state;
    state.patient = "Test";
    state.side = "left";
    state.canal = ui::CanalAxis{{2, 1, -150}, {0, 0, 0}};
    const auto image = std::make_shared<const Image>(512, 512, 1.0F);
    for (const auto& [name, standard] :
         {std::pair("AP", StandardView::ap), std::pair("Lateral", StandardView::lateral)}) {
        ui::CaseView view;
        view.name = name;
        view.carm = CArm{};  // 512 x 512 pixels of 0.32 mm
        view.before.image = image;
        view.before.imager_from_femur = Pose{Frame::imager, Frame::femur, standardView(standard, {0, 0, -50}, 700), {}};
        state.views.push_back(view);
    }
    ui::CaseView lost = state.views.front();
    lost.name = "Oblique";
    lost.before.imager_from_femur.reset();
    lost.before.unregistered_because = "no corkscrew in the image";
    state.views.push_back(lost);
    const auto implant = loadImplant("straight", {size, Side::left, 32, 0, triangles});
    return ui::withImplant(std::move(state), *implant, stemInFemur());
}

}  // namespace fluorocut::test
