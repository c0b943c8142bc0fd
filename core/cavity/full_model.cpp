#include "core/cavity/full_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "core/base/parallel.h"
#include "core/base/stopwatch.h"
#include "core/cavity/fit_covariance.h"
#include "core/cavity/removed_bone.h"
#include "core/cavity/view_model.h"
#include "core/imaging/volume_projector.h"

namespace fluorocut::cavity {
namespace {

constexpr const char* kStep = "cavity location";
constexpr double kMarginMm = 18;                      // of the region around the cavity's shadow, at the cavity
constexpr double kReachMm = 0.5;                      // around the cavity, for the differences by its pose
constexpr double kStaleMm = 0.15, kStaleRad = 0.005;  // farther from where they were taken, derivatives are taken anew
// Chi-square per degree of freedom of 16 seeded trials with the residuals' own correlation counted (place 2.0, rotation
// 2.2, all 2.1): what no residual tells of the model.
constexpr double kUnexplained = 2.1;
constexpr double kWorse = 0.05;  // of the residual's logarithm
constexpr int kSettle = 2;       // iterations in which only the beam is fitted
// Each level's blocks of pixels, and parts of the CT's voxels for the cavity.
struct Level {
    int binning, finer;
};
constexpr int kFinest = 2;
constexpr std::array<Level, 3> kLevels{{{4, 1}, {2, 1}, {1, kFinest}}};
constexpr double kScaleSigma = 0.3;   // of g about 1
constexpr double kRatioSigma = 0.03;  // of h / g about 1
constexpr double kSoftSigma = 1.0;    // px^2, of the blur's variance
constexpr double kEdgeSigma = 0.15;   // mm^2, of the cavity's edge and of the bone: a voxel's blur
// Scatter and glare, as a part of the mean of the rest: how much of it, and how uneven.
constexpr double kPedestalMean = 0.3, kPedestalSlope = 0.15, kPedestalStart = 0.1, kSettledSlope = 0.02;
constexpr double kSlowWeight = 1e-4;  // against a singular system only

Beforehand knownOf(const CavityLocationOptions& options, const Content& content) {
    Beforehand known;
    for (int j = 0; j < 6; ++j)
        known[static_cast<std::size_t>(j)] = {0, options.view_pose.sigma(j)};
    known[kG] = {1, kScaleSigma};
    known[kRatio] = {1, kRatioSigma};
    known[kFill] = {content.mu_per_mm, content.sigma_per_mm};
    known[kSoft] = {options.blur_px * options.blur_px, kSoftSigma};
    known[kEdge] = known[kSharp] = {0, kEdgeSigma};
    for (int j = kPedestal; j < kPoly; ++j)
        known[static_cast<std::size_t>(j)] = {0, kPedestalSlope};
    known[kPedestal] = {kPedestalMean, kPedestalMean};
    for (int j = kPoly; j < kOfView; ++j)
        known[static_cast<std::size_t>(j)] = {0, std::numeric_limits<double>::infinity()};
    return known;
}

Eigen::Index placeOf(std::size_t view) {
    return 6 + kOfView * static_cast<Eigen::Index>(view);
}

// J^T W J and J^T W r of a view, r as the last column.
Eigen::MatrixXd normalOf(const ViewModel& view) {
    // In pieces, side by side. In doubles: what is added to the beam and what multiplies it differ by little.
    constexpr Eigen::Index kPiece = 2048;
    constexpr int kAll = kColumns + 1;
    const std::size_t pieces = static_cast<std::size_t>((view.residual.size() + kPiece - 1) / kPiece);
    std::vector<Eigen::MatrixXd> parts(pieces);
    parallelFor(pieces, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t p = begin; p < end; ++p) {
            const Eigen::Index first = static_cast<Eigen::Index>(p) * kPiece;
            const Eigen::Index count = std::min(kPiece, view.residual.size() - first);
            const Eigen::ArrayXd root = view.weight.segment(first, count).cast<double>().array().sqrt();
            Eigen::MatrixXd both(count, kAll);
            for (int c = 0; c < kColumns; ++c)
                both.col(c) = root * view.jacobian.col(c).segment(first, count).cast<double>().array();
            both.col(kColumns) = root * view.residual.segment(first, count).cast<double>().array();
            parts[p] = Eigen::MatrixXd::Zero(kAll, kAll);
            parts[p].selfadjointView<Eigen::Lower>().rankUpdate(both.transpose());
        }
    });
    Eigen::MatrixXd lower = Eigen::MatrixXd::Zero(kAll, kAll);
    for (const Eigen::MatrixXd& part : parts)
        lower += part;
    return lower.selfadjointView<Eigen::Lower>();
}

