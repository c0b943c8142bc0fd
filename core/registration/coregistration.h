// Co-registration of views: where the imagers of all images were, relative to the first, through the corkscrew that all
// of them see. It stayed where it was between the shots, or a robot moved it by known motions:
//
//     imager_i_from_corkscrew = imager_k_from_base * base_from_corkscrew_i
//
//     fixed    base_from_corkscrew = 1             (the base is the corkscrew itself)
//     moved    base_from_corkscrew_i = robot_from_flange_i * flange_from_corkscrew    (the base is the robot's)
//
// Shots of one position k of the C-arm share imager_k_from_base. All are solved jointly (pose_network.h) with what the
// images share: focal length, image centre, the corkscrew's dimensions, each with a prior. The focal length changes as
// the gantry flexes: its SharedPrior::change_sigma gives every position its own. One image cannot tell focal length
// from depth well; a corkscrew moved by a robot within one position can, and the tie to the other positions carries it
// over.
//
//     view_from_first_i = imager_k(i)_from_base * base_from_imager_k(1)
//
// Frames: the imagers, corkscrew, robot, flange. Weights as in hand_eye.h.
//
// Fails, in words: fewer than two views; all views from the same direction; robot poses that differ without
// flange_from_corkscrew; views that fit only once two are exchanged (as far as robot motions or the C-arm's scales
// tell); views that contradict each other. Two of several views from the same direction are a warning.
#pragma once

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

struct CoregistrationView {
    std::string name;      // for messages: the image's file
    std::string position;  // of the C-arm, which did not move between views of one name; empty: one of its own
    Rigid3 imager_from_corkscrew;
    std::optional<Matrix6> covariance;        // of imager_from_corkscrew, as Pose has it
    std::optional<PoseEvidence> evidence;     // goes before pose and covariance
    std::optional<Rigid3> robot_from_flange;  // of all views or of none
    std::optional<Rigid3> imager_from_room;   // as the C-arm's scales say, where they are known
};

struct CoregistrationLimits {
    // Standard deviation, worst direction, of a point at the corkscrew carried over from the first view: a focal length
    // known to 0.14 % leaves 0.9 mm of depth.
    double most_place_mm = 1;
    double most_rotation_rad = 0.0034906585039886592;  // 0.2 degrees, worst axis
    double least_angle_rad = 0.34906585039886592;      // between the two views that look most differently: 20 degrees

    Result<void> validate() const;
};

struct CoregistrationOptions {
    CorkscrewNoise assumed;                     // of poses that come without a covariance
    std::optional<Pose> flange_from_corkscrew;  // without covariance: exact
    double robot_place_mm = 0;                  // standard deviations of the robot's poses, per axis
    double robot_rotation_rad = 0;
    double same_direction_rad = 0.0873;  // views closer than this look from the same direction: 5 degrees
    SharedPrior shared;                  // of the evidences' parameters; empty: they are exact
    // Asks view i again, at a pose and values of the shared parameters; may be empty.
    std::function<Result<PoseEvidence>(std::size_t, const Rigid3&, const Eigen::VectorXd&)> relinearise;
    CoregistrationLimits limits;

    Result<void> validate() const;
};

struct CoregisteredView {
    std::string name;
    Pose view_from_first;        // imager from imager; the first: identity, exact
    Pose imager_from_base;       // base: corkscrew, or robot
    Pose imager_from_corkscrew;  // as all views together have it
    Eigen::VectorXd shared;      // in the order of SharedPrior::names
    Eigen::VectorXd shared_sigma;
    Vector6 seen_minus_predicted = Vector6::Constant(std::numeric_limits<double>::quiet_NaN());  // mm, rad
    double angle_to_first_rad = std::numeric_limits<double>::quiet_NaN();  // between the directions of view
    // Standard deviations of where the corkscrew's middle is seen from here, knowing where the first view has it.
    double worst_place_mm = std::numeric_limits<double>::quiet_NaN();
    double worst_rotation_rad = std::numeric_limits<double>::quiet_NaN();
};

struct Coregistration {
    std::vector<CoregisteredView> views;
    Eigen::MatrixXd covariance;  // of view_from_first of views 2, 3, ...: 6 numbers each
    Frame base = Frame::corkscrew;
    double chi_square = std::numeric_limits<double>::quiet_NaN();  // of the redundancy, if there is any
    int degrees_of_freedom = 0;
    double widest_angle_rad = std::numeric_limits<double>::quiet_NaN();
    std::vector<std::string> warnings;
    Acceptance acceptance;
    double elapsed_ms = std::numeric_limits<double>::quiet_NaN();
};

Result<Coregistration> coregisterViews(const std::vector<CoregistrationView>& views,
                                       const CoregistrationOptions& options = {},
                                       Progress& progress = Progress::none());

}  // namespace fluorocut
