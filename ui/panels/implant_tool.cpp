#include "ui/panels/implant_tool.h"

#include <cmath>

#include "core/base/units.h"
#include "ui/spreadsheet/image_view.h"

namespace fluorocut::ui {
namespace {

constexpr double kBeyondTipMm = 16, kBesideMm = 26;         // where the dots stand
constexpr double kRollLeverMm = 180 / 3.14159265358979324;  // 1 mm of hand: 1 degree

}  // namespace

// The handles' places in the image, and the stem's directions in the image plane.
struct ImplantTool::Handles {
    View view;
    StemGrip grip;
    Vector2 tip, shoulder, tilt, roll, middle;
    Vector2 along, across;  // unit, imager: toward the tip; as the near side moves when the stem turns positively
    double depth_mm = 0;    // of the shoulder
};

ImplantTool::ImplantTool(Session& session, const ImagePlace& place, QObject* parent)
    : QObject(parent), session_(session), place_(place) {}

std::optional<ImplantTool::Handles> ImplantTool::handles(const CaseState& state) const {
    const auto view = registeredView(state, place_);
    if (!view || !state.plan.mesh) return std::nullopt;
    const StemGrip grip = gripOf(state.plan);
    const Rigid3 imager_from_implant = view->imager_from_world * state.plan.femur_from_implant;
    const Vector3 axis = imager_from_implant.rotate(Vector3::UnitZ());
    Vector2 along = -axis.head<2>();
    along = along.norm() > 1e-6 ? along.normalized() : Vector2(Vector2::UnitY());
    const Vector2 across(along.y(), -along.x());  // imager z cross the stem's axis
    const auto seen = [&](const Vector3& p) { return view->carm.project(p); };
    const Vector3 tip = imager_from_implant * grip.tip, shoulder = imager_from_implant * grip.shoulder;
    const Vector3 middle = imager_from_implant * grip.middle();
    Handles all{*view, grip, seen(tip), seen(shoulder), {}, {}, seen(middle), along, across, shoulder.z()};
    all.tilt = seen(tip + kBeyondTipMm * Vector3(along.x(), along.y(), 0));
    all.roll = seen(middle + kBesideMm * Vector3(across.x(), across.y(), 0));
    return all;
}

ImplantTool::Part ImplantTool::partAt(const CaseState& state, const Touch& touch, Vector3* place) const {
    const auto all = handles(state);
    if (!all) return Part::none;
    for (const auto& [part, at] : {std::pair(Part::tip, all->tip), std::pair(Part::shoulder, all->shoulder),
                                   std::pair(Part::tilt, all->tilt), std::pair(Part::roll, all->roll)})
        if ((at - touch.at_px).norm() <= touch.reach_px) return part;
    const auto under = underPixel(all->view, *state.plan.mesh, state.plan.femur_from_implant, touch.at_px);
    if (!under) return Part::none;
    if (place) *place = *under;
    return Part::body;
}

QString ImplantTool::refusalToTake(const CaseState& state, const Touch& touch) const {
    return partAt(state, touch, nullptr) == Part::none ? QString() : whyNotMovable(state, place_);
}

bool ImplantTool::press(ImageView& view, const Touch& touch) {
    refusal_.clear();
    held_.reset();
    const Session::State start = session_.committed();
    Held held{Part::none, start, Vector3::Zero(), touch.at_px};
    held.part = partAt(*start, touch, &held.place);
    if (held.part == Part::none) return false;
    if (const QString why = refusalToTake(*start, touch); !why.isEmpty()) {
        refuse(why, touch.at_px);
        return true;  // the hand meant the implant, not the window
    }
    held_ = held;
    view.setCursor(Qt::ClosedHandCursor);
    return true;
}

std::optional<Rigid3> ImplantTool::moved(const Held& held, const Vector2& to_px) const {
    const auto all = handles(*held.start);
    if (!all) return std::nullopt;
    const Rigid3& pose = held.start->plan.femur_from_implant;
    if (to_px == held.from_px) return pose;  // back again: exactly
    const View& view = all->view;
    const StemGrip& grip = all->grip;
    // The hand's way at the implant's depth, mm.
    const Vector2 way = (view.carm.detectorPoint(to_px) - view.carm.detectorPoint(held.from_px)).head<2>() *
                        (all->depth_mm / view.carm.focal_length_mm);
    const auto turnAbout = [&](const Vector3& pivot, const Vector3& handle) -> std::optional<Rigid3> {
        const auto from = turnToward(view, pose, pivot, handle, held.from_px);
        const auto to = turnToward(view, pose, pivot, handle, to_px);
        if (!from || !to) return std::nullopt;
        return turned(view, pose, pivot, *to - *from);
    };
    if (!way.allFinite()) return std::nullopt;
    switch (held.part) {
        case Part::body:
            return dragged(view, pose, held.place, to_px);
        case Part::tip:
            return turnAbout(grip.shoulder, grip.tip);
        case Part::shoulder:
            return turnAbout(grip.tip, grip.shoulder);
        case Part::tilt:
            return tilted(view, pose, grip.shoulder, -way.dot(all->along) / std::max(1.0, grip.length()));
        case Part::roll:
            return rolled(pose, grip.shoulder, way.dot(all->across) / kRollLeverMm);
        case Part::none:
            break;
    }
    return std::nullopt;
}

void ImplantTool::drag(ImageView&, const Touch& touch) {
    if (!held_) return;
    if (session_.committed() != held_->start) {  // somebody else has changed the case under the hand
        held_.reset();
        session_.dropPreview();
        return;
    }
    if (const auto pose = moved(*held_, touch.at_px)) session_.preview(withPose(*held_->start, *pose));
}

void ImplantTool::release(ImageView&, const Touch&) {
    refusal_.clear();
    if (!held_) return;
    const Part part = held_->part;
    held_.reset();
    if (!session_.isPreviewing()) return;
    const Rigid3 pose = session_.state()->plan.femur_from_implant;
    const Rigid3& before = session_.committed()->plan.femur_from_implant;
    if ((pose.matrix() - before.matrix()).norm() == 0) {
        session_.dropPreview();
        return;
    }
    commit(part == Part::body   ? tr("Move implant")
           : part == Part::tilt ? tr("Tilt implant")
                                : tr("Turn implant"),
           pose);
}

Qt::CursorShape ImplantTool::hover(ImageView&, const Touch& touch) {
    const CaseState& state = *session_.state();
    refusal_.clear();
    near_ = partAt(state, touch, nullptr);
    if (near_ == Part::none) return Qt::CrossCursor;
    if (!whyFixed(state).isEmpty()) return Qt::ForbiddenCursor;
    return near_ == Part::body ? Qt::SizeAllCursor : Qt::PointingHandCursor;
}

void ImplantTool::commit(const QString& what, const Rigid3& pose) {
    session_.commit(what, withPose(*session_.committed(), pose));
}

void ImplantTool::refuse(const QString& sentence, const std::optional<Vector2>& at_px) {
    if (at_px) {
        refusal_ = sentence;
        refused_at_ = *at_px;
    }
    emit refused(sentence);
}

// The keys that move; false: another one.
bool ImplantTool::nudge(bool mirrored, int key, Qt::KeyboardModifiers modifiers) {
    const bool large = modifiers & Qt::ShiftModifier, control = modifiers & Qt::ControlModifier;
    const double mm = large ? 1 : 0.1, angle = radiansFromDegrees(large ? 1 : 0.1);
    const double x = mirrored ? -1 : 1;  // to the right on the screen
    Vector2 way = Vector2::Zero();
    double turn = 0;
    switch (key) {
        case Qt::Key_Left:
            way.x() = -x;
            break;
        case Qt::Key_Right:
            way.x() = x;
            break;
        case Qt::Key_Up:
            way.y() = -1;
            break;
        case Qt::Key_Down:
            way.y() = 1;
            break;
        case Qt::Key_BracketRight:
        case Qt::Key_BraceRight:
        case Qt::Key_Period:
        case Qt::Key_Greater:
            turn = x;
            break;
        case Qt::Key_BracketLeft:
        case Qt::Key_BraceLeft:
        case Qt::Key_Comma:
        case Qt::Key_Less:
            turn = -x;
            break;
        default:
            return false;
    }
    const CaseState& state = *session_.committed();
    if (const QString why = whyNotMovable(state, place_); !why.isEmpty()) {
        refuse(why);
        return true;
    }
    const View view = *registeredView(state, place_);
    const Rigid3& pose = state.plan.femur_from_implant;
    const Vector3 pivot = gripOf(state.plan).shoulder;
    if (turn != 0)
        commit(tr("Turn implant"), turned(view, pose, pivot, turn * angle));
    else if (control && way.y() != 0)
        commit(tr("Tilt implant"), tilted(view, pose, pivot, -way.y() * angle));
    else if (control)
        commit(tr("Turn implant about its axis"), rolled(pose, pivot, x * way.x() * angle));
    else
        commit(tr("Move implant"), shifted(view, pose, mm * way));
    return true;
}

bool ImplantTool::key(ImageView& view, int key, Qt::KeyboardModifiers modifiers) {
    if (key == Qt::Key_Escape) {
        if (!held_) return false;
        held_.reset();
        session_.dropPreview();
        return true;
    }
    if (held_) return false;  // one movement at a time
    if (nudge(view.isMirrored(), key, modifiers)) return true;
    const bool size = key == Qt::Key_PageUp || key == Qt::Key_PageDown;
    if (!size && !(key == Qt::Key_S && modifiers == Qt::NoModifier)) return false;
    const CaseState& state = *session_.committed();
    if (const QString why = whyFixed(state); !why.isEmpty()) {
        refuse(why);
    } else if (size) {
        Result<CaseState> next = withNextSize(state, key == Qt::Key_PageUp ? 1 : -1, kept_);
        if (next)
            session_.commit(key == Qt::Key_PageUp ? tr("Larger implant") : tr("Smaller implant"), std::move(*next));
        else
            refuse(QString::fromStdString(next.error().message()));
    } else if (!state.canal) {
        refuse(tr("The canal's axis is not known yet: there is nothing to snap to."));
    } else {
        commit(tr("Snap implant to the canal"), snappedTo({state.canal->distal, state.canal->proximal},
                                                          state.plan.femur_from_implant, gripOf(state.plan).shoulder));
    }
    return true;
}

Overlay ImplantTool::overlay(const ImageView& view) const {
    Overlay drawn;
    if (!refusal_.isEmpty()) drawn.marks.push_back({Ink::handle, refused_at_, MarkShape::cross, refusal_});
    const CaseState& state = *session_.state();
    if (!(held_ || view.underMouse() || view.hasFocus()) || !whyFixed(state).isEmpty()) return drawn;
    const auto all = handles(state);
    if (!all) return drawn;
    const Part active = held_ ? held_->part : near_;
    const auto mark = [&](Part part, const Vector2& at, MarkShape shape, const QString& name) {
        drawn.marks.push_back({Ink::handle, at, shape, part == active ? name : QString()});
    };
    drawn.curves.push_back({Ink::handle, {all->tip, all->tilt}, false, true});
    drawn.curves.push_back({Ink::handle, {all->middle, all->roll}, false, true});
    mark(Part::tip, all->tip, MarkShape::ring, tr("Turn"));
    mark(Part::shoulder, all->shoulder, MarkShape::ring, tr("Turn"));
    mark(Part::tilt, all->tilt, MarkShape::dot, tr("Tilt"));
    mark(Part::roll, all->roll, MarkShape::dot, tr("Version"));
    return drawn;
}

}  // namespace fluorocut::ui
