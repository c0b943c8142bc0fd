#include "core/registration/next_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/units.h"
#include "core/geometry/point_error.h"
#include "core/imaging/carm_position.h"
#include "core/registration/chain_system.h"

namespace fluorocut {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
// Of all angles that are nearly as good as the best, the one that turns the C-arm least.
constexpr double kNearlyAsGood = 1.03;
constexpr double kHardlyBetter = 0.9;

// The measurement seen from the imager turned by `rotation`; own errors are the mean of those at hand.
PoseMeasurement fromElsewhere(const PoseMeasurement& measured, const Matrix6& own, const Matrix3& rotation,
                              const Rigid3& pose, const ChainProblem& problem) {
    PoseMeasurement forecast = measured;
    forecast.pose.target_from_source = pose;
    forecast.pose.covariance = own;
    for (std::size_t i = 0; i < measured.parameters.size(); ++i) {
        if (problem.parameters[measured.parameters[i]].of_imager) continue;
        const auto column = static_cast<Eigen::Index>(i);
        // Across the beam and in rotation it goes with the object; in depth it is an error of scale: along any beam.
        Vector6 effect = measured.sensitivity.col(column);
        const double depth = effect[2];
        effect[2] = 0;
        effect.head<3>() = rotation * effect.head<3>();
        effect.tail<3>() = rotation * effect.tail<3>();
        effect[2] += depth;
        forecast.sensitivity.col(column) = effect;
    }
    return forecast;
}

class Forecaster {
  public:
    // The views are made to agree: only covariances are asked for.
    Forecaster(const ChainProblem& problem, const Rigid3& robot_from_femur, const NextViewOptions& options)
        : problem_(problem), options_(options) {
        own_corkscrew_ = own_beads_ = Matrix6::Zero();
        for (ChainView& view : problem_.views) {
            view.imager_from_femur.pose.target_from_source =
                view.imager_from_corkscrew.pose.target_from_source *
                (view.robot_from_flange.target_from_source * problem_.flange_from_corkscrew.target_from_source)
                    .inverse() *
                robot_from_femur;
            const double part = 1 / static_cast<double>(problem_.views.size());
            own_corkscrew_ += part * *view.imager_from_corkscrew.pose.covariance;
            own_beads_ += part * *view.imager_from_femur.pose.covariance;
        }
        all_.resize(problem_.views.size() + 1);
        std::iota(all_.begin(), all_.end(), std::size_t{0});
    }

    ChainProblem with(const CArmAngles& angles) const {
        const ChainView& reference = problem_.views[options_.reference];
        const Rigid3& old_from_femur = reference.imager_from_femur.pose.target_from_source;
        const auto room = [](const CArmAngles& at) {
            return nominalImagerFromRoom({at.orbital_rad, at.angulation_rad, Vector3::Zero()}, 0).rotationMatrix();
        };
        const Matrix3 rotation = room(angles) * room(options_.reference_angles).transpose();
        const Vector3& target = options_.target.in_femur;
        const Matrix3 new_from_femur = rotation * old_from_femur.rotationMatrix();
        const Rigid3 imager_from_femur(Eigen::Quaterniond(new_from_femur),
                                       old_from_femur * target - new_from_femur * target);
        const Rigid3 imager_from_corkscrew =
            imager_from_femur * old_from_femur.inverse() * reference.imager_from_corkscrew.pose.target_from_source;
        ChainView view;
        if (options_.forecast) {
            view = options_.forecast(imager_from_corkscrew, imager_from_femur);
        } else {
            view.imager_from_corkscrew = fromElsewhere(reference.imager_from_corkscrew, own_corkscrew_, rotation,
                                                       imager_from_corkscrew, problem_);
            view.imager_from_femur =
                fromElsewhere(reference.imager_from_femur, own_beads_, rotation, imager_from_femur, problem_);
        }
        view.name = "next view";
        view.robot_from_flange = reference.robot_from_flange;
        view.imager_from_corkscrew.pose.target_from_source = imager_from_corkscrew;
        view.imager_from_femur.pose.target_from_source = imager_from_femur;
        ChainProblem more = problem_;
        more.views.push_back(std::move(view));
        return more;
    }

    ForecastView forecast(const CArmAngles& angles) const {
        const ChainProblem more = with(angles);
        const chain::System system = chain::buildSystem(more, all_);
        ForecastView view;
        view.angles = angles;
        view.covariance = chain::predictedCovariance(system);
        const auto by_pose = pointByPose(system.answers.front(), options_.target.in_femur);
        view.point_covariance_mm2 = by_pose * view.covariance * by_pose.transpose();
        view.worst_sigma_mm = worstDirection(view.point_covariance_mm2).sigma_mm;
        const auto beam = [&](std::size_t i) {
            return Vector3(more.views[i].imager_from_femur.pose.target_from_source.inverse().rotate(Vector3::UnitZ()));
        };
        view.turn_rad = std::numbers::pi;
        for (std::size_t i = 0; i + 1 < all_.size(); ++i) {
            // From the other side is from the same direction.
            const double cosine = std::abs(beam(i).dot(beam(all_.back())));
            view.turn_rad = std::min(view.turn_rad, std::acos(std::min(cosine, 1.0)));
        }
        return view;
    }

