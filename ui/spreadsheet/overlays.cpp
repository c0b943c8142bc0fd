#include "ui/spreadsheet/overlays.h"

#include <QCoreApplication>
#include <algorithm>

#include "core/imaging/projected_error.h"

namespace fluorocut::ui {
namespace {

constexpr std::size_t kMostMeshes = 16;

QString tr(const char* text) {
    return QCoreApplication::translate("fluorocut::ui::Overlays", text);
}

struct KindText {
    const char* name;
    const char* title;
    Ink ink;
};

// In the order of OverlayKind.
constexpr std::array<KindText, kOverlayKinds.size()> kTexts{{
    {"implant", QT_TRANSLATE_NOOP("fluorocut::ui::Overlays", "Implant"), Ink::implant},
    {"stages", QT_TRANSLATE_NOOP("fluorocut::ui::Overlays", "Stages"), Ink::stage},
    {"axis", QT_TRANSLATE_NOOP("fluorocut::ui::Overlays", "Axes"), Ink::axis},
    {"beads", QT_TRANSLATE_NOOP("fluorocut::ui::Overlays", "Beads"), Ink::bead},
    {"corkscrew", QT_TRANSLATE_NOOP("fluorocut::ui::Overlays", "Corkscrew"), Ink::corkscrew},
    {"cavity", QT_TRANSLATE_NOOP("fluorocut::ui::Overlays", "Found cavity"), Ink::found},
    {"uncertainty", QT_TRANSLATE_NOOP("fluorocut::ui::Overlays", "95 % regions"), Ink::uncertainty},
}};

const KindText& textOf(OverlayKind kind) {
    return kTexts[static_cast<std::size_t>(kind)];
}

// The outline of the mesh's shadow. A mesh beside the source has none.
void addOutline(const std::shared_ptr<const TriangleMesh>& mesh, const CArm& carm, const Rigid3& imager_from_mesh,
                Ink ink, Silhouettes& silhouettes, Overlay& overlay) {
    const Silhouette* silhouette = mesh ? silhouettes.find(mesh) : nullptr;
    if (!silhouette) return;
    SilhouetteOptions options;
    options.find_outline = true;
    const auto loops = silhouette->project(carm, imager_from_mesh, options);
    if (!loops) return;
    for (const ContourLoop& loop : *loops) {
        for (const auto& part : contourParts(loop, [](const ContourPoint& p) { return p.outline; })) {
            OverlayCurve curve;
            curve.ink = ink;
            curve.points_px.reserve(part.size());
            for (const ContourPoint& point : part)
                curve.points_px.push_back(point.pixel);
            overlay.curves.push_back(std::move(curve));
        }
    }
}

// A line in space; straight in the picture only where there is no distortion.
void addLine(const Vector3& from, const Vector3& to, const CArm& carm, const Rigid3& imager_from_line, Ink ink,
             Overlay& overlay) {
    const int pieces = carm.distortion ? 32 : 1;
    OverlayCurve curve;
    curve.ink = ink;
    for (int i = 0; i <= pieces; ++i)
        curve.points_px.push_back(
            carm.project(imager_from_line * Vector3(from + (to - from) * (static_cast<double>(i) / pieces))));
    overlay.curves.push_back(std::move(curve));
}

Matrix6 covarianceOf(const Pose& pose) {
    return pose.covariance.value_or(Matrix6::Zero());
}

void addEllipse(const Pose& femur_from_cavity, const Vector3& point_in_cavity, const Picture& picture,
                Overlay& overlay) {
    const Pose& view = *picture.imager_from_femur;
    const Vector3 point = femur_from_cavity.target_from_source * point_in_cavity;
    const Matrix3 of_point =
        femur_from_cavity.covariance ? Matrix3(pointCovariance(femur_from_cavity, point_in_cavity)) : Matrix3::Zero();
    const Matrix2 covariance =
        pixelCovariance(picture.carm, view.target_from_source, point, of_point, covarianceOf(view));
    if (!(covariance.trace() > 0)) return;  // nothing is known of it
    const Vector2 middle = picture.carm.project(view.target_from_source * point);
    const std::vector<Vector2> ellipse = errorEllipse(middle, covariance);
    if (!ellipse.empty()) overlay.curves.push_back({Ink::uncertainty, ellipse, true, false});
}

void addUncertainty(const CaseState& state, const Picture& picture, Overlay& overlay) {
    const ImplantPlan& plan = state.plan;
    if (plan.mesh || !plan.cavities.empty()) {
        const auto cut = static_cast<std::size_t>(std::max(0, picture.cut));
        const bool was_found = cut > 0 && cut <= state.found_cavities.size();
        Pose where{Frame::femur, Frame::cavity, plan.femur_from_implant, std::nullopt};
        if (was_found) where = state.found_cavities[cut - 1];
        const Eigen::AlignedBox3d bounds = boundsOf(plan.mesh ? plan.mesh : plan.cavities.back());
        if (!bounds.isEmpty()) addEllipse(where, {0, 0, bounds.min().z()}, picture, overlay);  // the tip
        addEllipse(where, Vector3::Zero(), picture, overlay);
    }
    for (const Vector3& bead : state.beads)
        addEllipse({Frame::femur, Frame::femur, {}, std::nullopt}, bead, picture, overlay);
}

void addCavity(const CaseState& state, const Picture& picture, Silhouettes& silhouettes, Overlay& overlay) {
    const auto cut = static_cast<std::size_t>(std::max(0, picture.cut));
    if (cut < 1 || cut > state.plan.cavities.size()) return;
    const Rigid3& imager_from_femur = picture.imager_from_femur->target_from_source;
    const std::shared_ptr<const TriangleMesh>& mesh = state.plan.cavities[cut - 1];
    addOutline(mesh, picture.carm, imager_from_femur * state.plan.femur_from_implant, Ink::predicted, silhouettes,
               overlay);
    if (cut <= state.found_cavities.size())
        addOutline(mesh, picture.carm, imager_from_femur * state.found_cavities[cut - 1].target_from_source, Ink::found,
                   silhouettes, overlay);
}

void addCorkscrew(const CaseState& state, const Picture& picture, Overlay& overlay) {
    if (!picture.imager_from_corkscrew) return;
    for (const std::vector<Vector3>& line : state.corkscrew) {
        OverlayCurve curve;
        curve.ink = Ink::corkscrew;
        for (const Vector3& point : line)
            curve.points_px.push_back(picture.carm.project(picture.imager_from_corkscrew->target_from_source * point));
        overlay.curves.push_back(std::move(curve));
    }
}

}  // namespace

const char* name(OverlayKind kind) {
    return textOf(kind).name;
}

QString titleOf(OverlayKind kind) {
    return tr(textOf(kind).title);
}

Ink inkOf(OverlayKind kind) {
    return textOf(kind).ink;
}

Silhouettes::Silhouettes(QObject* parent) : QObject(parent) {
    // A fault of ours: the mesh goes without, and the others follow.
    connect(&jobs_, &JobRunner::crashed, this, [this](const QString& what) {
        for (Known& known : known_) {
            if (known.silhouette) continue;
            known.silhouette.emplace(noSolution("silhouette", what.toStdString(), "none"));
            break;
        }
        startNext();
    });
}

const Silhouette* Silhouettes::find(const std::shared_ptr<const TriangleMesh>& mesh) {
    if (!mesh) return nullptr;
    const auto found =
        std::find_if(known_.begin(), known_.end(), [&](const Known& known) { return known.mesh == mesh; });
    if (found != known_.end()) {
        known_.splice(known_.begin(), known_, found);
        const auto& silhouette = known_.front().silhouette;
        return silhouette && *silhouette ? &**silhouette : nullptr;
    }
    known_.push_front({mesh, std::nullopt});
    if (known_.size() > kMostMeshes) known_.pop_back();
    startNext();
    return nullptr;
}

void Silhouettes::startNext() {
    if (jobs_.isBusy()) return;
    const auto next = std::find_if(known_.begin(), known_.end(), [](const Known& known) { return !known.silhouette; });
    if (next == known_.end()) return;
    jobs_.run<Silhouette>([mesh = next->mesh](Progress&) { return Silhouette::prepare(*mesh); },
                          [this, mesh = next->mesh](Result<Silhouette> made) {
                              for (Known& known : known_)
                                  if (known.mesh == mesh) known.silhouette.emplace(std::move(made));
                              startNext();
                              emit prepared();
                          });
}

Eigen::AlignedBox3d boundsOf(const std::shared_ptr<const TriangleMesh>& mesh) {
    static thread_local std::weak_ptr<const TriangleMesh> latest;
    static thread_local Eigen::AlignedBox3d bounds;
    if (mesh && latest.lock() == mesh) return bounds;
    latest = mesh;
    bounds.setEmpty();
    for (const Vector3& vertex : mesh->vertices)
        bounds.extend(vertex);
    return bounds;
}

Overlay overlayOf(OverlayKind kind, const CaseState& state, const Picture& picture, Silhouettes& silhouettes) {
    Overlay overlay;
    if (kind == OverlayKind::corkscrew) {
        addCorkscrew(state, picture, overlay);
        return overlay;
    }
    if (!picture.imager_from_femur) return overlay;
    const ImplantPlan& plan = state.plan;
    const Rigid3& imager_from_femur = picture.imager_from_femur->target_from_source;
    const Rigid3 imager_from_implant = imager_from_femur * plan.femur_from_implant;
    switch (kind) {
        case OverlayKind::implant:
            addOutline(plan.mesh, picture.carm, imager_from_implant, Ink::implant, silhouettes, overlay);
            // The head, where it is known; it lives as long as the implant that it is a part of.
            for (std::size_t p = 1; plan.implant && p < plan.implant->parts.size(); ++p)
                addOutline({plan.implant, &plan.implant->parts[p].mesh}, picture.carm, imager_from_implant,
                           Ink::implant, silhouettes, overlay);
            break;
        case OverlayKind::stages:
            for (const auto& cavity : plan.cavities)
                addOutline(cavity, picture.carm, imager_from_implant, Ink::stage, silhouettes, overlay);
            break;
        case OverlayKind::axis:
            if (state.canal)
                addLine(state.canal->distal, state.canal->proximal, picture.carm, imager_from_femur, Ink::axis,
                        overlay);
            if (plan.mesh && !plan.mesh->vertices.empty()) {
                const Eigen::AlignedBox3d bounds = boundsOf(plan.mesh);
                addLine({0, 0, bounds.min().z()}, {0, 0, bounds.max().z()}, picture.carm, imager_from_implant,
                        Ink::implant, overlay);
            }
            break;
        case OverlayKind::beads:
            for (const Vector3& bead : state.beads)
                overlay.marks.push_back({Ink::bead, picture.carm.project(imager_from_femur * bead), MarkShape::ring});
            break;
        case OverlayKind::cavity:
            addCavity(state, picture, silhouettes, overlay);
            break;
        case OverlayKind::uncertainty:
            addUncertainty(state, picture, overlay);
            break;
        case OverlayKind::corkscrew:
            break;
    }
    return overlay;
}

}  // namespace fluorocut::ui
