#include "ui/panels/measurements.h"

#include <QCoreApplication>
#include <cmath>

#include "core/base/units.h"
#include "ui/panels/plan_edits.h"

namespace fluorocut::ui {
namespace {

QString tr(const char* text) {
    return QCoreApplication::translate("fluorocut::ui::Measurements", text);
}

Measure missing(const QString& what) {
    Measure measure;
    measure.unit = "mm";
    measure.warnings.push_back(what.toStdString());
    return measure;
}

// Hip centres for the plan's measures, or what is missing for them.
std::optional<HipCenters> hipOf(const CaseState& state, const std::optional<LineFit>& canal, QString& why) {
    HipCenters hip;
    const ImplantPlan& plan = state.plan;
    if (!plan.implant || !plan.implant->head_center.allFinite()) {
        why = tr("Needs an implant with a head.");
        return std::nullopt;
    }
    const Result<UncertainPoint> own = headCenterOf(state);
    if (!own) {
        why = state.head_center.size() < 2
                  ? tr("Choose Head centre and click the middle of the femur's own head in two registered views.")
                  : QString::fromStdString(own.error().message());
        return std::nullopt;
    }
    hip.head_reference = *own;
    hip.head_planned.point = plan.femur_from_implant * plan.implant->head_center;
    if (canal) {
        hip.axis = *canal;
    } else if (state.canal) {
        hip.axis.point = state.canal->proximal;
        hip.axis.direction = (state.canal->proximal - state.canal->distal).normalized();
        hip.axis.point_sigma_mm = hip.axis.direction_sigma_rad = 0;
    } else {
        why = tr("Needs the canal's axis: a CT, or two views with the canal's walls.");
        return std::nullopt;
    }
    return hip;
}

}  // namespace

Measure measureOf(const CaseState& state, const PlacedMeasure& placed) {
    const std::size_t needed = placed.kind == MeasureKind::length ? 2 : 4;
    if (placed.view >= state.views.size() || placed.points_px.size() != needed)
        return missing(tr("Its image is not there any more."));
    const CArm& carm = state.views[placed.view].carm;
    const std::vector<Vector2>& p = placed.points_px;
    if (placed.kind == MeasureKind::angle) return angleBetweenLines(carm, p[0], p[1], p[2], p[3], kClickSigmaPx);
    const auto view = registeredView(state, {placed.view});
    if (!view || !state.plan.mesh) return distanceInDetector(carm, p[0], p[1], kClickSigmaPx);
    const Vector3 middle = state.plan.femur_from_implant * gripOf(state.plan).middle();
    const Pose& pose = *state.views[placed.view].before.imager_from_femur;
    const double pose_variance = pose.covariance ? pointCovariance(pose, middle)(2, 2) : 0;
    return distanceAtDepth(carm, p[0], p[1], kClickSigmaPx, (view->imager_from_world * middle).z(),
                           std::hypot(kDepthSigmaMm, std::sqrt(std::max(0.0, pose_variance))));
}

Result<UncertainPoint> headCenterOf(const CaseState& state) {
    std::vector<View> views;
    std::vector<Vector2> pixels;
    for (const SeenPoint& seen : state.head_center) {
        if (const auto view = registeredView(state, {seen.view})) {
            views.push_back(*view);
            pixels.push_back(seen.at_px);
        }
    }
    if (views.size() < 2)
        return noSolution("head's centre", std::to_string(views.size()) + " of two registered views",
                          "its centre clicked in two", "choose Head centre and click it in two views");
    const Result<PointsInSpace> found = pointsInSpace(views, {pixels}, kClickSigmaPx);
    if (!found) return found.error();
    return UncertainPoint{found->points.front(), found->covariance.topLeftCorner<3, 3>()};
}

std::vector<NamedMeasure> measuresOf(const CaseState& state, const std::optional<LineFit>& canal) {
    std::vector<NamedMeasure> all;
    QString why;
    const auto hip = hipOf(state, canal, why);
    all.push_back({tr("Leg length"), hip ? legLengthChange(*hip) : missing(why), {}});
    // The same is missing for both: said once.
    all.push_back({tr("Offset"), hip ? offsetChange(*hip) : Measure{}, {}});
    int lengths = 0, angles = 0;
    for (std::size_t i = 0; i < state.measures.size(); ++i) {
        const PlacedMeasure& placed = state.measures[i];
        const QString name =
            placed.kind == MeasureKind::length ? tr("Length %1").arg(++lengths) : tr("Angle %1").arg(++angles);
        const QString view =
            placed.view < state.views.size() ? QString::fromStdString(state.views[placed.view].name) : QString();
        all.push_back({tr("%1, %2").arg(name, view), measureOf(state, placed), i});
    }
    return all;
}

QString textOf(const Measure& measure) {
    if (!std::isfinite(measure.value)) return QStringLiteral("\u2013");
    const bool angle = measure.unit == "rad";
    const double value = angle ? degreesFromRadians(measure.value) : measure.value;
    const double sigma = angle ? degreesFromRadians(measure.sigma) : measure.sigma;
    const QString unit = angle ? QStringLiteral("\u00b0") : QStringLiteral(" mm");
    if (!std::isfinite(sigma)) return QStringLiteral("%1%2").arg(value, 0, 'f', 1).arg(unit);
    return QStringLiteral("%1 \u00b1 %2%3").arg(value, 0, 'f', 1).arg(sigma, 0, 'f', 1).arg(unit);
}

}  // namespace fluorocut::ui
