// The procedure: from the first images to the final cavity, as a machine of steps over a case.
//
//     images 0       pictures of corkscrew and beads from every view, before any cut
//     register       robot_from_femur from them: corkscrew, beads, the chain (core/registration/chain.h)
//     plan           the cavities of all stages and the tool path of the next, by what the registration's uncertainty
//                    leaves room for
//     then for each stage k = 1 ... n
//       time-out k   patient, side, implant, stage, age of the calibration: confirmed by a person
//       cut k        the checked path, through the supervisor
//       images k     the same views again
//       locate k     where the cavity really is (core/cavity/cavity_location.h)
//       correct k    registration and covariance from all that was measured so far; the next stage's cavity and path
//
// Each step reads accepted results from the case, works, and writes its own result into it; then it waits until it is
// accepted or refused. Who judges is not the procedure's business: `demo` accepts by the limits, the desktop asks
// people. A step that is refused is done again; what rests on it and had been accepted is stale. Nothing is kept
// outside the case: a procedure that is killed goes on from its file with the step it was at.
//
// The loop stops and asks (Outcome::doubts) when the error grows from one cut to the next, when the error's bound does
// not fit the next cavity, and when a view contradicts the others.
//
// Steps that only calculate (register, plan, locate, correct) are pure: the same content gives the same result, bit for
// bit, so that a case can be recomputed (recompute.h). What the results hold: step_results.h.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/acceptance.h"
#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/casestore/case_store.h"
#include "core/procedure/setup.h"

namespace fluorocut {

enum class StepKind { images, registration, plan, timeOut, cut, locate, correct };

struct ProcedureStep {
    StepKind kind = StepKind::images;
    int stage = 0;  // 0: before the first cut

    std::string name() const;  // "cut 1", as in the case
    friend bool operator==(const ProcedureStep&, const ProcedureStep&) = default;
};

enum class StepState { waiting, ready, done, accepted, refused, stale };

struct StepStanding {
    ProcedureStep step;
    StepState state = StepState::waiting;
    std::int64_t record = 0;  // of the newest Step in the case; 0: none
    std::string why;          // of stale and refused, in words
};

struct Outcome {
    ProcedureStep step;
    std::int64_t record = 0;
    std::string summary;  // one sentence, for a surgeon
    std::vector<std::string> warnings;
    std::vector<std::string> doubts;  // why somebody should look before this is accepted
    Acceptance acceptance;
};

class Procedure {
  public:
    // Writes the setup into a new case.
    static Result<Procedure> begin(CaseStore store, const ProcedureSetup& setup, ProcedureEquipment equipment);
    // Of a case in which one was begun. Without equipment only what calculates can be run.
    static Result<Procedure> resume(CaseStore store, ProcedureEquipment equipment);

    const ProcedureSetup& setup() const;
    const CaseStore& store() const;
    std::vector<StepStanding> steps() const;
    // The first that is not accepted; nothing: the procedure is done.
    std::optional<ProcedureStep> next() const;
    // The outcome that waits for a judgement: next() has been done, maybe before this program was started.
    Result<std::optional<Outcome>> pending() const;

    // Does next() and writes it into the case. invalidOption: it has been done and waits for a judgement. noSolution:
    // it could not be done; no step is written (of a cut that was interrupted, its trace is).
    Result<Outcome> run(Progress& progress = Progress::none());
    // Judges the outcome that waits. For a time-out, accepting confirms every item that it shows.
    Result<void> decide(bool accept, const std::string& who, const std::string& why);
    // An accepted step is no longer believed (images that turn out blurred): it is done again, and what rests on it.
    Result<void> withdraw(const ProcedureStep& step, const std::string& who, const std::string& why);

    Procedure(Procedure&&) noexcept;
    Procedure& operator=(Procedure&&) noexcept;
    ~Procedure();

  private:
    struct Inside;
    explicit Procedure(std::unique_ptr<Inside> inside);
    std::unique_ptr<Inside> inside_;
};

}  // namespace fluorocut