  private:
    ChainProblem problem_;
    const NextViewOptions& options_;
    Matrix6 own_corkscrew_, own_beads_;
    std::vector<std::size_t> all_;
};

}  // namespace

Result<void> NextViewOptions::validate() const {
    if (!(target.in_femur.cwiseAbs().maxCoeff() <= 1e4))
        return invalidOption("target " + target.name, "a coordinate out of range", "at most 10000 mm");
    return requireRanges(
        {{"reference_angles.orbital_rad", reference_angles.orbital_rad, -std::numbers::pi, std::numbers::pi, "rad"},
         {"reference_angles.angulation_rad", reference_angles.angulation_rad, -std::numbers::pi / 2,
          std::numbers::pi / 2, "rad"},
         {"most_orbital_rad", most_orbital_rad, 0, std::numbers::pi, "rad"},
         {"most_angulation_rad", most_angulation_rad, 0, std::numbers::pi / 2, "rad"},
         {"step_rad", step_rad, 0.00436, std::numbers::pi / 2, "rad"}});
}

NextView::NextView()
    : worst_sigma_mm(kNaN), radius95_mm(kNaN), worst_direction(Vector3::Constant(kNaN)), best_radius95_mm(kNaN) {}

Result<NextView> adviseNextView(const ChainProblem& problem, const NextViewOptions& options) {
    if (const Result<void> good = options.validate(); !good) return good.error();
    if (!problem.views.empty() && options.reference >= problem.views.size()) {
        return invalidOption("reference", fmt::format("view {}", options.reference + 1),
                             fmt::format("one of the {} views", problem.views.size()));
    }
    ChainOptions as_it_is;
    as_it_is.points = {options.target};
    as_it_is.least_view_angle_rad = 0;  // advice is wanted most where the views are alike
    const Result<Chain> now = solveChain(problem, as_it_is);
    if (!now) return now.error();

    const Forecaster forecaster(problem, now->robot_from_femur.target_from_source, options);
    NextView result;
    result.worst_sigma_mm = now->points[0].worst_sigma_mm;
    result.radius95_mm = now->points[0].radius95_mm;
    result.worst_direction = now->points[0].worst_direction;
    const int orbitals = static_cast<int>(options.most_orbital_rad / options.step_rad + 1e-6);
    const int angulations = static_cast<int>(options.most_angulation_rad / options.step_rad + 1e-6);
    for (int i = -orbitals; i <= orbitals; ++i) {
        for (int j = -angulations; j <= angulations; ++j)
            result.grid.push_back(forecaster.forecast({i * options.step_rad, j * options.step_rad}));
    }
    double least = std::numeric_limits<double>::infinity();
    const auto differs = [&](const ForecastView& view) { return view.turn_rad >= options.least_turn_rad - 1e-9; };
    for (const ForecastView& view : result.grid)
        if (differs(view)) least = std::min(least, view.worst_sigma_mm);
    const ForecastView* best = nullptr;
    for (const ForecastView& view : result.grid) {
        if (differs(view) && view.worst_sigma_mm <= kNearlyAsGood * least && (!best || view.turn_rad < best->turn_rad))
            best = &view;
    }
    if (!best) {
        return noSolution(
            "next view", "no angles within the C-arm's limits that differ from the views at hand",
            fmt::format("some at least {:.0f} degrees from each", degreesFromRadians(options.least_turn_rad)),
            "allow the C-arm to turn farther");
    }
    result.best = *best;
    result.best_radius95_mm = errorRadius(best->point_covariance_mm2);
    const Result<Chain> then = solveChain(forecaster.with(best->angles), as_it_is);
    if (!then) return then.error();
    result.largest_term = then->terms[then->points[0].largest_first.front()].text();
    if (best->worst_sigma_mm > kHardlyBetter * result.worst_sigma_mm) {
        result.sentence = fmt::format(
            "No further view helps much: the error of the {} in its worst direction, {:.2g} mm (one standard "
            "deviation), "
            "falls by {:.0f} % at best, at orbital {:.0f}, angulation {:.0f} degrees, because {} contributes most.",
            options.target.name, result.worst_sigma_mm, 100 * (1 - best->worst_sigma_mm / result.worst_sigma_mm),
            degreesFromRadians(best->angles.orbital_rad), degreesFromRadians(best->angles.angulation_rad),
            result.largest_term);
        return result;
    }
    result.sentence = fmt::format(
        "Take the next view at orbital {:.0f}, angulation {:.0f} degrees: the error of the {} in its worst direction "
        "falls from {:.2g} to {:.2g} mm (one standard deviation), its 95 % radius from {:.2g} to {:.2g} mm; then {} "
        "contributes most.",
        degreesFromRadians(best->angles.orbital_rad), degreesFromRadians(best->angles.angulation_rad),
        options.target.name, result.worst_sigma_mm, best->worst_sigma_mm, result.radius95_mm, result.best_radius95_mm,
        result.largest_term);
    return result;
}

}  // namespace fluorocut
