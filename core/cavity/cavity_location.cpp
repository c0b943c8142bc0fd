#include "core/cavity/cavity_location.h"

#include <cmath>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/base/units.h"
#include "core/cavity/full_model.h"
#include "core/cavity/paper_method.h"
#include "core/cavity/seen_outline.h"
#include "core/cavity/without_ct.h"
#include "core/geometry/mesh_properties.h"
#include "core/imaging/carm_image.h"

namespace fluorocut {
namespace {

constexpr const char* kStep = "cavity location";

std::string axisInWords(const Vector3& axis_in_cavity) {
    Eigen::Index which = 0;
    axis_in_cavity.cwiseAbs().maxCoeff(&which);
    return which == 2 ? "the cavity's axis" : which == 0 ? "its first cross axis (x)" : "its second cross axis (y)";
}

// What these views hardly tell: standard deviations beyond the limits, along which direction of the cavity.
std::vector<std::string> weakDirections(const Pose& femur_from_cavity, const CavityLocationLimits& limits) {
    std::vector<std::string> words;
    const Matrix3 cavity_from_femur = femur_from_cavity.target_from_source.rotationMatrix().transpose();
    const auto look = [&](const Matrix3& covariance, double limit, double scale, const char* what, const char* unit) {
        const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(covariance);
        for (int i = 0; i < 3; ++i) {
            const double sigma = std::sqrt(std::max(0.0, eigen.eigenvalues()[i]));
            if (sigma <= limit) continue;
            words.push_back(fmt::format("{} {} is known to {:.2g} {} only", what,
                                        axisInWords(cavity_from_femur * eigen.eigenvectors().col(i)), scale * sigma,
                                        unit));
        }
    };
    const Matrix6& covariance = *femur_from_cavity.covariance;
    look(covariance.topLeftCorner<3, 3>(), limits.most_sigma_mm, 1, "the place along", "mm");
    look(covariance.bottomRightCorner<3, 3>(), limits.most_sigma_rad, degreesFromRadians(1.0), "the rotation about",
         "degrees");
    return words;
}

// For every method alike: how far the outline that a view shows lies from where the cavity was found.
Result<void> addContours(CavityLocation& location, const std::vector<CavityView>& views, const TriangleMesh& mesh,
                         const Rigid3& planned, const std::shared_ptr<const Volume>& ct,
                         const CavityLocationOptions& options) {
    const Result<Silhouette> silhouette = Silhouette::prepare(mesh, "cavity");
    if (!silhouette) return silhouette.error();
    std::optional<VolumeProjector> projector;
    if (ct && options.method == CavityMethod::full) {
        Result<VolumeProjector> prepared = VolumeProjector::prepare(ct, {options.mu_water_per_mm, -1000});
        if (!prepared) return prepared.error();
        projector.emplace(std::move(*prepared));
    }
    const Rigid3& found = location.femur_from_cavity.target_from_source;
    parallelFor(views.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t v = begin; v < end; ++v) {
            ViewResidual& view = location.views[v];
            const Rigid3 pose = views[v].after_imager_from_femur.perturbed(view.pose_correction);
            std::optional<cavity::Contour> seen;
            if (projector) {
                seen = cavity::outlineFromCt(views[v], pose, *projector, mesh, *silhouette, found);
            } else if (auto outline = cavity::outlineFromBefore(views[v], mesh, *silhouette, planned, found)) {
                seen = std::move(*outline);
            }
            if (seen) view.contour_px = cavity::contourResidual(*seen, *silhouette, views[v].carm, pose * found);
        }
    });
    return {};
}

}  // namespace

Result<void> ViewPoseUncertainty::validate() const {
    return requireRanges({{"view_pose.in_plane_mm", in_plane_mm, 1e-4, 50, "mm"},
                          {"view_pose.depth_mm", depth_mm, 1e-4, 100, "mm"},
                          {"view_pose.rotation_rad", rotation_rad, 1e-6, 0.5, "rad"}});
}

Result<void> CavityLocationLimits::validate() const {
    return requireRanges({{"limits.most_sigma_mm", most_sigma_mm, 0, 100, "mm"},
                          {"limits.most_sigma_rad", most_sigma_rad, 0, 4, "rad"},
                          {"limits.most_offset_mm", most_offset_mm, 0, 100, "mm"},
                          {"limits.most_rotation_rad", most_rotation_rad, 0, 4, "rad"},
                          {"limits.most_view_sigmas", most_view_sigmas, 0, 100, ""},
                          {"limits.least_evidence", least_evidence, 0, 1, ""},
                          {"limits.most_contour_px", most_contour_px, 0, 1000, "px"}});
}

Result<void> CavityLocationOptions::validate() const {
    if (const Result<void> ok = view_pose.validate(); !ok) return ok;
    if (const Result<void> ok = limits.validate(); !ok) return ok;
    return requireRanges({{"mu_water_per_mm", mu_water_per_mm, 1e-4, 1, "/mm"}, {"blur_px", blur_px, 0, 5, "px"}});
}

