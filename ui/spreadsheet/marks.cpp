#include "ui/spreadsheet/marks.h"

#include <QCoreApplication>
#include <QStringList>
#include <cmath>
#include <numeric>

#include "core/base/units.h"
#include "core/imaging/patient_direction.h"

namespace fluorocut::ui {
namespace {

QString tr(const char* text) {
    return QCoreApplication::translate("fluorocut::ui::Marks", text);
}

struct Place {
    Vector3 in_femur;
    QString name;
};

std::optional<Place> placeOf(const CaseState& state) {
    if (state.plan.mesh && !state.plan.mesh->vertices.empty())
        return Place{state.plan.femur_from_implant * Vector3(boundsOf(state.plan.mesh).center()), tr("at the implant")};
    if (state.canal) return Place{0.5 * (state.canal->distal + state.canal->proximal), tr("at the canal")};
    if (!state.beads.empty()) {
        const Vector3 sum = std::accumulate(state.beads.begin(), state.beads.end(), Vector3(Vector3::Zero()));
        return Place{sum / static_cast<double>(state.beads.size()), tr("at the beads")};
    }
    if (state.ct) return Place{state.ct->grid().center(), tr("at the middle of the CT")};
    return std::nullopt;
}

}  // namespace

QString anglesText(const CArmPosition& position) {
    QStringList parts;
    const auto add = [&](double rad, const char* positive, const char* negative) {
        const double deg = degreesFromRadians(rad);
        if (std::abs(deg) < 0.05) return;
        parts << QStringLiteral("%1 %2°")
                     .arg(tr(deg > 0 ? positive : negative))
                     .arg(std::abs(deg), 0, 'f', std::abs(deg - std::round(deg)) < 0.05 ? 0 : 1);
    };
    add(position.orbital_rad, QT_TRANSLATE_NOOP("fluorocut::ui::Marks", "LAO"),
        QT_TRANSLATE_NOOP("fluorocut::ui::Marks", "RAO"));
    add(position.angulation_rad, QT_TRANSLATE_NOOP("fluorocut::ui::Marks", "CRA"),
        QT_TRANSLATE_NOOP("fluorocut::ui::Marks", "CAU"));
    return parts.isEmpty() ? tr("AP, 0°") : parts.join(QStringLiteral(", "));
}

QString registrationText(const TakenImage& taken) {
    if (taken.imager_from_femur) {
        if (!(taken.registration_mm > 0)) return tr("Registered");
        return tr("Registered, %1 mm rms").arg(taken.registration_mm, 0, 'f', 2);
    }
    return tr("Not registered");
}

QString poseText(const TakenImage& taken) {
    if (!taken.imager_from_femur) return QString::fromStdString(taken.unregistered_because);
    const Rigid3& pose = taken.imager_from_femur->target_from_source;
    const Vector3 turn = pose.twistRollPitch();
    return tr("Femur in the imager: (%1, %2, %3) mm; turned (%4, %5, %6)°")
        .arg(pose.translation().x(), 0, 'f', 1)
        .arg(pose.translation().y(), 0, 'f', 1)
        .arg(pose.translation().z(), 0, 'f', 1)
        .arg(degreesFromRadians(turn.x()), 0, 'f', 1)
        .arg(degreesFromRadians(turn.y()), 0, 'f', 1)
        .arg(degreesFromRadians(turn.z()), 0, 'f', 1);
}

ViewMarks marksOf(const CaseState& state, std::size_t view, const Picture& picture) {
    const CaseView& row = state.views.at(view);
    ViewMarks marks;
    double depth_mm = picture.carm.focal_length_mm;
    marks.plane = tr("at the detector");
    if (picture.imager_from_femur) {
        const Rigid3& pose = picture.imager_from_femur->target_from_source;
        const Matrix3 femur_from_imager = pose.rotationMatrix().transpose();
        const auto letters = [&](const Vector3& in_imager) {
            return QString::fromStdString(patientDirection(femur_from_imager * in_imager));
        };
        marks.right = letters(Vector3::UnitX());
        marks.left = letters(-Vector3::UnitX());
        marks.bottom = letters(Vector3::UnitY());
        marks.top = letters(-Vector3::UnitY());
        if (const std::optional<Place> place = placeOf(state)) {
            const double z = (pose * place->in_femur).z();
            if (z > 1) {
                depth_mm = z;
                marks.plane = place->name;
            }
        }
    }
    marks.px_per_mm = picture.carm.focal_length_mm / (depth_mm * picture.carm.pixel_mm.mean());
    marks.header << QStringLiteral("%1   %2").arg(anglesText(row.position),
                                                  tr("f %1 mm").arg(picture.carm.focal_length_mm, 0, 'f', 0))
                 << registrationText(picture.cut > 0 ? row.after.at(static_cast<std::size_t>(picture.cut) - 1)
                                                     : row.before);
    return marks;
}

}  // namespace fluorocut::ui