class Fit {
  public:
    Fit(const TriangleMesh& mesh, const Rigid3& planned, std::shared_ptr<const Volume> ct,
        const CavityLocationOptions& options, const Content& content)
        : mesh_(mesh),
          planned_(planned),
          pose_(planned),
          options_(options),
          known_(knownOf(options, content)),
          ct_(std::move(ct)) {}

    Result<CavityLocation> run(const std::vector<CavityView>& views, Progress& progress) {
        const Stopwatch watch;
        const AttenuationOptions attenuation{options_.mu_water_per_mm, -1000};
        Result<VolumeProjector> bone = VolumeProjector::prepare(ct_, attenuation);
        if (!bone) return bone.error();
        bone_.emplace(std::move(*bone));
        Result<RemovedBone> removed = RemovedBone::prepare(ct_, mesh_, attenuation, kFinest);
        if (!removed) return removed.error();
        removed_.emplace(std::move(*removed));
        if (const Result<void> ok = begin(views); !ok) return ok.error();

        CavityLocation location;
        for (std::size_t level = 0; level < kLevels.size(); ++level) {
            fresh_level_ = true;
            for (ViewModel& view : views_)
                view.prepare(kLevels[level].binning);
            if (const Result<void> ok = removed_->settle(pose_, kLevels[level].finer); !ok) return ok.error();
            const bool last = level + 1 == kLevels.size();
            const int most = level == 0 ? 12 + kSettle : last ? 30 : 12;
            for (int iteration = 0; iteration < most; ++iteration) {
                if (progress.isCancelled()) return cancelled(kStep);
                progress.report((static_cast<double>(level) + static_cast<double>(iteration) / most) / kLevels.size(),
                                "locating the cavity");
                const bool robust = level > 0 || iteration >= 3;
                const bool settle = level == 0 && iteration < kSettle;
                Result<double> moved = step(robust, settle, iteration == 0 || stale(), kLevels[level].finer);
                if (!moved) return moved.error();
                ++location.iterations;
                location.converged = !settle && *moved < 0.3;
                if (location.converged) break;
            }
        }
        location.femur_from_cavity = {Frame::femur, Frame::cavity, pose_, Matrix6(kUnexplained * covariance())};
        for (const ViewModel& view : views_)
            location.views.push_back(residualOf(view));
        location.elapsed_ms = watch.ms();
        return location;
    }

  private:
    Result<void> begin(const std::vector<CavityView>& views) {
        for (const CavityView& view : views) {
            const Rigid3 imager_from_cavity = view.after_imager_from_femur * planned_;
            const auto region = regionOf(view.carm, mesh_, imager_from_cavity, kMarginMm, kLevels[0].binning);
            if (!region) {
                return invalidInput(
                    fmt::format("view {}", view.name), "a planned cavity whose shadow lies outside the image",
                    "most of the cavity in the picture", "give the pose and the C-arm that belong to this image");
            }
            views_.emplace_back(view, *region, bone_->mainAxis(view.carm, view.after_imager_from_femur),
                                region->px_per_mm * region->px_per_mm, known_);
            views_.back().values[kPedestal] = kPedestalStart;
        }
        return {};
    }

    ViewResidual residualOf(const ViewModel& view) const {
        ViewResidual of{view.given->name, view.usual_noise, view.delta};
        of.pose_sigmas = 0;
        for (int j = 0; j < 6; ++j)
            of.pose_sigmas = std::max(of.pose_sigmas, std::abs(view.delta[j]) / options_.view_pose.sigma(j));
        of.evidence = view.evidence();
        return of;
    }

    // Has the cavity moved so far that the derivatives are no longer its own?
    bool stale() const {
        const Vector6 since = pose_.deltaFrom(fresh_at_);
        return since.head<3>().norm() > kStaleMm || since.tail<3>().norm() > kStaleRad;
    }