Result<CavityLocation> locateCavity(const std::vector<CavityView>& views, const TriangleMesh& mesh,
                                    const Rigid3& planned_femur_from_cavity, std::shared_ptr<const Volume> ct,
                                    const CavityLocationOptions& options, Progress& progress) {
    if (const Result<void> ok = options.validate(); !ok) return ok.error();
    if (const Result<void> ok = requireSolid(mesh, "cavity"); !ok) return ok.error();
    if (views.empty()) return invalidInput("views", "none", "at least one image after the cut");
    const bool paper = options.method == CavityMethod::paper, needs_before = paper || !ct;
    for (const CavityView& view : views) {
        if (const Result<void> ok = view.carm.validate(); !ok) return ok.error();
        if (const Result<void> ok = requireTakenBy(view.carm, view.after, fmt::format("view {}, image", view.name));
            !ok)
            return ok.error();
        if (needs_before && view.before.empty()) {
            return invalidInput(fmt::format("view {}, image before", view.name), "none",
                                paper ? "one, which the paper's method subtracts"
                                      : "one of each view, as there is no CT of this femur before the cut",
                                paper ? "give it" : "give the images before, or a CT");
        }
        if (view.before.empty()) continue;
        if (const Result<void> ok =
                requireTakenBy(view.carm, view.before, fmt::format("view {}, image before", view.name));
            !ok)
            return ok.error();
    }
    // About the cavity's middle, where a view's pose error is what its standard deviations say, wherever the CT's
    // origin lies.
    const Vector3 middle = planned_femur_from_cavity * meshProperties(mesh).centroid;
    const Rigid3 here_from_femur = Rigid3::fromTranslation(-middle), femur_from_here = here_from_femur.inverse();
    std::shared_ptr<const Volume> moved_ct;
    if (ct && !paper) {
        VolumeGrid grid = ct->grid();
        grid.origin_mm -= middle;
        moved_ct = std::make_shared<const Volume>(grid, ct->voxels());
    }
    std::vector<CavityView> moved_views = views;
    for (CavityView& view : moved_views) {
        view.after_imager_from_femur = view.after_imager_from_femur * femur_from_here;
        view.before_imager_from_femur = view.before_imager_from_femur * femur_from_here;
    }
    const Rigid3 planned = here_from_femur * planned_femur_from_cavity;
    SubProgress locating(progress, 0, 0.9);
    Result<CavityLocation> location =
        paper      ? cavity::locateByPaper(moved_views, mesh, planned, options, locating)
        : moved_ct ? cavity::locateByFullModel(moved_views, mesh, planned, moved_ct, options, locating)
                   : cavity::locateWithoutCt(moved_views, mesh, planned, options, locating);
    if (!location) return location;
    // The paper's has its contours already.
    const Result<void> contours =
        paper ? Result<void>() : addContours(*location, moved_views, mesh, planned, moved_ct, options);
    if (!contours) return contours.error();
    // A shift of the frame leaves the covariance as it is.
    location->femur_from_cavity.target_from_source = femur_from_here * location->femur_from_cavity.target_from_source;
    if (!location->femur_from_cavity.covariance->allFinite()) {
        return noSolution(kStep, "a fit without a finite covariance", "images that tell where the cavity is",
                          "see that poses, cavity and images belong together");
    }
    const CavityLocationLimits& limits = options.limits;
    location->weak_directions = weakDirections(location->femur_from_cavity, limits);
    const Matrix6& covariance = *location->femur_from_cavity.covariance;
    const auto worst = [](const Matrix3& part) {
        return std::sqrt(Eigen::SelfAdjointEigenSolver<Matrix3>(part).eigenvalues().maxCoeff());
    };
    double farthest_view = 0, least_evidence = 1, worst_contour = 0;
    for (const ViewResidual& view : location->views) {
        // One that is not known is not accepted.
        if (!(view.contour_px <= worst_contour))
            worst_contour = std::isnan(worst_contour) ? worst_contour : view.contour_px;
        farthest_view = std::max(farthest_view, view.pose_sigmas);
        least_evidence = std::min(least_evidence, view.evidence);
    }
    const Rigid3 off = planned_femur_from_cavity.inverse() * location->femur_from_cavity.target_from_source;
    location->acceptance = {
        atMost("standard deviation of the place", worst(covariance.topLeftCorner<3, 3>()), limits.most_sigma_mm, "mm"),
        atMost("standard deviation of the rotation", degreesFromRadians(worst(covariance.bottomRightCorner<3, 3>())),
               degreesFromRadians(limits.most_sigma_rad), "degrees"),
        atMost("offset from the plan", off.translation().norm(), limits.most_offset_mm, "mm"),
        atMost("rotation from the plan", degreesFromRadians(off.rotationAngle()),
               degreesFromRadians(limits.most_rotation_rad), "degrees"),
        atLeast("fit converged", location->converged ? 1 : 0, 1, "")};
    if (paper) {
        location->acceptance.push_back(
            atMost("residual of a view's contour", worst_contour, limits.most_contour_px, "px"));
    } else {
        location->acceptance.push_back(atMost("correction of a view's pose, in its standard deviations", farthest_view,
                                              limits.most_view_sigmas, ""));
        location->acceptance.push_back(
            atLeast("share of a view's contrast that the cavity explains", least_evidence, limits.least_evidence, ""));
    }
    return location;
}

}  // namespace fluorocut
