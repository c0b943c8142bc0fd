// The linear algebra of chain.h, shared with the search for the next view: what each view says of robot_from_femur and
// how the errors of all measurements enter into it.
#pragma once

#include <vector>

#include "core/registration/chain.h"

namespace fluorocut::chain {

// Errors of one source and what they do to the answer of each view, 6 rows a view.
struct Source {
    enum class Kind { corkscrew, beads, robot, hand_eye, parameters };
    Kind kind;
    std::size_t view = 0;        // of the three kinds that belong to one
    Eigen::MatrixXd effect;      // 6 n x errors
    Eigen::MatrixXd covariance;  // errors x errors
    std::vector<std::size_t> parameters;
};

struct System {
    std::vector<Rigid3> answers;  // robot_from_femur of each view
    std::vector<Source> sources;
    Eigen::MatrixXd covariance;  // of all answers, 6 n x 6 n
};

struct Solution {
    Rigid3 robot_from_femur;
    Matrix6 covariance;
    Eigen::MatrixXd gain;  // 6 x 6 n: from errors of the answers to that of the estimate
    Eigen::VectorXd residual;
    double chi_square = 0;
};

System buildSystem(const ChainProblem& problem, const std::vector<std::size_t>& views);
Solution solve(const System& system);
// The covariance alone: it does not depend on the residuals.
Matrix6 predictedCovariance(const System& system);

}  // namespace fluorocut::chain
