// What a procedure is begun with: the patient, the plan, what calibration has found, and the equipment it works with.
// It holds no truth: whoever builds it from a simulation may put in only what surgeon and technician would know.
//
// Frames as in core/geometry/frames.h; mm, rad.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/cutting/tool_path.h"
#include "core/fiducial/bead_layout.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/geometry/pose.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"
#include "core/imaging/carm.h"
#include "core/imaging/carm_position.h"
#include "core/imaging/image_source.h"
#include "core/planning/cavity.h"
#include "core/robot/supervisor.h"

namespace fluorocut {

// One of the directions that pictures are taken from, before the first cut and after every cut.
struct ProcedureView {
    std::string name;  // "ap"
    CArmPosition position;
    CArm carm;  // as calibrated there: focal length, image centre, distortion map
};

struct ProcedurePatient {
    std::string name, side;            // as they are confirmed in the time-out: "left", "right"
    std::shared_ptr<const Volume> ct;  // Hounsfield units, before any cut; null: none was made
    double mu_water_per_mm = 0.02;     // that they stand for
    BeadLayout beads;                  // in the bone, frame `femur`
};

struct ProcedurePlan {
    std::string implant;  // its name
    // Its stem, or any solid to be milled; frame `cavity`. Its top (CavityOptions::top_mm) lies a voxel or more above
    // the bone that is there: a CT can not tell what of a voxel with both bone's end and cavity's end in it is cut.
    TriangleMesh mesh;
    Rigid3 femur_from_cavity;
    CavityOptions cavity;
    ToolPathOptions path;
    int stages = 3;
    // Of each stage, falling to 0; empty: worked out from the registration's uncertainty (containedInset, stageInsets).
    std::vector<double> insets_mm;
};

// Errors of calibration are given as standard deviations or with the pose.
struct ProcedureCalibration {
    CorkscrewLayout corkscrew;
    Pose flange_from_corkscrew;  // with covariance
    Rigid3 flange_from_cutter;
    double focal_length_sigma_mm = 0.3;  // common to all views
    double image_centre_sigma_px = 1;
    double bead_sigma_mm = 0.05;        // where each bead lies in the femur, per axis
    double corkscrew_sigma_mm = 0.02;   // each of its dimensions
    double local_distortion_mm = 0.01;  // that maps leave, rms, in the detector's plane
    // Of the robot: where the cutter goes against where it was sent, root mean square of the error's length. The part
    // of it that repeats is corrected along with the registration; it is counted as if it did not.
    double robot_sigma_mm = 0.02;
    double robot_sigma_rad = 1.75e-4;  // 0.01 degrees
    // What all locations of the cavity have in common, beyond their covariances: errors of the CT, of the views'
    // calibration. Per axis. More measurements do not make it less.
    double location_sigma_mm = 0.02;
    double location_sigma_rad = 3.5e-4;
    // Of each location for itself, about the cavity's own axis, of which round cavities show least.
    double location_sigma_roll_rad = 3.5e-4;
    std::string calibrated_utc;  // when (core/base/utc.h)
};

// By which the procedure doubts.
struct ProcedureLimits {
    double contained_probability = 0.99;  // that a stage stays inside the final cavity, where insets are worked out
    double envelope_delta_mm = 0.75;      // by which the final cavity may lie beside its place
    double least_probability = 1e-3;      // of an offset as large or larger, by what the covariances say
    double most_view_turn_rad = 0.26;     // of a view, from where its C-arm's scales say that it looks
    // Names the field, the value and the limit.
    Result<void> validate() const;
};

struct ProcedureSetup {
    ProcedurePatient patient;
    ProcedurePlan plan;
    ProcedureCalibration calibration;
    std::vector<ProcedureView> views;
    ProcedureLimits limits;

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

// Insets of stages, that fall to 0; the sentence names the place.
Result<void> checkInsets(const char* field, const std::vector<double>& insets_mm);

// What acts and sees. Both outlive the procedure.
struct ProcedureEquipment {
    ImageSource* images = nullptr;
    Supervisor* robot = nullptr;
};

}  // namespace fluorocut
