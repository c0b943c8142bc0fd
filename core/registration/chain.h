// The chain of registrations, robot_from_femur, from all views at once:
//
//     robot_from_femur = robot_from_flange_k * flange_from_corkscrew * corkscrew_from_imager_k * imager_k_from_femur
//
// Every view gives the whole transform with errors of its own (of its two poses and of the robot's) and errors that it
// shares with other views: of the hand-eye calibration, and of parameters such as the focal length, which both of its
// poses follow, so that they partly cancel. With e_k = view k's answer minus the estimate and J the first-order effect
// of each error on it,
//
//     minimise e^T S^-1 e,   S = blockdiag(J_a A_k J_a^T + J_b B_k J_b^T + J_r R_k J_r^T) + J_h H J_h^T + J_s P J_s^T
//
// which is the joint least-squares problem over robot_from_femur, the imagers' poses, the hand-eye pose and the shared
// parameters, each with what is known of it, after all but the first are eliminated. (Generalised least squares; the
// estimate's covariance is (sum of blocks of S^-1)^-1. Images do not correct the calibration by themselves: what one
// image says of its focal length is worth no more than its distortion map. That views disagree does correct it.)
//
// The error of the estimate is a known linear function of each single error: the budget is exact to first order, and
// its terms add up to the covariance.
//
// noSolution: views that contradict each other but agree once two are exchanged; views all from one direction.
// Whether the rest is good enough is told by `acceptance`. A view that contradicts the others is left out, by name,
// when there are at least three.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/acceptance.h"
#include "core/base/result.h"
#include "core/geometry/pose.h"
#include "core/geometry/pose_evidence.h"

namespace fluorocut {

// Something that several measurements take as known: a focal length, where a bead lies. Its error is that of all.
struct SharedParameter {
    std::string name;   // unique: "focal length of C-arm 1"
    std::string group;  // its term in the budget: "focal length"
    double sigma = 0;   // of what is known beforehand, in the parameter's unit
    // The imager's (focal length): its effect turns with the C-arm. Otherwise an object's (where a bead lies): it
    // stays.
    bool of_imager = true;
};

struct PoseMeasurement {
    Pose pose;  // covariance: of errors that are this measurement's alone
    // d pose / d parameter, 6 x parameters.size(), as Rigid3::perturbed has it; empty: nothing is shared.
    Eigen::MatrixXd sensitivity;
    std::vector<std::size_t> parameters;  // indices into ChainProblem::parameters
};

// From what a fit to an image says. `own_covariance`: of the image's own errors (at least evidence.covariance(); more
// where something is known of local distortion). parameters: one for each of evidence.shared.
PoseMeasurement measurementOf(Frame target, Frame source, const PoseEvidence& evidence, const Matrix6& own_covariance,
                              std::vector<std::size_t> parameters);

struct ChainView {
    std::string name;
    PoseMeasurement imager_from_corkscrew;
    PoseMeasurement imager_from_femur;
    Pose robot_from_flange;  // without covariance: exact
};

struct ChainProblem {
    std::vector<ChainView> views;
    Pose flange_from_corkscrew;
    std::vector<SharedParameter> parameters;
};

struct NamedPoint {
    std::string name;
    Vector3 in_femur = Vector3::Zero();
};

struct ChainLimits {
    double most_radius95_mm = 1;      // at the worst of the points
    double least_probability = 1e-3;  // of views that disagree as much or more

    Result<void> validate() const;
};

struct ChainOptions {
    std::vector<NamedPoint> points{{"femur's origin"}};  // where errors are told
    double least_view_angle_rad = 0.1745;                // between two views at least; 0: any
    double outlier_probability = 1e-3;                   // a view less likely than this beside the others is left out
    ChainLimits limits;

    Result<void> validate() const;
};

struct ChainViewResult {
    std::string name;
    bool used = true;
    Pose robot_from_femur;  // of this view alone, with its covariance
    Vector6 residual;       // view - estimate: mm, rad; at the femur's origin
    double residual_mm;     // at the first point
    double chi_square;      // by which the sum of squares falls without it; 6 degrees of freedom. NaN for one view
    double probability;     // of a larger one
    Vector3 beam_in_robot;  // unit, from the source to the detector

    ChainViewResult();
};

// A part of the estimate's error: of one measurement, or one of its components.
struct ChainTerm {
    std::string name;    // "corkscrew, depth", "beads", "hand-eye"
    std::string view;    // empty: common to all
    Matrix6 covariance;  // its part of robot_from_femur's; components that are correlated share evenly

    std::string text() const;  // "corkscrew, depth of view ap"
};

struct PointBudget {
    NamedPoint point;
    Vector3 in_robot;
    Matrix3 covariance_mm2;  // robot frame
    double radius95_mm;      // the sphere about the point that holds the truth with 95 %
    double worst_sigma_mm;
    Vector3 worst_direction;     // robot frame
    std::vector<double> shares;  // of the variance, one for each term; they add up to 1
    std::vector<std::size_t> largest_first;
    std::string sentence;  // "0.31 mm (95 %) at the stem's tip: corkscrew, depth of view ap contributes most (62 %)."
};

struct Chain {
    Pose robot_from_femur;
    std::vector<ChainViewResult> views;
    std::vector<ChainTerm> terms;
    std::vector<PointBudget> points;
    std::vector<std::string> outliers;  // names of the views that were left out
    double chi_square;
    int degrees_of_freedom = 0;
    double probability;     // NaN for one view
    double view_angle_rad;  // the largest between two views
    std::vector<std::string> warnings;
    Acceptance acceptance;

    Chain();  // NaN: not run
};

// invalidInput: no views, a name twice, a measurement without covariance. Wrong frames throw std::logic_error.
Result<Chain> solveChain(const ChainProblem& problem, const ChainOptions& options = {});

// The budget of another point. The chain must have been solved.
PointBudget budgetAt(const Chain& chain, const NamedPoint& point);

}  // namespace fluorocut
