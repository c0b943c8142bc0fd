// The solution behind calibrateHandEye: a start in closed form, a search among pairs of motions when images disagree,
// then the joint least squares without those that do.
#pragma once

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "core/registration/hand_eye.h"
#include "core/registration/hand_eye/start.h"
#include "core/registration/pose_network.h"

namespace fluorocut::hand_eye {

struct Fit {
    // Pose 0: flange_from_corkscrew, then the imagers. Covariance: with the noise that was found; distances: with the
    // noise as stated or assumed.
    PoseNetworkResult network;
    std::vector<bool> used;
    double factor = 1;                                        // noise over what is stated or assumed
    bool found = false;                                       // a start was
    double median = std::numeric_limits<double>::infinity();  // of the distances of all, in standard deviations

    std::size_t count() const { return static_cast<std::size_t>(std::count(used.begin(), used.end(), true)); }
    // Root mean squares of the residuals of those in use; NaN without any.
    double placeMm() const;
    double rotationRad() const;
};

class Problem {
  public:
    Problem(const std::vector<HandEyeObservation>& observations, const HandEyeOptions& options);

    MotionSpread spread() const { return spreadOf(motions_); }
    const std::vector<std::string>& names() const { return names_; }
    const std::vector<int>& position() const { return position_; }
    bool stated() const { return stated_; }

    Fit solve() const;

    SharedLayout sharedLayout() const { return {options_.shared, names_.size()}; }

  private:
    // For each position of the C-arm the imager that agrees best with its images: the least median of distances.
    std::vector<Rigid3> posesFrom(const Rigid3& flange_from_corkscrew, double* score = nullptr) const;
    PoseNetwork network(const std::vector<Rigid3>& poses, const std::vector<bool>& used) const;
    PoseNetworkOptions networkOptions() const;
    double freedom(const std::vector<bool>& used) const;
    static double sumOfSquares(const PoseNetworkResult& network, const std::vector<bool>& used);

    // The plain solution over some of the images, and the noise it speaks of.
    Fit refine(const std::vector<Rigid3>& start, const std::vector<bool>& used) const;
    bool clean(const Fit& fit) const;

    // What the result leaves open of a factor's prediction.
    Matrix6 predictionCovariance(const PoseNetworkResult& result, const PoseFactor& factor) const;

    // Images that agree with the answer, judged with the noise of those that do.
    Fit withoutOutliers(Fit fit) const;
    Fit search() const;

    const std::vector<HandEyeObservation>& observations_;
    const HandEyeOptions& options_;
    std::vector<std::string> names_;  // of the positions
    std::vector<int> position_;       // of each observation
    std::vector<PoseEvidence> evidence_;
    std::vector<HandEyeMotion> motions_;
    bool stated_ = true;  // the noise of every pose
};

// What an observation says the pose is.
const Rigid3& poseOf(const HandEyeObservation& observation);

}  // namespace fluorocut::hand_eye
