// What the procedure's steps find, as it lies in the case: one JSON text for each step, `fluorocut/step-<kind>/1`, all
// with
//
//     {"schema": "fluorocut/step-register/1", "step": "register", "summary": "...", "warnings": [...], "doubts": [...],
//      "acceptance": [{"what": "...", "value": 0.3, "least": null, "most": 0.5, "unit": "mm"}], ...}
//
// and fields of their own, named as the members below. Poses are {"target", "source", "matrix", "covariance"} as in
// fluorocut/pose/1; angles are in degrees, lengths in mm, numbers that nobody knows are null. Other content of the case
// (images, meshes, paths, traces) is named by its SHA-256. Steps that only calculate hold neither times nor anything
// else that differs from one run to the next: the same input gives the same bytes.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/acceptance.h"
#include "core/base/result.h"
#include "core/geometry/pose.h"
#include "core/imaging/carm_position.h"
#include "core/procedure/surface_error.h"

namespace fluorocut {

inline constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// What all have.
struct StepFindings {
    std::string summary;  // one sentence, for a surgeon
    std::vector<std::string> warnings;
    std::vector<std::string> doubts;  // why somebody should look before this is accepted
    Acceptance acceptance;
};

struct TakenImage {
    std::string view;
    std::string hash, file_name;   // of the item in the case
    CArmPosition position;         // as asked for
    std::string source, identity;  // as the image source names them
};

struct ImagesResult {
    StepFindings findings;
    int stage = 0;
    std::vector<TakenImage> images;
    Rigid3 robot_from_flange;  // while they were taken
    std::string taken_utc;     // the first
};

struct RegisteredView {
    std::string name;
    bool used = true;
    double residual_mm = kUnknown, residual_rad = kUnknown, probability = kUnknown;
    double turn_from_scales_rad = kUnknown;  // between where it looks and where the C-arm's scales say, by the others
    Pose imager_from_femur;                  // by the beads
};

struct BudgetShare {
    std::string term;
    double share = 0;  // of the variance
};

struct RegistrationResult {
    StepFindings findings;
    Pose robot_from_femur;
    std::vector<RegisteredView> views;
    double probability = kUnknown;  // of views that disagree as much or more
    double view_angle_rad = kUnknown;
    double radius95_mm = kUnknown;    // at the cavity's end that is known worse
    std::vector<BudgetShare> budget;  // there, the largest first
    std::string budget_sentence;
};

struct PlannedStage {
    double inset_mm = kUnknown;
    std::string mesh, path;  // hashes: the cavity (STL) and its tool path
    double volume_mm3 = kUnknown, depth_mm = kUnknown, top_mm = kUnknown;
    int layers = 0;
    double cutting_mm = kUnknown, cutting_time_s = kUnknown;
    double worst_by_mesh_mm = kUnknown, worst_by_voxels_mm = kUnknown;
};

struct PlanResult {
    StepFindings findings;
    std::vector<PlannedStage> stages;
    double asked_mm = kUnknown;  // least inset of the first stage, by the registration's covariance
    double bound_mm = kUnknown;  // 95 % bound of the first stage's worst place
    double unreachable_mm = kUnknown;
};

struct TimeOutResult {
    StepFindings findings;
    int stage = 0;
    // As the case has them, and as they are confirmed when this is accepted.
    std::string patient, side, implant, stage_name;
    std::string calibrated_utc;
    double calibration_age_s = kUnknown;  // when it was shown
};

struct CutStepResult {
    StepFindings findings;
    int stage = 0;
    std::string registration;  // hash of the result that it was cut by
    Pose robot_from_femur;     // of that registration
    Rigid3 robot_from_cavity;  // where it was sent
    double inset_mm = kUnknown, bound_mm = kUnknown;
    std::vector<std::string> checkers;
    double length_mm = kUnknown, time_s = kUnknown, greatest_force_n = kUnknown;
    double bone_rms_mm = kUnknown, bone_rms_rad = kUnknown, bone_most_mm = kUnknown;
    std::string trace;  // hash: where the cutter believed to have been, fluorocut/cut-trace/1
};

struct LocatedView {
    std::string name;
    double rms_log = kUnknown, pose_sigmas = kUnknown, evidence = kUnknown;
    double beads_px = kUnknown;  // residual of the femur's beads in it
    Pose imager_from_femur;      // by the beads
};

struct LocationResult {
    StepFindings findings;
    int stage = 0;
    Pose femur_from_cut_cavity;
    CavityOffset offset;         // from the plan
    double bound_mm = kUnknown;  // 95 %, of the location's own error at the worst place
    std::vector<LocatedView> views;
    std::vector<std::string> weak_directions;
};

struct CorrectionResult {
    StepFindings findings;
    int stage = 0;
    Pose robot_from_femur;                               // from now on
    CavityOffset offset;                                 // of the cut that was measured
    double announced_mm = kUnknown;                      // its 95 % bound, as it was known before
    double probability = kUnknown;                       // of an offset as large or larger, by what was known before
    double gain_place = kUnknown, gain_turn = kUnknown;  // share of what was measured last that is corrected
    CavityOffset correction;                             // by which the next cut is commanded elsewhere
    std::optional<double> next_inset_mm, next_bound_mm;  // nothing: that was the last
};

// To the case's JSON and back; `parse` gives the first thing that is wrong in words, `where` is what it calls the text.
std::string jsonText(const ImagesResult& result);
std::string jsonText(const RegistrationResult& result);
std::string jsonText(const PlanResult& result);
std::string jsonText(const TimeOutResult& result);
std::string jsonText(const CutStepResult& result);
std::string jsonText(const LocationResult& result);
std::string jsonText(const CorrectionResult& result);

Result<ImagesResult> parseImages(std::string_view text, const std::string& where);
Result<RegistrationResult> parseRegistration(std::string_view text, const std::string& where);
Result<PlanResult> parsePlan(std::string_view text, const std::string& where);
Result<TimeOutResult> parseTimeOut(std::string_view text, const std::string& where);
Result<CutStepResult> parseCut(std::string_view text, const std::string& where);
Result<LocationResult> parseLocation(std::string_view text, const std::string& where);
Result<CorrectionResult> parseCorrection(std::string_view text, const std::string& where);

// Of any of them.
Result<StepFindings> parseFindings(std::string_view text, const std::string& where);

}  // namespace fluorocut
