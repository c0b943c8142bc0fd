#include "core/experiments/corkscrew_experiment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "core/base/chi_square.h"
#include "core/base/median.h"
#include "core/base/option_checks.h"
#include "core/base/random.h"

namespace fluorocut {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kGrossDeg = 1, kGrossMm = 2;
constexpr std::uint64_t kTracking = 0x7261636b;  // its random stream

Vector3 inBall(double radius, Random& random) {
    Vector3 point;
    do {
        point = {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
    } while (point.squaredNorm() > 1);
    return radius * point;
}

double shortWay(double angle_rad) {
    return std::remainder(angle_rad, 2 * std::numbers::pi);
}

double percentile95(std::vector<double> values) {
    return figuresOf(std::move(values)).percentile_95;
}

// d^T C^-1 d; infinite when C is no covariance.
template <int N>
double chiSquare(const Eigen::Matrix<double, N, 1>& d, const Eigen::Matrix<double, N, N>& covariance) {
    const Eigen::LLT<Eigen::Matrix<double, N, N>> factor(covariance);
    if (factor.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
    return factor.matrixL().solve(d).squaredNorm();
}

bool isGross(const Rigid3& found, const Rigid3& truth) {
    const double angle_deg = degreesFromRadians((found.inverse() * truth).rotationAngle());
    return !(angle_deg <= kGrossDeg && (found.translation() - truth.translation()).norm() <= kGrossMm);
}

struct Coverage {
    int pose = 0, place = 0, rotation = 0;
};

void score(CorkscrewTrial& trial, const CorkscrewPose& pose, const CorkscrewScene& scene, Coverage& coverage) {
    const Rigid3& found = pose.imager_from_corkscrew.target_from_source;
    const Rigid3& truth = scene.imager_from_corkscrew;
    trial.answered = true;
    trial.accepted = accepted(pose.acceptance);
    trial.gross = isGross(found, truth);
    const Vector3 angles = found.twistRollPitch() - truth.twistRollPitch();
    for (int i = 0; i < 3; ++i)
        trial.angles_deg[i] = degreesFromRadians(shortWay(angles[i]));
    trial.place_mm = found.translation() - truth.translation();
    trial.rotation_deg = degreesFromRadians((found.inverse() * truth).rotationAngle());
    if (!trial.accepted) {
        for (const Judgement& judgement : pose.acceptance)
            if (!judgement.accepted()) trial.refusal += (trial.refusal.empty() ? "" : "; ") + judgement.sentence();
        return;
    }
    if (!pose.imager_from_corkscrew.covariance) return;
    const Matrix6& covariance = *pose.imager_from_corkscrew.covariance;
    const Vector6 d = truth.deltaFrom(found);
    trial.chi_square = chiSquare<6>(d, covariance);
    const double place = chiSquare<3>(d.head<3>(), covariance.topLeftCorner<3, 3>());
    const double rotation = chiSquare<3>(d.tail<3>(), covariance.bottomRightCorner<3, 3>());
    coverage.pose += trial.chi_square <= chiSquareQuantile(0.05, 6) ? 1 : 0;
    coverage.place += place <= chiSquareQuantile(0.05, 3) ? 1 : 0;
    coverage.rotation += rotation <= chiSquareQuantile(0.05, 3) ? 1 : 0;
}

}  // namespace

CorkscrewEstimator corkscrewEstimator() {
    return
        [](const Image& image, const CArm& carm, const CorkscrewLayout& layout, const CorkscrewPoseOptions& options) {
            return estimateCorkscrewPose(image, carm, layout, options, Progress::none());
        };
}

CorkscrewTrial::CorkscrewTrial()
    : angles_deg(Vector3::Constant(kNaN)),
      place_mm(Vector3::Constant(kNaN)),
      rotation_deg(kNaN),
      elapsed_ms(kNaN),
      chi_square(kNaN) {}

CorkscrewAccuracy::CorkscrewAccuracy()
    : pose_covered(kNaN),
      place_covered(kNaN),
      rotation_covered(kNaN),
      median_ms(kNaN),
      percentile_95_ms(kNaN),
      tracking_median_ms(kNaN),
      tracking_percentile_95_ms(kNaN),
      map_error_mm(kNaN) {}

Result<void> CorkscrewAccuracyOptions::validate() const {
    if (const Result<void> good = scenes.validate(); !good) return good;
    if (const Result<void> good = pose.validate(); !good) return good;
    return requireRanges({{"trials", static_cast<double>(trials), 1, 100000, ""},
                          {"tracked_turn_rad", tracked_turn_rad, 0, 0.5, "rad"},
                          {"tracked_way_mm", tracked_way_mm, 0, 100, "mm"}});
}

Result<CorkscrewAccuracy> measureCorkscrewAccuracy(const CorkscrewAccuracyOptions& options, Progress& progress,
                                                   const CorkscrewEstimator& estimate) {
    if (const Result<void> good = options.validate(); !good) return good.error();
    SubProgress preparing(progress, 0, 0.1);
    const Result<CorkscrewScenes> scenes = CorkscrewScenes::prepare(options.scenes, preparing);
    if (!scenes) return scenes.error();

    CorkscrewAccuracy result;
    Coverage coverage;
    std::array<std::vector<double>, 6> errors;
    std::vector<double> times, tracking_times;
    const bool tracks = options.tracked_turn_rad > 0 || options.tracked_way_mm > 0;
    double map_errors = 0;
    for (int n = 0; n < options.trials; ++n) {
        if (progress.isCancelled()) return cancelled("corkscrew accuracy");
        progress.report(0.1 + 0.9 * n / options.trials, fmt::format("corkscrew {} of {}", n + 1, options.trials));
        const auto index = static_cast<std::uint64_t>(n);
        const Result<CorkscrewScene> scene = scenes->scene(index);
        if (!scene) return scene.error();
        map_errors += scene->map_error_mm;
        CorkscrewTrial trial;
        trial.index = index;
        trial.visible = scene->visible;
        trial.covered = scene->covered;
        trial.objects = scene->objects;
        const Result<CorkscrewPose> pose = estimate(scene->image, scene->carm, scene->layout, options.pose);
        if (!pose) {
            if (pose.error().code != ErrorCode::noSolution) return pose.error();
            trial.refusal = pose.error().message();
            result.trials.push_back(std::move(trial));
            continue;
        }
        score(trial, *pose, *scene, coverage);
        trial.elapsed_ms = pose->elapsed_ms;
        times.push_back(pose->elapsed_ms);
        ++result.answered;
        if (!trial.accepted && trial.gross) ++result.gross_refused;
        if (trial.accepted) {
            ++result.accepted;
            if (trial.gross) ++result.gross_accepted;
            for (std::size_t i = 0; i < 3; ++i) {
                errors[i].push_back(std::abs(trial.angles_deg[static_cast<int>(i)]));
                errors[i + 3].push_back(std::abs(trial.place_mm[static_cast<int>(i)]));
            }
        }
        const bool good = trial.accepted && !trial.gross;
        result.trials.push_back(std::move(trial));
        if (!tracks || !good) continue;

        Random random = Random(options.scenes.seed).fork(kTracking).fork(index);
        const Rigid3 moved = Rigid3::fromTranslation(inBall(options.tracked_way_mm, random)) *
                             scene->imager_from_corkscrew *
                             Rigid3::fromRotationVector(inBall(options.tracked_turn_rad, random));
        const Result<CorkscrewScene> next = scenes->sceneWith(index, moved);
        if (!next) return next.error();
        CorkscrewPoseOptions tracking = options.pose;
        tracking.initial = pose->imager_from_corkscrew.target_from_source;
        const Result<CorkscrewPose> tracked = estimate(next->image, next->carm, next->layout, tracking);
        if (!tracked && tracked.error().code != ErrorCode::noSolution) return tracked.error();
        ++result.tracking_tried;
        if (!tracked || !tracked->tracked || !accepted(tracked->acceptance)) continue;
        ++result.tracked;
        if (isGross(tracked->imager_from_corkscrew.target_from_source, moved)) ++result.tracked_gross;
        tracking_times.push_back(tracked->elapsed_ms);
    }
    result.twist_deg = figuresOf(errors[0]);
    result.roll_deg = figuresOf(errors[1]);
    result.pitch_deg = figuresOf(errors[2]);
    result.x_mm = figuresOf(errors[3]);
    result.y_mm = figuresOf(errors[4]);
    result.depth_mm = figuresOf(errors[5]);
    if (result.accepted > 0) {
        result.pose_covered = static_cast<double>(coverage.pose) / result.accepted;
        result.place_covered = static_cast<double>(coverage.place) / result.accepted;
        result.rotation_covered = static_cast<double>(coverage.rotation) / result.accepted;
    }
    result.median_ms = median(times);
    result.percentile_95_ms = percentile95(times);
    result.tracking_median_ms = median(tracking_times);
    result.tracking_percentile_95_ms = percentile95(tracking_times);
    result.map_error_mm = map_errors / options.trials;
    return result;
}

}  // namespace fluorocut
