#include "ui/spreadsheet/pointing.h"

#include <QCoreApplication>
#include <utility>

namespace fluorocut::ui {
namespace {

View viewOf(const Picture& picture) {
    View view{picture.carm, picture.imager_from_femur->target_from_source};
    if (picture.imager_from_femur->covariance) view.covariance = *picture.imager_from_femur->covariance;
    return view;
}

bool sameShot(const Picture& a, const Picture& b) {
    return a.cut == b.cut;
}

}  // namespace

void Pointing::pointAt(PointedPlace place) {
    if (now_ && now_->view != place.view) before_ = std::move(now_);
    if (before_ && before_->view == place.view) before_.reset();
    now_ = std::move(place);
    point_.reset();
    if (!before_ || !now_->picture.imager_from_femur || !before_->picture.imager_from_femur) return;
    auto point = triangulate({{viewOf(before_->picture), before_->pixel}, {viewOf(now_->picture), now_->pixel}});
    if (point && point->rms_px <= kMeetPx) point_ = std::move(*point);
}

void Pointing::clear() {
    now_.reset();
    before_.reset();
    point_.reset();
}

Overlay Pointing::overlayFor(std::size_t view, const Picture& picture) const {
    Overlay overlay;
    for (const auto& place : {now_, before_}) {
        if (!place) continue;
        if (place->view == view) {
            // The same shot in another column may be straightened.
            if (sameShot(place->picture, picture))
                overlay.marks.push_back({Ink::epipolar,
                                         picture.carm.project(place->picture.carm.detectorPoint(place->pixel)),
                                         MarkShape::cross});
            continue;
        }
        if (!place->picture.imager_from_femur || !picture.imager_from_femur) continue;
        auto curve = epipolarCurve(viewOf(place->picture), place->pixel, viewOf(picture));
        if (curve && !curve->empty()) overlay.curves.push_back({Ink::epipolar, std::move(*curve), false, false});
    }
    if (point_ && picture.imager_from_femur) {
        const Vector3& p = point_->point;
        const QString text = QCoreApplication::translate("fluorocut::ui::Pointing", "(%1, %2, %3) mm")
                                 .arg(p.x(), 0, 'f', 1)
                                 .arg(p.y(), 0, 'f', 1)
                                 .arg(p.z(), 0, 'f', 1);
        overlay.marks.push_back({Ink::epipolar, picture.carm.project(picture.imager_from_femur->target_from_source * p),
                                 MarkShape::ring, text});
    }
    return overlay;
}

}  // namespace fluorocut::ui
