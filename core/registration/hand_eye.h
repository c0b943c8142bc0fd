// Robot-corkscrew calibration: where the corkscrew sits on the robot's flange, from images of it in several poses of
// the robot, while the C-arm stands still in one or more positions k:
//
//     imager_from_corkscrew_i = imager_k_from_robot * robot_from_flange_i * flange_from_corkscrew
//
// Start in closed form, from the motions A X = X B between poses of one position, A = flange_i_from_flange_j,
// B = corkscrew_i_from_corkscrew_j: the rotation as the quaternion least changed by all q_a q_x - q_x q_b = 0 (Chou and
// Kamel 1991; Horaud and Dornaika 1995), the place from (R_a - 1) t_x = R_x t_b - t_a. Then all images jointly: least
// squares over flange_from_corkscrew, every imager_k_from_robot and what the images share (pose_network.h).
//
// Weights: each pose's covariance or evidence. Poses without either get CorkscrewNoise's, whose common factor is then
// estimated from the residuals; stated covariances are taken at their word unless the residuals contradict them
// (1 in 1000), then the result's is inflated and a warning says so. A robot's noise (repeatability) is an option, alike
// in all directions, independent from pose to pose.
//
// Outliers: images farther from the others' prediction than noise allows are left out and named. The start is then
// searched among pairs of motions by the least median of the distances.
//
// Fails, in words: too few poses; motions that leave a direction of the answer open (none turned; all turned about one
// axis); poses that contradict each other, with what would fit when something simple would: inverted poses, metres for
// millimetres, another order.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/base/acceptance.h"
#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/geometry/pose.h"
#include "core/geometry/pose_evidence.h"
#include "core/registration/corkscrew_noise.h"
#include "core/registration/shared_prior.h"

namespace fluorocut {

struct HandEyeObservation {
    std::string name;    // of the image, for messages
    std::string imager;  // the C-arm's position; it did not move between observations of one name
    Rigid3 robot_from_flange;
    Rigid3 imager_from_corkscrew;
    std::optional<Matrix6> covariance;     // of imager_from_corkscrew, as Pose has it
    std::optional<PoseEvidence> evidence;  // goes before pose and covariance
};

struct HandEyeLimits {
    double most_place_mm = 0.05;                             // standard deviation along the worst direction
    double most_rotation_rad = 0.05 * 0.017453292519943295;  // and about the worst axis
    double most_noise_factor = 2;                            // residuals over what the covariances allow
    double least_share = 0.7;                                // of the images that agree

    Result<void> validate() const;
};

struct HandEyeOptions {
    CorkscrewNoise assumed;         // of poses that come without a covariance
    double robot_place_mm = 0;      // standard deviation of the flange's place, per axis; 0: exact
    double robot_rotation_rad = 0;  // and of its rotation, per axis
    double least_turn_rad = 0.035;  // rms rotation about a second axis, below which nothing is computed: 2 degrees
    SharedPrior shared;             // of the evidences' parameters; empty: they are exact
    // Asks image i again, at a pose and values of the shared parameters; may be empty.
    std::function<Result<PoseEvidence>(std::size_t, const Rigid3&, const Eigen::VectorXd&)> relinearise;
    std::uint64_t seed = 1;  // of the search for outliers
    HandEyeLimits limits;

    Result<void> validate() const;
};

struct HandEyeResidual {
    std::string name;
    Vector6 seen_minus_predicted = Vector6::Constant(std::numeric_limits<double>::quiet_NaN());  // mm, rad; imager
    double place_mm = std::numeric_limits<double>::quiet_NaN();
    double rotation_rad = std::numeric_limits<double>::quiet_NaN();
    double distance = std::numeric_limits<double>::quiet_NaN();  // in standard deviations: of six numbers, about 2.3
    bool rejected = false;
};

struct ImagerPlacement {
    std::string name;
    Pose imager_from_robot;  // with its covariance
};

struct HandEyeCalibration {
    Pose flange_from_corkscrew;  // with its covariance
    std::vector<ImagerPlacement> imagers;
    // (tx ty tz rx ry rz) of flange_from_corkscrew, of each imager, then the shared parameters as estimated.
    Eigen::MatrixXd covariance;
    std::vector<Eigen::VectorXd> shared;  // per imager, in the order of SharedPrior::names
    Eigen::MatrixXd shared_covariance;    // of the first imager's
    std::vector<HandEyeResidual> residuals;
    double rms_place_mm = std::numeric_limits<double>::quiet_NaN();      // of those that agree
    double rms_rotation_rad = std::numeric_limits<double>::quiet_NaN();  //
    double noise_factor = std::numeric_limits<double>::quiet_NaN();      // residuals over what was stated or assumed; 1
    double worst_place_mm = std::numeric_limits<double>::quiet_NaN();    // standard deviations of the worst direction
    double worst_rotation_rad = std::numeric_limits<double>::quiet_NaN();  // of flange_from_corkscrew
    std::vector<std::string> weak_directions;
    std::vector<std::string> warnings;
    Acceptance acceptance;
    double elapsed_ms = std::numeric_limits<double>::quiet_NaN();

    std::size_t used() const;
};

Result<HandEyeCalibration> calibrateHandEye(const std::vector<HandEyeObservation>& observations,
                                            const HandEyeOptions& options = {}, Progress& progress = Progress::none());

}  // namespace fluorocut
