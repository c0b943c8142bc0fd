#include "core/cavity/without_ct.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/parallel.h"
#include "core/base/stopwatch.h"
#include "core/cavity/paper_method.h"
#include "core/cavity/seen_outline.h"
#include "core/image/blur.h"
#include "core/image/voxelize.h"
#include "core/imaging/volume_projector.h"

namespace fluorocut::cavity {
namespace {

constexpr const char* kStep = "cavity location without a CT";
constexpr double kMarginMm = 22;  // as far as the bone's outer contour
constexpr std::array<int, 2> kBinning{4, 2};
constexpr int kMostSteps = 12, kSettle = 3;
constexpr double kVoxelMm = 0.8;  // of the cavity as something to project
constexpr double kLengthMm = 10;  // unit of ways through it
constexpr int kSmooth = 10;       // polynomials of total degree 3, for displacements and density
// Unknowns of a view: pose (6), displacement in x and y, slow, contrast of the image before, density, density in
// proportion to the bone before, softness.
constexpr int kShift = 6, kSlowAt = kShift + 2 * kSmooth, kContrast = kSlowAt + kSlow, kDensity = kContrast + 1,
              kBone = kDensity + kSmooth, kSoft = kBone + 1, kOfView = kSoft + 1;
constexpr double kShiftSigmaPx = 2, kDensitySigma = 0.5, kSoftSigma = 0.5;
constexpr int kBlockX = 16, kBlockY = 80;  // of pixels whose residuals are alike; structure runs along the bone
// Structure is alike over more than a block: on Table 3's five trials chi-square came to 1.8 of its degrees of freedom
// in the mean and to 3.6 at worst. The blocks' variance is taken this many times.
constexpr double kBeyondBlocks = 3;
constexpr double kAlike = 40;                   // pixels that count as one
constexpr double kMostMm = 1, kMostRad = 0.03;  // of one step
constexpr double kSettledMm = 0.005, kSettledRad = 1e-4;

using Values = Eigen::Matrix<double, kOfView, 1>;

struct View {
    const CavityView* given = nullptr;
    CArm ideal;
    Region region;
    Image before, after;  // logarithms, whole images, ideal pixels
    PlaneSimilarity align;
    Mask mask;  // of the region: where the cavity may be

    // At one level.
    int binning = 1;
    CArm carm;
    Image log_after, log_before;
    Mask mask_here;
    Eigen::MatrixXf slow, smooth;
    Values values = Values::Zero();
    Eigen::VectorXf residual, weight, steep;
    Eigen::MatrixXf jacobian;  // pixels x (6 + kOfView)
    double noise = 0, removed = 0;

    Rigid3 pose() const { return given->after_imager_from_femur.perturbed(values.head<6>()); }
};

Eigen::MatrixXf smoothBasis(const Eigen::MatrixXf& slow) {
    // Of the products that slowBasis lists (x's degree i, y's degree j, i + j <= kDegree) those of total degree 3.
    Eigen::MatrixXf basis(slow.rows(), kSmooth);
    int from = 0, to = 0;
    for (int i = 0; i <= kDegree; ++i)
        for (int j = 0; i + j <= kDegree; ++j, ++from)
            if (i + j <= 3) basis.col(to++) = slow.col(from);
    return basis;
}

Result<VolumeProjector> wayThrough(const TriangleMesh& mesh) {
    Vector3 low = Vector3::Constant(1e9), high = -low;
    for (const Vector3& vertex : mesh.vertices) {
        low = low.cwiseMin(vertex);
        high = high.cwiseMax(vertex);
    }
    VolumeGrid grid;
    grid.spacing_mm = Vector3::Constant(kVoxelMm);
    grid.origin_mm = low - 2 * grid.spacing_mm;
    for (int axis = 0; axis < 3; ++axis)
        grid.size[static_cast<std::size_t>(axis)] =
            static_cast<int>(std::ceil((high[axis] - low[axis]) / kVoxelMm)) + 5;
    const Result<VoxelCoverage> coverage = voxelize(mesh, Rigid3::identity(), grid, "cavity");
    if (!coverage) return coverage.error();
    auto volume = std::make_shared<Volume>(coverage->fraction);
    constexpr double kMu = 0.02;
    for (float& value : volume->voxels())
        value = static_cast<float>(value * 1000 / (kMu * kLengthMm)) - 1000;
    return VolumeProjector::prepare(volume, {kMu, -1000});
}

class Fit {
  public:
    Fit(VolumeProjector way, const Rigid3& start, const CavityLocationOptions& options)
        : way_(std::move(way)), pose_(start), options_(options) {}