    // What was removed at the differences by the cavity's pose.
    Result<void> removeAround(std::array<std::optional<Removed>, 6>& there) const {
        std::array<std::optional<Error>, 6> errors;
        parallelFor(6, 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                Vector6 delta = Vector6::Zero();
                delta[static_cast<Eigen::Index>(i)] = i < 3 ? kStepMm : kStepRad;
                Result<Removed> moved = removed_->at(pose_.perturbed(delta));
                if (moved)
                    there[i].emplace(std::move(*moved));
                else
                    errors[i] = moved.error();
            }
        });
        for (const auto& error : errors)
            if (error) return *error;
        return {};
    }

    // One Gauss-Newton step; how far it went in units of what the fit knows (the largest part). `fresh`: with new
    // derivatives; otherwise those of an earlier step are good enough.
    Result<double> step(bool robust, bool settle, bool fresh, int finer) {
        if (!removed_->settledFor(pose_, kReachMm)) {
            if (const Result<void> ok = removed_->settle(pose_, finer); !ok) return ok.error();
            fresh = true;
        }
        const Result<Removed> here = removed_->at(pose_);
        if (!here) return here.error();
        std::array<std::optional<Removed>, 6> there;
        if (fresh) {
            if (const Result<void> ok = removeAround(there); !ok) return ok.error();
            fresh_at_ = pose_;
        }
        for (ViewModel& view : views_) {
            view.look(*bone_, *here, fresh, there);
            view.weigh(robust, settle);
        }
        // A step after which the images fit much worse went beyond what its derivatives know: a part of it, again.
        double misfit = 0, pixels = 0;
        for (const ViewModel& view : views_) {
            const auto count = static_cast<double>(view.residual.size());
            misfit += count * std::log(view.usual_noise);
            pixels += count;
        }
        misfit /= pixels;
        if (!fresh_level_ && misfit > misfit_ + kWorse && backtracks_ < 3) {
            ++backtracks_;
            restore(std::pow(0.4, backtracks_));
            return std::numeric_limits<double>::infinity();
        }
        fresh_level_ = false;
        backtracks_ = 0;
        misfit_ = misfit;
        return solve(settle);
    }

    Result<double> solve(bool settle) {
        const auto n = placeOf(views_.size());
        Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
        Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
        for (std::size_t v = 0; v < views_.size(); ++v)
            accumulate(views_[v], placeOf(v), settle, 1, normal, right);
        if (settle) {
            normal.topLeftCorner<6, 6>().diagonal().array() += 1e12;
            for (std::size_t v = 0; v < views_.size(); ++v)
                normal.diagonal().segment<8>(placeOf(v)).array() += 1e12;  // pose, g, ratio
        }
        const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
        change_ = solver.solve(right);
        if (!change_.allFinite()) {
            return noSolution(kStep, "equations without a solution", "images that tell where the cavity is",
                              "see that poses, cavity and images belong together");
        }
        const Vector6 move = change_.head<6>();
        // Not farther at once than the linear model holds.
        const double far = std::max(move.head<3>().norm() / 1.5, move.tail<3>().norm() / 0.04);
        before_.clear();
        for (const ViewModel& view : views_)
            before_.push_back({view.delta, view.values});
        pose_before_ = pose_;
        restore(far > 1 ? 1 / far : 1);
        const Eigen::MatrixXd inverse = solver.solve(Eigen::MatrixXd::Identity(n, 6));
        double moved = 0;
        for (int i = 0; i < 6; ++i)
            moved = std::max(moved, std::abs(move[i]) / std::sqrt(std::max(inverse(i, i), 1e-12)));
        return moved;
    }

    // From where the last step began, this part of it.
    void restore(double part) {
        pose_ = pose_before_.perturbed(part * change_.head<6>());
        for (std::size_t v = 0; v < views_.size(); ++v)
            views_[v].move(before_[v].delta, before_[v].values, change_.segment<kOfView>(placeOf(v)), part);
    }

    // A view's equations, its images' part `share` times, and what is known beforehand.
    void accumulate(const ViewModel& view, Eigen::Index at, bool settle, double share, Eigen::MatrixXd& normal,
                    Eigen::VectorXd& right) const {
        const Eigen::MatrixXd sum = share * normalOf(view);
        const auto own = sum.topLeftCorner<kColumns, kColumns>();
        const auto pull = sum.col(kColumns).head<kColumns>();
        normal.topLeftCorner<6, 6>() += own.topLeftCorner<6, 6>();
        normal.block(0, at, 6, kOfView) += own.block(0, 6, 6, kOfView);
        normal.block(at, 0, kOfView, 6) += own.block(6, 0, kOfView, 6);
        normal.block(at, at, kOfView, kOfView) += own.block(6, 6, kOfView, kOfView);
        right.head<6>() += pull.head<6>();
        right.segment(at, kOfView) += pull.tail(kOfView);
        for (int j = 0; j < kOfView; ++j) {
            const Known& known = known_[static_cast<std::size_t>(j)];
            if (!std::isfinite(known.sigma)) {
                normal(at + j, at + j) += kSlowWeight;
                continue;
            }
            const double sigma = settle && j > kPedestal && j < kPoly ? kSettledSlope : known.sigma;
            const double value = j < 6 ? view.delta[j] : view.values[j];
            normal(at + j, at + j) += 1 / (sigma * sigma);
            right[at + j] -= (value - known.value) / (sigma * sigma);
        }
    }

    // Of the cavity's pose. Two things make it larger than the inverse of the equations: residuals are correlated
    // (fit_covariance.h), and a robust fit gives way less than its weights say (Huber 1981: psi' instead of psi / r).
    // What was known beforehand counts as it was given.
    Matrix6 covariance() const {
        const auto n = placeOf(views_.size());
        Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
        Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
        std::vector<Eigen::VectorXf> rests;
        for (std::size_t v = 0; v < views_.size(); ++v) {
            const ViewModel& view = views_[v];
            rests.push_back(((view.residual - view.jacobian.leftCols<6>() * change_.head<6>().cast<float>() -
                              view.jacobian.rightCols<kOfView>() * change_.segment<kOfView>(placeOf(v)).cast<float>())
                                 .array() /
                             view.noise.array())
                                .matrix());
            const Eigen::ArrayXf square = (rests[v].array() / 3).square();
            const double gives = ((1 - square) / (1 + square).square()).cast<double>().mean(),
                         weighs = (1 / (1 + square)).cast<double>().mean();
            accumulate(view, placeOf(v), false, std::max(0.1, gives / weighs), normal, right);
        }
        const Eigen::MatrixXd inverse =
            normal.ldlt().solve(Eigen::MatrixXd::Identity(n, 6)).transpose();  // 6 x n, symmetric
        Matrix6 sum = Matrix6::Zero();
        for (std::size_t v = 0; v < views_.size(); ++v) {
            const ViewModel& view = views_[v];
            Eigen::MatrixXf by(6, kColumns);
            by << inverse.leftCols<6>().cast<float>(), inverse.middleCols<kOfView>(placeOf(v)).cast<float>();
            const Eigen::MatrixXf influence =
                view.noise.cwiseInverse().asDiagonal() * (view.jacobian * by.transpose()).eval();
            const Eigen::VectorXf pulls = rests[v].array() / (1 + (rests[v].array() / 3).square());
            sum += correlatedCovariance(influence, pulls, view.carm.columns, view.carm.rows);
            for (int j = 0; j < kOfView; ++j) {
                const double sigma = known_[static_cast<std::size_t>(j)].sigma;
                const Vector6 by_known = inverse.col(placeOf(v) + j);
                if (std::isfinite(sigma)) sum += by_known * by_known.transpose() / (sigma * sigma);
            }
        }
        return sum;
    }

    const TriangleMesh& mesh_;
    Rigid3 planned_, pose_;
    const CavityLocationOptions& options_;
    Beforehand known_;
    std::shared_ptr<const Volume> ct_;
    std::optional<VolumeProjector> bone_;
    std::optional<RemovedBone> removed_;
    std::vector<ViewModel> views_;
    struct Before {
        Vector6 delta;
        Eigen::Matrix<double, kOfView, 1> values;
    };
    std::vector<Before> before_;  // the last step, and where it began
    Rigid3 pose_before_;
    double misfit_ = 0;
    bool fresh_level_ = true;
    int backtracks_ = 0;
    Rigid3 fresh_at_;  // where the derivatives were taken
    Eigen::VectorXd change_;
};

}  // namespace

Result<CavityLocation> locateByFullModel(const std::vector<CavityView>& views, const TriangleMesh& mesh,
                                         const Rigid3& planned_femur_from_cavity, std::shared_ptr<const Volume> ct,
                                         const CavityLocationOptions& options, Progress& progress,
                                         const Content& content) {
    return Fit(mesh, planned_femur_from_cavity, std::move(ct), options, content).run(views, progress);
}

}  // namespace fluorocut::cavity
