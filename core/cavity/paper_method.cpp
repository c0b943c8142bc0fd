#include "core/cavity/paper_method.h"

#include <algorithm>
#include <cmath>

#include <Eigen/SVD>
#include <fmt/format.h>

#include "core/base/stopwatch.h"
#include "core/cavity/seen_outline.h"
#include "core/geometry/mesh_properties.h"

namespace fluorocut::cavity {
namespace {

constexpr const char* kStep = "cavity location";
constexpr int kMostCycles = 30;
constexpr double kSettledMm = 1e-3, kSettledRad = 1e-5;
constexpr double kArmMm = 40;         // a turn by one radian counts as this way, where ranks are asked
constexpr double kSeenShare = 0.25;   // of the best seen direction's response: less is not seen
constexpr double kCorrelatedPx = 60;  // along an outline, its error is the same
// Of an outline's place and turn whatever its residual: thickness shifts where a shadow's edge is seen.
constexpr double kOutlineBiasPx = 0.6, kOutlineBiasRad = 0.004;
constexpr double kStepMm = 0.5, kStepRad = 0.02;  // of differences

// Three numbers that a view sees of a motion: of the cavity's middle (mm, at its depth), and the turn.
using Seen = Vector3;

struct View {
    const CavityView* given;
    CArm carm;
    Contour outline;  // seen, with square pixels
};

// Turns in the image are turns of what is seen when pixels are square.
Contour squared(Contour contour, const CArm& carm) {
    for (Vector2& p : contour)
        p = (p - carm.principal_point_px).cwiseProduct(carm.pixel_mm) / carm.pixel_mm.x();
    return contour;
}

CArm squared(CArm carm) {
    carm.principal_point_px.setZero();
    carm.pixel_mm.y() = carm.pixel_mm.x();
    return carm;
}

}  // namespace

Rigid3 backProjected(const PlaneRigid& seen, const CArm& carm, double depth_mm) {
    const Vector2 middle = carm.principal_point_px;
    const Vector2 shift = (seen * middle - middle).cwiseProduct(carm.pixel_mm) * (depth_mm / carm.focal_length_mm);
    return Rigid3::fromTranslation({shift.x(), shift.y(), 0}) * Rigid3::fromRotationVector({0, 0, seen.angle_rad});
}

Result<CavityLocation> locateByPaper(const std::vector<CavityView>& given, const TriangleMesh& mesh,
                                     const Rigid3& planned_femur_from_cavity, const CavityLocationOptions& options,
                                     Progress& progress) {
    const Stopwatch stopwatch;
    Result<Silhouette> silhouette = Silhouette::prepare(mesh, "cavity");
    if (!silhouette) return silhouette.error();
    const Vector3 middle = meshProperties(mesh).centroid;
    std::vector<View> views;
    for (const CavityView& view : given) {
        if (progress.isCancelled()) return cancelled(kStep);
        progress.report(0.8 * static_cast<double>(views.size()) / static_cast<double>(given.size()),
                        "looking for the cavity's outline");
        const Result<Contour> outline =
            outlineFromBefore(view, mesh, *silhouette, planned_femur_from_cavity, planned_femur_from_cavity);
        if (!outline) return outline.error();
        views.push_back({&view, squared(view.carm.ideal()), squared(*outline, view.carm)});
    }

    // What a view sees between its outline and the one that the cavity would have there.
    const auto fitIn = [&](const View& view, const Rigid3& pose) -> std::optional<ContourFit> {
        const auto model = predictedOutline(*silhouette, view.given->carm, view.given->after_imager_from_femur * pose);
        if (!model) return std::nullopt;
        return rigidFit(squared(*model, view.given->carm), view.outline);
    };
    CavityLocation location;
    Rigid3 pose = planned_femur_from_cavity;
    while (location.iterations < kMostCycles && !location.converged) {
        if (progress.isCancelled()) return cancelled(kStep);
        progress.report(0.8 + 0.15 * location.iterations / kMostCycles, "laying contours upon each other");
        ++location.iterations;
        const Rigid3 before = pose;
        for (const View& view : views) {
            const std::optional<ContourFit> fit = fitIn(view, pose);
            if (!fit) {
                return noSolution(kStep, fmt::format("view {}: a cavity that has left the image", view.given->name),
                                  "outlines that belong to one cavity", "see that poses and images belong together");
            }
            const Rigid3& imager_from_femur = view.given->after_imager_from_femur;
            const double depth = (imager_from_femur * (pose * middle)).z();
            pose =
                imager_from_femur.inverse() * backProjected(fit->to_from, view.carm, depth) * imager_from_femur * pose;
        }
        const Rigid3 moved = before.inverse() * pose;
        location.converged = (moved * middle - middle).norm() < kSettledMm && moved.rotationAngle() < kSettledRad;
    }

    // By small motions of the cavity: what each view would see of them.
    const auto rows = static_cast<Eigen::Index>(3 * views.size());
    Eigen::MatrixXd response(rows, 6);
    Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(rows, rows);
    for (std::size_t v = 0; v < views.size(); ++v) {
        const View& view = views[v];
        const auto at = static_cast<Eigen::Index>(3 * v);
        const Rigid3& imager_from_femur = view.given->after_imager_from_femur;
        const double depth = (imager_from_femur * (pose * middle)).z();
        const Vector3 in_imager = imager_from_femur * (pose * middle);
        const Vector2 px = view.carm.project(in_imager);
        const double mm_per_px = view.carm.pixel_mm.x() * depth / view.carm.focal_length_mm;
        const auto seen = [&](const Rigid3& there) -> std::optional<Seen> {
            const std::optional<ContourFit> fit = fitIn(view, there);
            if (!fit) return std::nullopt;
            const Vector2 shift = mm_per_px * (fit->to_from * px - px);
            return Seen(shift.x(), shift.y(), fit->to_from.angle_rad);
        };
        const std::optional<Seen> here = seen(pose);
        for (int j = 0; j < 6; ++j) {
            Vector6 delta = Vector6::Zero();
            delta[j] = j < 3 ? kStepMm : kStepRad;
            const std::optional<Seen> there = seen(pose.perturbed(delta));
            if (!here || !there) {
                return noSolution(kStep, fmt::format("view {}: a cavity at the image's border", view.given->name),
                                  "the whole cavity in the picture");
            }
            response.block<3, 1>(at, j) = (*here - *there) / delta[j];
        }
        const std::optional<ContourFit> left = fitIn(view, pose);
        const double rms = left ? left->rms_px : 0;
        const double outline_px = std::sqrt(rms * rms * kCorrelatedPx / std::max(kCorrelatedPx, length(view.outline)) +
                                            kOutlineBiasPx * kOutlineBiasPx);
        const ViewPoseUncertainty& known = options.view_pose;
        const double place = std::pow(outline_px * mm_per_px, 2) + std::pow(known.in_plane_mm, 2);
        noise(at, at) = noise(at + 1, at + 1) = place;
        noise(at + 2, at + 2) = std::pow(kOutlineBiasRad, 2) + std::pow(known.rotation_rad, 2);
    }
    // Directions by how well they are seen. What is not seen stays as planned: its error is what the plan allows.
    Vector6 scale;
    scale << 1, 1, 1, 1 / kArmMm, 1 / kArmMm, 1 / kArmMm;
    // About the cavity's middle, where a turn is a turn: of it and the origin's motion, origin = from_middle *
    // middle's.
    Matrix6 from_middle = Matrix6::Identity();
    from_middle.topRightCorner<3, 3>() = skew(pose.rotate(middle));
    response = (response * from_middle).eval();
    Eigen::MatrixXd weighed = response * scale.asDiagonal();
    for (Eigen::Index row = 2; row < rows; row += 3)
        weighed.row(row) *= kArmMm;
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(weighed, Eigen::ComputeFullV | Eigen::ComputeThinU);
    const Eigen::VectorXd& strength = svd.singularValues();
    location.rank = 0;
    for (Eigen::Index i = 0; i < strength.size(); ++i)
        if (strength[i] > kSeenShare * strength[0]) ++location.rank;
    Eigen::VectorXd row_scale = Eigen::VectorXd::Ones(rows);
    for (Eigen::Index row = 2; row < rows; row += 3)
        row_scale[row] = kArmMm;
    Eigen::MatrixXd gain = Eigen::MatrixXd::Zero(6, rows);
    for (int i = 0; i < location.rank; ++i)
        gain += scale.asDiagonal() * (svd.matrixV().col(i) * svd.matrixU().col(i).transpose() / strength[i]) *
                row_scale.asDiagonal();
    Matrix6 covariance = gain * noise * gain.transpose();
    // An axis's unseen motion, and what it feigns in the seen directions.
    for (int i = location.rank; i < 6; ++i) {
        const Vector6 unseen = scale.asDiagonal() * svd.matrixV().col(i);
        const double turn = unseen.tail<3>().norm(), way = unseen.head<3>().norm();
        const double most = std::min(turn > 0 ? options.limits.most_rotation_rad / turn : INFINITY,
                                     way > 0 ? options.limits.most_offset_mm / way : INFINITY);
        const Vector6 error = (most / 2) * (gain * (response * unseen) - unseen);
        covariance += error * error.transpose();
    }
    covariance = from_middle * covariance * from_middle.transpose();
    location.femur_from_cavity = {Frame::femur, Frame::cavity, pose, (covariance + covariance.transpose()) / 2};
    for (const View& view : views) {
        ViewResidual residual{view.given->name};
        const auto model = predictedOutline(*silhouette, view.given->carm, view.given->after_imager_from_femur * pose);
        if (model) residual.contour_px = distanceTo(view.outline, squared(*model, view.given->carm));
        location.views.push_back(residual);
    }
    location.elapsed_ms = stopwatch.ms();
    return location;
}

}  // namespace fluorocut::cavity
