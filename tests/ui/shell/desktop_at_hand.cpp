#include "tests/ui/shell/desktop_at_hand.h"

#include "core/geometry/primitives.h"
#include "core/imaging/standard_views.h"

namespace fluorocut::test {

ui::CaseState smallCase() {
    ui::CaseState state;
    state.patient = DesktopAtHand::kPatient;
    state.side = "left";
    for (const auto& [name, view] : {std::pair{"AP", StandardView::ap}, {"Lateral", StandardView::lateral}}) {
        ui::CaseView made;
        made.name = name;
        made.carm = standardCArm().binned(8);
        Image image(made.carm.columns, made.carm.rows);
        for (int y = 0; y < image.height(); ++y)
            for (int x = 0; x < image.width(); ++x)
                image(x, y) = static_cast<float>(1000 + 5 * x + 3 * y);
        made.before.image = std::make_shared<const Image>(std::move(image));
        made.before.imager_from_femur = Pose{Frame::imager, Frame::femur, standardView(view, Vector3::Zero(), 700), {}};
        made.before.registration_mm = 0.1;
        state.views.push_back(std::move(made));
    }
    state.plan.family = "box";
    state.plan.mesh = std::make_shared<const TriangleMesh>(makeBox({12, 10, 100}));
    return state;
}

ui::Settings& DesktopAtHand::prepared(ui::Settings& settings, const ScratchFolder& folder) {
    settings.setCaseFolder(QString::fromStdString((folder / "cases").string()));
    return settings;
}

DesktopAtHand::DesktopAtHand(const QString& settings)
    : sample_([](Progress&) -> Result<ui::CaseState> { return smallCase(); }),
      settings_(settings.isEmpty() ? QString::fromStdString((scratch_ / "settings.ini").string()) : settings),
      window_(session_, prepared(settings_, scratch_), [this](Progress& progress) { return sample_(progress); }) {
    window_.show();
}

}  // namespace fluorocut::test