    Result<CavityLocation> run(std::vector<View> views, Progress& progress) {
        views_ = std::move(views);
        CavityLocation location;
        for (std::size_t level = 0; level < kBinning.size(); ++level) {
            for (View& view : views_)
                prepare(view, kBinning[level]);
            location.converged = false;
            for (int step = 0; step < kMostSteps + kSettle && !location.converged; ++step) {
                if (progress.isCancelled()) return cancelled(kStep);
                progress.report(
                    (static_cast<double>(level) + static_cast<double>(step) / (kMostSteps + kSettle)) / kBinning.size(),
                    "locating the cavity");
                const bool settle = level == 0 && step < kSettle;
                const std::optional<Vector6> moved = improve(settle, level > 0 || step > kSettle);
                if (!moved) {
                    return noSolution(kStep, "equations without a solution", "images that tell where the cavity is",
                                      "see that poses, cavity and images belong together");
                }
                ++location.iterations;
                location.converged =
                    !settle && moved->head<3>().norm() < kSettledMm && moved->tail<3>().norm() < kSettledRad;
            }
        }
        location.femur_from_cavity = {Frame::femur, Frame::cavity, pose_, covariance()};
        for (const View& view : views_) {
            ViewResidual of{view.given->name, view.noise, view.values.head<6>()};
            of.pose_sigmas = 0;
            for (int j = 0; j < 6; ++j)
                of.pose_sigmas = std::max(of.pose_sigmas, std::abs(view.values[j]) / options_.view_pose.sigma(j));
            // What is gone is at least as dense as the fluid that may have come instead of it.
            of.evidence = std::min(1.0, view.removed / options_.mu_water_per_mm);
            location.views.push_back(of);
        }
        return location;
    }

  private:
    void prepare(View& view, int binning) const {
        view.binning = binning;
        const Region& r = view.region;
        view.carm = view.ideal.cropped(r.x, r.y, r.width, r.height).binned(binning);
        view.log_after = Image(view.carm.columns, view.carm.rows);
        view.mask_here = Mask(view.carm.columns, view.carm.rows);
        const auto mean = [&](const Image& image, int x0, int y0) {
            float sum = 0;
            for (int j = 0; j < binning; ++j)
                for (int i = 0; i < binning; ++i)
                    sum += image(x0 + i, y0 + j);
            return sum / static_cast<float>(binning * binning);
        };
        for (int y = 0; y < view.carm.rows; ++y) {
            for (int x = 0; x < view.carm.columns; ++x) {
                view.log_after(x, y) = mean(view.after, r.x + x * binning, r.y + y * binning);
                view.mask_here(x, y) = view.mask(x * binning, y * binning);
            }
        }
        view.log_before = Image(view.before.width() / binning, view.before.height() / binning);
        for (int y = 0; y < view.log_before.height(); ++y)
            for (int x = 0; x < view.log_before.width(); ++x)
                view.log_before(x, y) = mean(view.before, x * binning, y * binning);
        view.slow = slowBasis(view.carm.columns, view.carm.rows);
        view.smooth = smoothBasis(view.slow);
    }

