// A made-up operating room for the chain: a robot that holds the corkscrew, a femur, views of both, and measurements
// with errors that are drawn from exactly the covariances they state. Frames as in core/registration/chain.h.
#pragma once

#include <string>
#include <vector>

#include "core/base/random.h"
#include "core/base/units.h"
#include "core/imaging/carm_position.h"
#include "core/registration/chain.h"

namespace fluorocut::test {

inline Vector6 drawn(Random& random, const Matrix6& covariance) {
    Vector6 z;
    for (int i = 0; i < 6; ++i)
        z[i] = random.normal();
    return covariance.llt().matrixL() * z;
}

inline Matrix6 diagonal(double in_plane_mm, double depth_mm, double rotation_rad, double twist_rad) {
    Vector6 s;
    s << in_plane_mm, in_plane_mm, depth_mm, rotation_rad, rotation_rad, twist_rad;
    return s.cwiseAbs2().asDiagonal();
}

struct ChainScene {
    Rigid3 robot_from_femur = Rigid3(expRotation({0.2, -1.1, 0.5}), {620, -80, 310});
    Rigid3 flange_from_corkscrew = Rigid3(expRotation({1.2, 0.3, -0.4}), {10, -20, 90});
    Matrix6 hand_eye = diagonal(0.05, 0.05, 0.0008, 0.0008);
    Matrix6 robot = diagonal(0.02, 0.02, 0.0001, 0.0001);
    // Not diagonal: depth goes with tilt, as it does in a real fit.
    Matrix6 corkscrew, beads;
    double focal_sigma = 0.002, center_sigma_px = 1.5;
    std::vector<double> orbital_deg{0, 70};
    std::vector<double> angulation_deg{0, 10};

    ChainScene() {
        Matrix6 mix = Matrix6::Identity();
        mix(2, 4) = 120;
        mix(0, 3) = -15;
        corkscrew = mix * diagonal(0.02, 0.3, 0.001, 0.0015) * mix.transpose();
        beads = mix * diagonal(0.03, 0.2, 0.0012, 0.0008) * mix.transpose();
    }

    // Where view k really is.
    Rigid3 imagerFromFemur(std::size_t k) const {
        CArmPosition position;
        position.orbital_rad = radiansFromDegrees(orbital_deg[k]);
        position.angulation_rad = radiansFromDegrees(angulation_deg[k]);
        return nominalImagerFromRoom(position, 700) * Rigid3::fromRotationVector({0.1, 0.2, -0.1});
    }
    // The robot holds the corkscrew beside the femur, a little differently for each view.
    Rigid3 robotFromFlange(std::size_t k) const {
        const Rigid3 femur_from_corkscrew(expRotation({0.3, 1.2, 0.1 * static_cast<double>(k)}),
                                          {60, 5.0 * static_cast<double>(k), 40});
        return robot_from_femur * femur_from_corkscrew * flange_from_corkscrew.inverse();
    }
    // How a pose follows relative focal length and image centre: depth scales, the picture shifts.
    static Eigen::MatrixXd sensitivity(const Rigid3& pose) {
        Eigen::MatrixXd s = Eigen::MatrixXd::Zero(6, 3);
        const double depth = pose.translation().z();
        s(2, 0) = 0.95 * depth;
        s(3, 0) = 0.02;
        s(0, 1) = s(1, 2) = -0.32 * depth / 1000;
        s(4, 1) = 1e-5;
        return s;
    }

    // random: null for measurements without error.
    ChainProblem problem(Random* random) const {
        ChainProblem problem;
        problem.parameters = {{"focal length", "focal length", focal_sigma},
                              {"centre u", "image centre", center_sigma_px},
                              {"centre v", "image centre", center_sigma_px}};
        Eigen::Vector3d wrong = Eigen::Vector3d::Zero();
        if (random)
            wrong = Eigen::Vector3d(focal_sigma * random->normal(), center_sigma_px * random->normal(),
                                    center_sigma_px * random->normal());
        const auto noise = [&](const Matrix6& covariance) {
            return random ? drawn(*random, covariance) : Vector6(Vector6::Zero());
        };
        problem.flange_from_corkscrew = {Frame::flange, Frame::corkscrew,
                                         flange_from_corkscrew.perturbed(noise(hand_eye)), hand_eye};
        for (std::size_t k = 0; k < orbital_deg.size(); ++k) {
            ChainView view;
            view.name = std::string("v").append(std::to_string(k + 1));
            const Rigid3 femur = imagerFromFemur(k);
            const Rigid3 of_corkscrew = femur * robot_from_femur.inverse() * robotFromFlange(k) * flange_from_corkscrew;
            const auto measured = [&](Frame source, const Rigid3& truth, const Matrix6& covariance) {
                PoseMeasurement one;
                one.sensitivity = sensitivity(truth);
                one.parameters = {0, 1, 2};
                one.pose = {Frame::imager, source, truth.perturbed(noise(covariance) + one.sensitivity * wrong),
                            covariance};
                return one;
            };
            view.imager_from_corkscrew = measured(Frame::corkscrew, of_corkscrew, corkscrew);
            view.imager_from_femur = measured(Frame::femur, femur, beads);
            view.robot_from_flange = {Frame::robot, Frame::flange, robotFromFlange(k).perturbed(noise(robot)), robot};
            problem.views.push_back(view);
        }
        return problem;
    }
};

}  // namespace fluorocut::test
