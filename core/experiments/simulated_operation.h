// A simulated operation: a scenario come to life. It gives what a procedure is begun with (setup: only what surgeon and
// technician know) and what it works with (equipment: a C-arm, a robot behind its supervisor), lets the cutter remove
// bone where it truly goes, and afterwards tells how it truly went.
//
//   pictures   The room shows the patient as the cuts have left it, the beads in the bone, and the corkscrew on the
//              robot where it truly stands; not the corkscrew when it would hide the cavity: then it has been taken
//              off.
//   cutting    Every cycle of the robot moves the true cutter through the true bone (core/simulation/milled_bone.h).
//   going on   The world is a function of the scenario and of the motions that were executed: after a kill it is made
//              again and the cuts that the case has are replayed. Pictures after the k-th cut do not depend on how many
//              were taken before it.
//
// The truth: where the cutter truly went in the femur when it was sent somewhere in the robot's frame. With p the
// places that the robot believed and q those where the ball truly was in the femur,
//
//     femur_from_robot = argmin sum |T p - q|^2,    femur_from_cut_cavity = femur_from_robot * robot_from_cavity
//
// where robot_from_cavity is what the cut was sent by.
#pragma once

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "core/experiments/operation_calibration.h"
#include "core/experiments/planned_operation.h"
#include "core/procedure/setup.h"
#include "core/simulation/truth.h"

namespace fluorocut {

struct CutTruth {
    Rigid3 femur_from_cavity;
    double rms_mm = std::numeric_limits<double>::quiet_NaN();  // of the fit: what the robot did not repeat
};

// The rigid motion with q ~ T p (Kabsch, Umeyama). At least three points not on a line; else std::logic_error.
Rigid3 bestRigid(const std::vector<Vector3>& p, const std::vector<Vector3>& q);

class SimulatedOperation {
  public:
    static Result<SimulatedOperation> create(const Scenario& scenario, Progress& progress = Progress::none());

    const Scenario& scenario() const;
    const PlannedOperation& plan() const;

    // Calibrates, as a technician would: some seconds of pictures.
    Result<ProcedureSetup> calibrate(Progress& progress = Progress::none()) const;
    ProcedureEquipment equipment();

    // A motion that was executed before a kill, again.
    Result<void> replay(const std::string& stage, const std::vector<MotionStep>& steps);

    // As the robot's encoders have it.
    Rigid3 robotFromCutter() const;

    // ---- the truth, for reports of error and nothing else

    // Of the newest cut of that stage. noSolution: none was made. `robot_from_cavity`: what it was sent by.
    Result<CutTruth> truthOfCut(const std::string& stage, const Rigid3& robot_from_cavity) const;
    // The patient as it is now, and what is gone of each voxel.
    std::shared_ptr<const Volume> patientNow() const;
    Volume removedFraction() const;
    Rigid3 femurFromRobot() const;
    // Of the picture that was taken last. None: std::logic_error.
    const ViewTruth& newestView() const;

    SimulatedOperation(SimulatedOperation&&) noexcept;
    SimulatedOperation& operator=(SimulatedOperation&&) noexcept;
    ~SimulatedOperation();

  private:
    struct World;
    explicit SimulatedOperation(std::unique_ptr<World> world);
    std::unique_ptr<World> world_;
};

}  // namespace fluorocut