    // Residual and derivatives at the present values.
    void look(View& view, bool robust) const {
        const int width = view.carm.columns, height = view.carm.rows;
        const auto n = static_cast<Eigen::Index>(width) * height;
        const double b = view.binning, half = (b - 1) / 2;
        view.residual.resize(n);
        view.steep.resize(n);
        view.jacobian.resize(n, 6 + kOfView);
        ProjectionOptions axis;
        axis.main_axis = way_.mainAxis(view.carm, view.pose() * pose_);
        const double blur = std::sqrt(options_.blur_px * options_.blur_px + (b * b - 1) / 12) / b;
        ProjectionWithGradient way = way_.projectWithGradient(view.carm, view.pose() * pose_, axis);
        way.image = gaussianBlurred(way.image, blur);
        parallelFor(6, 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t j = begin; j < end; ++j)
                way.gradient[j] = gaussianBlurred(way.gradient[j], blur);
        });
        const Image soft = halfLaplacian(way.image);
        const Eigen::VectorXf shift_x = view.smooth * view.values.segment<kSmooth>(kShift).cast<float>(),
                              shift_y = view.smooth * view.values.segment<kSmooth>(kShift + kSmooth).cast<float>(),
                              slow = view.slow * view.values.segment<kSlow>(kSlowAt).cast<float>(),
                              dense = view.smooth * view.values.segment<kSmooth>(kDensity).cast<float>();
        // The image before, where it comes to lie; its mean taken off.
        Image before(width, height);
        std::vector<Vector2> slope(static_cast<std::size_t>(n));
        parallelFor(static_cast<std::size_t>(height), 8, [&](std::size_t begin, std::size_t end) {
            for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
                for (int x = 0; x < width; ++x) {
                    const Eigen::Index i = static_cast<Eigen::Index>(y) * width + x;
                    const Vector2 whole(view.region.x + b * x + half, view.region.y + b * y + half);
                    const Vector2 seen =
                        ((view.align * whole) + Vector2(shift_x[i], shift_y[i]) - Vector2(half, half)) / b;
                    before(x, y) = cubicAt(view.log_before, seen);
                    // By the shift, in pixels of the whole image.
                    const auto at = [&](double dx, double dy) {
                        return cubicAt(view.log_before, seen + Vector2(dx, dy));
                    };
                    slope[static_cast<std::size_t>(i)] =
                        Vector2(at(0.5, 0) - at(-0.5, 0), at(0, 0.5) - at(0, -0.5)) / b;
                }
            }
        });
        double sum = 0;
        for (const float pixel : before.pixels())
            sum += pixel;
        const auto usual = static_cast<float>(sum / static_cast<double>(n));
        const Matrix3 imager_from_femur = view.pose().rotationMatrix();
        const Matrix3 lever = skew(imager_from_femur * pose_.translation());
        const auto contrast = static_cast<float>(view.values[kContrast]), bone = static_cast<float>(view.values[kBone]),
                   softness = static_cast<float>(view.values[kSoft]);
        parallelFor(static_cast<std::size_t>(n), 4096, [&](std::size_t begin, std::size_t end) {
            for (std::size_t p = begin; p < end; ++p) {
                const auto i = static_cast<Eigen::Index>(p);
                const float darker = usual - before.pixels()[p];  // more bone
                const float density = dense[i] + bone * darker, length = way.image.pixels()[p];
                view.residual[i] = view.log_after.pixels()[p] - before.pixels()[p] + contrast * darker - slow[i] -
                                   density * length - softness * soft.pixels()[p];
                auto row = view.jacobian.row(i);
                Eigen::Matrix<float, 6, 1> by_imager;
                for (int j = 0; j < 6; ++j)
                    by_imager[j] = density * way.gradient[static_cast<std::size_t>(j)].pixels()[p];
                // imager_from_cavity by the cavity's pose, and by the view's.
                const Vector3 by_place = by_imager.head<3>().cast<double>(),
                              by_turn = by_imager.tail<3>().cast<double>();
                row.segment<3>(0) = (by_place.transpose() * imager_from_femur).cast<float>();
                row.segment<3>(3) = (by_turn.transpose() * imager_from_femur).cast<float>();
                row.segment<3>(6) = by_place.transpose().cast<float>();
                row.segment<3>(9) = (by_turn.transpose() - by_place.transpose() * lever).cast<float>();
                const Vector2& s = slope[p];
                view.steep[i] = static_cast<float>(s.norm());
                const auto scale = 1 + contrast;
                row.segment<kSmooth>(6 + kShift) = scale * static_cast<float>(s.x()) * view.smooth.row(i);
                row.segment<kSmooth>(6 + kShift + kSmooth) = scale * static_cast<float>(s.y()) * view.smooth.row(i);
                row.segment<kSlow>(6 + kSlowAt) = view.slow.row(i);
                row[6 + kContrast] = -darker;
                row.segment<kSmooth>(6 + kDensity) = length * view.smooth.row(i);
                row[6 + kBone] = darker * length;
                row[6 + kSoft] = soft.pixels()[p];
            }
        });
        double gone = 0, ways = 0;
        for (std::size_t p = 0; p < way.image.size(); ++p) {
            const auto i = static_cast<Eigen::Index>(p);
            const float length = way.image.pixels()[p];
            gone += length * (dense[i] + bone * (usual - before.pixels()[p]));
            ways += length;
        }
        view.removed = ways > 0 ? gone / ways / kLengthMm : 0;
        weigh(view, robust);
    }

    // Variance of a pixel: of noise, and of structure where the image before is steep; from what lies away from the
    // cavity.
    static void weigh(View& view, bool robust) {
        std::vector<float> steepness, flat;
        const auto n = static_cast<std::size_t>(view.residual.size());
        for (std::size_t p = 0; p < n; ++p)
            if (!view.mask_here.pixels()[p]) steepness.push_back(view.steep[static_cast<Eigen::Index>(p)]);
        const float usual = steepness.empty() ? 0 : median(steepness);
        for (std::size_t p = 0; p < n; ++p) {
            const auto i = static_cast<Eigen::Index>(p);
            if (!view.mask_here.pixels()[p] && view.steep[i] <= usual) flat.push_back(std::abs(view.residual[i]));
        }
        const double sigma = std::max(1e-4, 1.4826 * static_cast<double>(flat.empty() ? 0.01f : median(flat)));
        std::vector<float> shifts;  // px, by which structure would have to move
        for (std::size_t p = 0; p < n; ++p) {
            const auto i = static_cast<Eigen::Index>(p);
            if (!view.mask_here.pixels()[p] && view.steep[i] > 2 * usual)
                shifts.push_back(std::abs(view.residual[i]) / view.steep[i]);
        }
        const double tau = shifts.size() < 50 ? 0 : 1.4826 * static_cast<double>(median(shifts));
        view.noise = sigma;
        view.weight.resize(view.residual.size());
        for (Eigen::Index i = 0; i < view.residual.size(); ++i) {
            const double variance = sigma * sigma + std::pow(tau * view.steep[i], 2);
            double weight = 1 / variance;
            if (robust) weight /= 1 + view.residual[i] * view.residual[i] / (9 * variance);
            view.weight[i] = static_cast<float>(weight / kAlike);
        }
    }

    // What is known beforehand of a view's unknowns: standard deviations about zero; 0: nothing.
    double sigmaOf(int j, const View& view) const {
        if (j < 6) return options_.view_pose.sigma(j);
        if (j < kSlowAt) return kShiftSigmaPx;
        if (j < kDensity) return 1;
        if (j < kSoft) return kDensitySigma;
        return kSoftSigma / (view.binning * view.binning);
    }

    std::optional<Vector6> improve(bool settle, bool robust) {
        const auto n = static_cast<Eigen::Index>(6 + kOfView * views_.size());
        Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
        Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
        for (std::size_t v = 0; v < views_.size(); ++v) {
            View& view = views_[v];
            look(view, robust);
            const Eigen::Index at = 6 + kOfView * static_cast<Eigen::Index>(v);
            const Eigen::MatrixXf weighed = view.weight.asDiagonal() * view.jacobian;
            const Eigen::MatrixXd own = (view.jacobian.transpose() * weighed).cast<double>();
            const Eigen::VectorXd pull = (weighed.transpose() * view.residual).cast<double>();
            add(normal, own, at);
            right.head<6>() += pull.head<6>();
            right.segment(at, kOfView) += pull.tail(kOfView);
            for (int j = 0; j < kOfView; ++j) {
                const double weight = std::pow(sigmaOf(j, view), -2);
                normal(at + j, at + j) += weight;
                right[at + j] -= weight * view.values[j];
            }
        }
        if (settle) {
            normal.diagonal().head<6>().array() += 1e12;
            for (std::size_t v = 0; v < views_.size(); ++v)
                normal.diagonal().segment<6>(6 + kOfView * static_cast<Eigen::Index>(v)).array() += 1e12;
        } else {
            normal.diagonal().head<6>().array() += 1e-6;
        }
        const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
        const Eigen::VectorXd change = solver.solve(right);
        if (!change.allFinite()) return std::nullopt;
        const Vector6 move = change.head<6>();
        const double far = std::max({1.0, move.head<3>().norm() / kMostMm, move.tail<3>().norm() / kMostRad});
        pose_ = pose_.perturbed(move / far);
        for (std::size_t v = 0; v < views_.size(); ++v)
            views_[v].values += change.segment<kOfView>(6 + kOfView * static_cast<Eigen::Index>(v)) / far;
        inverse_ = solver.solve(Eigen::MatrixXd::Identity(n, n));
        return Vector6(move / far);
    }

    static void add(Eigen::MatrixXd& sum, const Eigen::MatrixXd& own, Eigen::Index at) {
        sum.topLeftCorner<6, 6>() += own.topLeftCorner<6, 6>();
        sum.block(0, at, 6, kOfView) += own.block(0, 6, 6, kOfView);
        sum.block(at, 0, kOfView, 6) += own.block(6, 0, kOfView, 6);
        sum.block(at, at, kOfView, kOfView) += own.block(6, 6, kOfView, kOfView);
    }

    // The score's variance from blocks of pixels (Huber 1967; Liang and Zeger 1986), and of what was known beforehand.
    Matrix6 covariance() const {
        const auto n = static_cast<Eigen::Index>(6 + kOfView * views_.size());
        Eigen::MatrixXd meat = Eigen::MatrixXd::Zero(n, n);
        for (std::size_t v = 0; v < views_.size(); ++v) {
            const View& view = views_[v];
            const Eigen::Index at = 6 + kOfView * static_cast<Eigen::Index>(v);
            const int width = view.carm.columns, height = view.carm.rows;
            const Eigen::VectorXf rest = view.weight.array() * view.residual.array();
            Eigen::MatrixXd own = Eigen::MatrixXd::Zero(6 + kOfView, 6 + kOfView);
            for (int y0 = 0; y0 < height; y0 += kBlockY) {
                for (int x0 = 0; x0 < width; x0 += kBlockX) {
                    Eigen::VectorXf score = Eigen::VectorXf::Zero(6 + kOfView);
                    const Eigen::Index count = std::min(kBlockX, width - x0);
                    for (int y = y0; y < std::min(y0 + kBlockY, height); ++y) {
                        const Eigen::Index first = static_cast<Eigen::Index>(y) * width + x0;
                        score += view.jacobian.middleRows(first, count).transpose() * rest.segment(first, count);
                    }
                    own += (score * score.transpose()).cast<double>();
                }
            }
            add(meat, kBeyondBlocks * own, at);
            for (int j = 0; j < kOfView; ++j)
                meat(at + j, at + j) += std::pow(sigmaOf(j, view), -2);
        }
        const Matrix6 all = (inverse_ * meat * inverse_).topLeftCorner<6, 6>();
        return (all + all.transpose()) / 2;
    }

    VolumeProjector way_;
    Rigid3 pose_;
    const CavityLocationOptions& options_;
    std::vector<View> views_;
    Eigen::MatrixXd inverse_;
};

}  // namespace

