// What the planning tools and panels change in a case: from one CaseState to the next, each the smallest edit. Whether
// it may be changed at all is said here, once, in words.
#pragma once

#include <QString>
#include <optional>

#include "core/imaging/rays.h"
#include "core/planning/hand.h"
#include "core/planning/stem_numbers.h"
#include "ui/session/session.h"

namespace fluorocut::ui {

// One image of the case: a view before the cuts, or after one of them (from 0).
struct ImagePlace {
    std::size_t view = 0;
    std::optional<std::size_t> after = {};
};
// Null: there is no such image.
const TakenImage* takenImage(const CaseState& state, const ImagePlace& place);

// The C-arm and pose that an image was taken with; nothing: it is not registered (or not there).
std::optional<View> registeredView(const CaseState& state, const ImagePlace& place);

// Why the plan may not be changed, or not by hand in this image, as a sentence; empty: it may.
QString whyFixed(const CaseState& state);
QString whyNotMovable(const CaseState& state, const ImagePlace& place);

// Where the stem is held; of a plan with a mesh.
StemGrip gripOf(const ImplantPlan& plan);
double resectionOf(const ImplantPlan& plan);

// Against what the pose is told in numbers: the canal's axis and the head's side, where the case knows them, otherwise
// the patient's own axes about the femur's origin; `of` says which.
struct SeatKnown {
    StemSeat seat;
    QString of;
};
SeatKnown seatOf(const CaseState& state);

CaseState withPose(CaseState state, const Rigid3& femur_from_implant);
// Cavities belong to the implant's shape: they are dropped.
CaseState withImplant(CaseState state, Implant implant, const Rigid3& femur_from_implant);
// The family's other size, loaded here (12 ms); its place by `kept`.
Result<CaseState> withSize(const CaseState& state, const std::string& size, KeptPoint kept);
Result<CaseState> withNextSize(const CaseState& state, int steps, KeptPoint kept);

// Of the case, for implants that differ by side.
Side sideOf(const CaseState& state);

}  // namespace fluorocut::ui
