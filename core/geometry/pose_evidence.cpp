#include "core/geometry/pose_evidence.h"

#include <stdexcept>

#include <Eigen/Cholesky>

namespace fluorocut {
namespace {

Eigen::LDLT<Matrix6> ofPose(const PoseEvidence& evidence) {
    const Eigen::Index all = 6 + evidence.shared.size();
    if (evidence.information.rows() != all || evidence.information.cols() != all || evidence.gradient.size() != all)
        throw std::logic_error("PoseEvidence: sizes do not belong together");
    const Matrix6 of_pose = evidence.information.topLeftCorner<6, 6>();
    return Eigen::LDLT<Matrix6>(of_pose);
}

}  // namespace

Eigen::MatrixXd PoseEvidence::sensitivity() const {
    const auto of_pose = ofPose(*this);
    // Eigen's solvers form addresses past a matrix without columns.
    if (shared.size() == 0) return Eigen::MatrixXd::Zero(6, 0);
    return -of_pose.solve(information.topRightCorner(6, shared.size()));
}

Rigid3 PoseEvidence::poseGiven(const Eigen::VectorXd& values) const {
    const auto of_pose = ofPose(*this);
    if (values.size() != shared.size()) throw std::logic_error("PoseEvidence: another number of shared parameters");
    const Vector6 pull = gradient.head<6>() + information.topRightCorner(6, shared.size()) * (values - shared);
    return target_from_source.perturbed(-of_pose.solve(pull));
}

Matrix6 PoseEvidence::covariance() const {
    return ofPose(*this).solve(Matrix6::Identity());
}

Matrix6 PoseEvidence::covarianceWith(const Eigen::MatrixXd& shared_covariance) const {
    const Eigen::MatrixXd follows = sensitivity();
    if (shared_covariance.rows() != shared.size() || shared_covariance.cols() != shared.size())
        throw std::logic_error("PoseEvidence: a covariance of another size");
    return covariance() + follows * shared_covariance * follows.transpose();
}

}  // namespace fluorocut
