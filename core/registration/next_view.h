// Where to turn the C-arm for the next view: the angles that lower the worst direction of a target point's covariance
// most. What-if: for each pair of angles on a grid, the covariance of robot_from_femur once a view from there is added
// to the chain.
//
// What a view from elsewhere would say is taken from the views at hand: its own errors as they are in the imager's axes
// (depth is the weak direction wherever one looks from), the effect of the imager's parameters likewise; that of the
// objects' parameters in depth likewise (an error of scale), across the beam and in rotation turned with the objects. A
// better forecast (beads that come into the field, a corkscrew seen end on) may be handed over as a function.
//
// Angles: of core/imaging/carm_position.h, the C-arm turning about the target point, which keeps its place in the
// picture. The patient and the robot stay. Covariances do not depend on what will be measured, so that no image is
// needed; to first order they are what the chain then reports.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/registration/chain.h"

namespace fluorocut {

struct CArmAngles {
    double orbital_rad = 0;
    double angulation_rad = 0;
};

// The measurements that a view from there would give; the poses themselves are filled in.
using ViewForecast = std::function<ChainView(const Rigid3& imager_from_corkscrew, const Rigid3& imager_from_femur)>;

struct NextViewOptions {
    NamedPoint target{"femur's origin"};
    std::size_t reference = 0;          // the view that angles are known of
    CArmAngles reference_angles;        // how the C-arm stood for it; zero: angles are counted from it
    double most_orbital_rad = 1.92;     // 110 degrees, either way
    double most_angulation_rad = 0.61;  // 35 degrees
    double least_turn_rad = 0.262;      // 15 degrees, from the beams at hand: nearer ones are no second opinion
    double step_rad = 0.0873;           // 5 degrees
    ViewForecast forecast;              // empty: from the views at hand

    Result<void> validate() const;
};

struct ForecastView {
    CArmAngles angles;
    Matrix6 covariance;  // of robot_from_femur
    Matrix3 point_covariance_mm2;
    double worst_sigma_mm = 0;
    double turn_rad = 0;  // between the lines of its beam and that of the nearest view at hand
};

struct NextView {
    double worst_sigma_mm;  // of the target, as it is
    double radius95_mm;
    Vector3 worst_direction;  // robot frame
    ForecastView best;
    double best_radius95_mm;
    std::vector<ForecastView> grid;
    std::string largest_term;  // of what then remains
    std::string sentence;

    NextView();  // NaN: not run
};

// Fails as solveChain does for measurements without covariance, and for options outside their limits.
Result<NextView> adviseNextView(const ChainProblem& problem, const NextViewOptions& options = {});

}  // namespace fluorocut
