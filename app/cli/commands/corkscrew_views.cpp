#include "app/cli/commands/corkscrew_views.h"

#include <Eigen/Dense>
#include <fmt/format.h>

#include "app/cli/files.h"
#include "app/cli/options.h"
#include "core/io/resources.h"
#include "core/registration/pose_network.h"

namespace fluorocut::cli {

namespace {

Eigen::VectorXd sigmaOf(const CorkscrewLayout& layout, const CArm& carm, const CalibrationUncertainty& calibration) {
    const std::vector<std::string> names = corkscrewParameters(layout);
    Eigen::VectorXd sigma(static_cast<Eigen::Index>(names.size()));
    for (std::size_t i = 0; i < names.size(); ++i) {
        const bool angle = names[i] == "helix phase";
        sigma[static_cast<Eigen::Index>(i)] = calibration.dimensions_mm / (angle ? layout.helix.radius_mm : 1);
    }
    sigma[0] = calibration.focal_length;
    sigma[1] = calibration.principal_point_mm / carm.pixel_mm.x();
    sigma[2] = calibration.principal_point_mm / carm.pixel_mm.y();
    return sigma;
}

Error about(const std::filesystem::path& file, Error error) {
    error.where = file.string() + ", " + error.where;
    return error;
}

}  // namespace

void declareRobotNoise(CLI::App& app, RobotNoise& robot, const std::string& where) {
    app.add_option("--robot-sd-mm", robot.place_mm, "Standard deviation of the robot's place, per axis" + where)
        ->check(between(0, 100))
        ->capture_default_str();
    app.add_option("--robot-sd-deg", robot.rotation_deg, "Standard deviation of the robot's rotation, per axis" + where)
        ->check(between(0, 50))
        ->capture_default_str();
}

void declareDistortion(CLI::App& app, double& distortion_mm) {
    app.add_option("--distortion-mm", distortion_mm,
                   "Of images: standard deviation of what the distortion map leaves, at the detector")
        ->check(between(0, 10))
        ->capture_default_str();
}

void declareDimensions(CLI::App& app, double& dimensions_mm) {
    app.add_option("--dimension-sd-mm", dimensions_mm,
                   "Standard deviation of the corkscrew's dimensions as it was made")
        ->check(between(0, 10))
        ->capture_default_str();
}

void declareLimits(CLI::App& app, double& most_place_mm, const std::string& place, double& most_rotation_deg,
                   const std::string& rotation) {
    app.add_option("--max-place-mm", most_place_mm, "Acceptance limit: standard deviation of " + place)
        ->check(between(0, 1000))
        ->capture_default_str();
    app.add_option("--max-rotation-deg", most_rotation_deg, "Acceptance limit: standard deviation of " + rotation)
        ->check(between(0, 180))
        ->capture_default_str();
}

Result<CorkscrewLayout> layoutOf(const std::string& corkscrew) {
    const Result<std::filesystem::path> file = findResource("fiducials", corkscrew);
    if (!file) return file.error();
    return readCorkscrew(*file);
}

Result<CorkscrewView> viewOf(const CorkscrewImage& image, const CorkscrewLayout& layout,
                             const CalibrationUncertainty& calibration, Pictures& before, Progress& progress) {
    CorkscrewView view;
    Result<CArm> carm = readImager(image.carm);
    if (!carm) return carm.error();
    Result<ImageFile> file = readImage(image.image, {.frame = image.frame});
    if (!file) return file.error();
    if (file->info.width != carm->columns || file->info.height != carm->rows) {
        return invalidInput(image.image.string(), fmt::format("{} x {} pixels", file->info.width, file->info.height),
                            fmt::format("the {} x {} of {}", carm->columns, carm->rows, image.carm.string()));
    }
    if (const Result<void> good = before.add(image.image.string(), file->image); !good) return good.error();
    view.carm = std::move(*carm);
    view.image = std::move(file->image);
    view.info = std::move(file->info);
    CorkscrewPoseOptions options;
    options.calibration = calibration;
    Result<CorkscrewPose> pose = estimateCorkscrewPose(view.image, view.carm, layout, options, progress);
    if (!pose) return about(image.image, pose.error());
    view.pose = std::move(*pose);
    // All that is not the calibration's: the pose's covariance without what follows the shared parameters.
    const PoseEvidence& evidence = view.pose.evidence;
    const Eigen::VectorXd sigma = sigmaOf(layout, view.carm, calibration);
    const Eigen::MatrixXd follows = evidence.sensitivity();
    const Matrix6 noise = evidence.covariance();
    const Matrix6 rest = *view.pose.imager_from_corkscrew.covariance -
                         follows * sigma.cwiseAbs2().asDiagonal() * follows.transpose() - noise;
    const Eigen::SelfAdjointEigenSolver<Matrix6> parts(0.5 * (rest + rest.transpose()));
    view.own_covariance =
        noise + parts.eigenvectors() * parts.eigenvalues().cwiseMax(0).asDiagonal() * parts.eigenvectors().transpose();
    view.evidence = withNoise(evidence, view.own_covariance);
    return view;
}

Result<PoseEvidence> askAgain(const CorkscrewView& view, const CorkscrewLayout& layout, const Rigid3& pose,
                              const Eigen::VectorXd& parameters) {
    if (view.pose.metal_is_bright) {
        return noSolution("the image asked again", "bright metal", "dark metal");
    }
    const CorkscrewLayout changed = withParameters(layout, parameters);
    if (Result<void> valid = changed.validate(); !valid) return valid.error();
    const Result<CorkscrewFit> fit = refineOnImage(view.image, withParameters(view.carm, parameters), changed, pose);
    if (!fit) return fit.error();
    PoseEvidence answer = fit->evidence;
    answer.shared += parameters;  // told as differences from the C-arm and the layout that it was given
    return withNoise(std::move(answer), view.own_covariance);
}

SharedPrior priorOf(const CorkscrewLayout& layout, const CArm& carm, const CalibrationUncertainty& calibration,
                    double focal_change) {
    SharedPrior prior;
    prior.names = corkscrewParameters(layout);
    prior.sigma = sigmaOf(layout, carm, calibration);
    prior.mean = Eigen::VectorXd::Zero(prior.sigma.size());
    prior.change_sigma = prior.mean;
    prior.change_sigma[0] = focal_change;
    return prior;
}

}  // namespace fluorocut::cli
