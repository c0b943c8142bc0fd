// A procedure in a simulated operation, from a scenario to figures: run to its end by the limits alone (or gone on with
// from its case), each cut held against the truth. The procedure itself sees setup, pictures and robot; the truth is
// looked up afterwards.
//
// In the case, beside what the procedure writes: the scenario, as its first item ("scenario.json"), so that the same
// world can be made again.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/experiments/scenario.h"
#include "core/procedure/by_limits.h"
#include "core/procedure/surface_error.h"

namespace fluorocut {

struct StageFigures {
    int stage = 0;
    double inset_mm = std::numeric_limits<double>::quiet_NaN();
    CavityOffset truth;  // of what was cut, from the plan
    // Announced before the cut: with 95 % no place of the wall lies farther from its place.
    double bound_mm = std::numeric_limits<double>::quiet_NaN();
    bool held = false;
    double robot_rms_mm = std::numeric_limits<double>::quiet_NaN();  // what the cutter did besides a rigid motion
    // From the pictures after the cut; NaN: not located yet.
    CavityOffset estimate;
    double estimate_bound_mm = std::numeric_limits<double>::quiet_NaN();  // 95 %, of the estimate's own error
    CavityOffset estimate_error;                                          // against the truth
    // The same of the cavity's middle, and how it is turned, along the cavity's axes: mm, rad.
    Vector6 estimate_error_in_cavity = Vector6::Constant(std::numeric_limits<double>::quiet_NaN());
    double time_s = std::numeric_limits<double>::quiet_NaN(), greatest_force_n = time_s;
};

struct ProcedureRun {
    std::string case_id;
    bool resumed = false;
    bool finished = false;
    std::string stopped;  // why it stopped to ask; empty when it is finished
    double registered95_mm = std::numeric_limits<double>::quiet_NaN();  // at the cavity, before the first cut
    CavityOffset registered;  // where a cut by the first registration would lie, truly
    std::string implant;
    std::vector<std::string> remarks;
    std::vector<StageFigures> stages;  // that were cut
    double prepare_ms = 0, run_ms = 0;

    const StageFigures* last() const { return stages.empty() ? nullptr : &stages.back(); }
};

// Hears of outcomes as they come, and of a stage's figures when it has been cut and located.
struct RunListener {
    OutcomeListener outcome;
    std::function<void(const StageFigures&)> stage;
};

// `case_file`: a new case, or one of the same scenario to go on with. invalidInput: a case of another one. noSolution
// when a step cannot be done. A procedure that stopped to ask is a result.
Result<ProcedureRun> runProcedure(const Scenario& scenario, const std::filesystem::path& case_file,
                                  Progress& progress = Progress::none(), const RunListener& listener = {});

// What came of a case so far, without going on with it: the case is read, the world is made again. Nothing: it is not
// of a simulation.
Result<std::optional<ProcedureRun>> lookAtProcedure(const std::filesystem::path& case_file,
                                                    Progress& progress = Progress::none());

}  // namespace fluorocut
