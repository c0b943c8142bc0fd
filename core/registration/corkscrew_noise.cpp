#include "core/registration/corkscrew_noise.h"

#include "core/base/option_checks.h"

namespace fluorocut {

Result<void> CorkscrewNoise::validate() const {
    return requireRanges({{"in_plane_mm", in_plane_mm, 1e-6, 100, "mm"},
                          {"depth_mm", depth_mm, 1e-6, 100, "mm"},
                          {"twist_rad", twist_rad, 1e-8, 1, "rad"},
                          {"roll_rad", roll_rad, 1e-8, 1, "rad"},
                          {"pitch_rad", pitch_rad, 1e-8, 1, "rad"}});
}

Matrix6 CorkscrewNoise::covarianceAt(const Rigid3& imager_from_corkscrew) const {
    // The axes about which the three angles turn. Near roll = 90 degrees twist and pitch turn about one axis, and what
    // the roll's neighbours leave out is given the twist's uncertainty.
    const Vector3 angles = imager_from_corkscrew.twistRollPitch();
    const Rigid3 pitch = Rigid3::fromRotationVector({0, 0, angles.z()});
    Matrix3 axes;
    axes.col(0) = imager_from_corkscrew.rotate(Vector3::UnitX());
    axes.col(1) = pitch.rotate(Vector3::UnitY());
    axes.col(2) = Vector3::UnitZ();
    const Vector3 sigma(twist_rad, roll_rad, pitch_rad);
    Matrix6 covariance = Matrix6::Zero();
    covariance.diagonal().head<3>() << in_plane_mm * in_plane_mm, in_plane_mm * in_plane_mm, depth_mm * depth_mm;
    covariance.bottomRightCorner<3, 3>() =
        axes * sigma.cwiseAbs2().asDiagonal() * axes.transpose() + 1e-4 * twist_rad * twist_rad * Matrix3::Identity();
    return covariance;
}

}  // namespace fluorocut
