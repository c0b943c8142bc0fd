// The work of the steps, without the machine that runs them. Those that only calculate are functions of the setup and
// of content of the case, by role: the same content gives the same bytes. Used by this folder only.
#pragma once

#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/procedure/content.h"
#include "core/procedure/cutting_motion.h"
#include "core/procedure/procedure.h"
#include "core/procedure/setup_items.h"
#include "core/procedure/step_results.h"

namespace fluorocut {

// What a step reads: roles and hashes, as its record in the case has them, and what lies under the hashes.
//
//   setup                     everywhere
//   images k, image VIEW      the result of `images k` and the pictures it names
//   register, plan, correct k, time-out k, cut k, locate k
//   mesh k, path k            of a stage of the plan
class StepInputs {
  public:
    StepInputs(std::vector<StepInput> inputs, ContentReader content)
        : inputs_(std::move(inputs)), content_(std::move(content)) {}

    const std::vector<StepInput>& list() const { return inputs_; }
    // Empty: there is none of that role.
    std::string hash(const std::string& role) const;
    Result<std::string> bytes(const std::string& role) const;

    // A step's result.
    template <class T>
    Result<T> result(const std::string& role, Result<T> (*parse)(std::string_view, const std::string&)) const {
        const Result<std::string> text = bytes(role);
        if (!text) return text.error();
        return parse(*text, role);
    }

  private:
    std::vector<StepInput> inputs_;
    ContentReader content_;
};

struct StepOutput {
    std::string json;
    std::vector<CaseContentItem> products;
};

Result<StepOutput> registerStep(const ProcedureSetup& setup, const StepInputs& inputs, Progress& progress);
Result<StepOutput> planStep(const ProcedureSetup& setup, const StepInputs& inputs, Progress& progress);
Result<StepOutput> locateStep(const ProcedureSetup& setup, int stage, const StepInputs& inputs, Progress& progress);
Result<StepOutput> correctStep(const ProcedureSetup& setup, int stage, const StepInputs& inputs, Progress& progress);
// One of the above.
Result<StepOutput> calculate(const ProcedureStep& step, const ProcedureSetup& setup, const StepInputs& inputs,
                             Progress& progress);

// Those that see and act.
Result<StepOutput> imagesStep(const ProcedureSetup& setup, int stage, const std::vector<std::string>& known_hashes,
                              const ProcedureEquipment& equipment, Progress& progress);
Result<StepOutput> timeOutStep(const ProcedureSetup& setup, int stage, const std::string& now_utc);

struct CutOrder {
    int stage = 0;
    RegistrationStanding registration;  // its error bound is worked out here
    Pose robot_from_femur;
    TimeOut time_out;
};
// `interrupted`: what is known of a cut that was begun and did not come to its end.
Result<StepOutput> cutStep(const ProcedureSetup& setup, CutOrder order, const StepInputs& inputs, Supervisor& robot,
                           std::optional<CaseContentItem>& interrupted, Progress& progress);

// "stage 2 of 3": as the time-out and the robot's path have it.
std::string stageName(const ProcedureSetup& setup, int stage);

// Where a cavity will be cut by this registration, with the registration's error and the robot's.
Pose announcedPlace(const ProcedureSetup& setup, const Pose& robot_from_femur);
// Of the robot, and of a bone that moved by so much in the cut: robot from cavity.
Matrix6 processCovariance(const ProcedureSetup& setup, double bone_rms_mm = 0, double bone_rms_rad = 0);
// Why a stage should not be cut with this bound; empty: it may.
std::string boundAgainstRoom(const ProcedureSetup& setup, int stage, double inset_mm, double bound_mm);

// The femur's beads in the images of a stage. noSolution: not in every view.
struct StageImages {
    ImagesResult result;
    std::vector<Image> images;  // in the order of the setup's views
};
Result<StageImages> readImages(const ProcedureSetup& setup, int stage, const StepInputs& inputs);
Result<TriangleMesh> readStageMesh(int stage, const StepInputs& inputs);
Result<ToolPath> readStagePath(int stage, const StepInputs& inputs);

}  // namespace fluorocut