Result<CavityLocation> locateWithoutCt(const std::vector<CavityView>& given, const TriangleMesh& mesh,
                                       const Rigid3& planned, const CavityLocationOptions& options,
                                       Progress& progress) {
    const Stopwatch stopwatch;
    Result<Silhouette> silhouette = Silhouette::prepare(mesh, "cavity");
    if (!silhouette) return silhouette.error();
    std::vector<View> views;
    for (const CavityView& view : given) {
        Result<AlignedView> aligned = alignView(view, mesh, *silhouette, planned, kMarginMm, kBinning[0]);
        if (!aligned) return aligned.error();
        View one;
        one.given = &view;
        one.ideal = view.carm.ideal();
        one.region = aligned->region;
        one.mask = std::move(aligned->mask);
        one.before = std::move(aligned->log_before);
        one.after = std::move(aligned->log_after);
        one.align = aligned->before_from_after;
        views.push_back(std::move(one));
    }
    SubProgress starting(progress, 0, 0.2), fitting(progress, 0.2, 1);
    // A start; where the paper's method finds nothing it begins at the plan.
    const Result<CavityLocation> paper = locateByPaper(given, mesh, planned, options, starting);
    if (!paper && paper.error().isCancelled()) return paper.error();
    const Rigid3 start = paper ? paper->femur_from_cavity.target_from_source : planned;
    Result<VolumeProjector> way = wayThrough(mesh);
    if (!way) return way.error();
    Result<CavityLocation> location = Fit(std::move(*way), start, options).run(std::move(views), fitting);
    if (location) location->elapsed_ms = stopwatch.ms();
    return location;
}

}  // namespace fluorocut::cavity
