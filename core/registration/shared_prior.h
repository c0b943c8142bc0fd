// What is known beforehand of parameters that images share (see PoseEvidence): a focal length, an image centre, the
// dimensions of a fiducial.
//
// A parameter may be one for all positions of a C-arm (a fiducial's dimension), or change from position to position by
// a little (the focal length, which follows the gantry as it flexes): then each position has its own,
//     p_k = p + q_k,    p ~ N(mean, sigma^2),  q_k ~ N(0, change_sigma^2)
// so that positions are tied to each other more closely than to the calibration.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/result.h"

namespace fluorocut {

struct SharedPrior {
    std::vector<std::string> names;  // "focal length", ...: as the evidence has them, in its order
    Eigen::VectorXd mean;
    Eigen::VectorXd sigma;         // 0: exactly known; infinite: nothing known
    Eigen::VectorXd change_sigma;  // 0: the same in all positions

    Eigen::Index size() const { return mean.size(); }
    // Sizes that belong together, standard deviations that are not negative.
    Result<void> validate() const;
};

// The parameters of several positions side by side.
struct SharedLayout {
    Eigen::VectorXd mean;
    Eigen::MatrixXd information;          // of the prior
    std::vector<std::vector<int>> index;  // [position][parameter]: which of the above

    SharedLayout(const SharedPrior& prior, std::size_t positions);
    // What these values are for one position.
    Eigen::VectorXd valuesOf(const Eigen::VectorXd& all, std::size_t position) const;
};

}  // namespace fluorocut
