#include "core/cavity/full_model.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/parallel.h"
#include "core/base/units.h"
#include "core/cavity/region_pixels.h"
#include "core/cavity/removed_bone.h"
#include "core/image/blur.h"
#include "core/imaging/volume_projector.h"

namespace fluorocut::cavity {
namespace {

constexpr const char* kStep = "cavity location";
// Unknowns of one view: pose (6), g, h / g, attenuation of what fills the cavity (1/mm), softness, what
// is added to the beam, what multiplies it (polynomials).
constexpr int kG = 6, kRatio = 7, kFill = 8, kSoft = 9, kPedestal = 10, kPoly = kPedestal + kSlow,
              kOfView = kPoly + kSlow;
constexpr double kMarginMm = 18;  // of the region around the cavity's shadow, at the cavity
constexpr double kStepMm = 0.15;  // of the differences by the cavity's pose
constexpr double kStepRad = 0.003;
constexpr double kStaleMm = 0.15, kStaleRad = 0.005;  // farther from where they were taken, derivatives are taken anew
constexpr double kScaleSigma = 0.3;                   // of g about 1
constexpr double kRatioSigma = 0.03;                  // of h / g about 1
// Scatter and glare, as a part of the mean of the rest: how much of it, and how uneven.
constexpr double kPedestalMean = 0.3, kPedestalSlope = 0.15, kSettledSlope = 0.02;
constexpr double kWorse = 0.05;      // of the residual's logarithm
constexpr int kSettle = 2;           // iterations in which only the beam is fitted
constexpr double kFillSigma = 0.02;  // 1/mm: air to water
constexpr double kSoftSigma = 1.0;   // px^2, of the blur's variance
constexpr std::array<int, 3> kBinning{4, 2, 1};
constexpr int kBlock = 16;  // px, in which residuals may be correlated

struct View {
    const CavityView* given = nullptr;
    CArm carm;  // the region, at this level
    Image log_seen;
    Eigen::VectorXf weight;  // of every pixel's residual, 1 / variance
    int axis = 0;
    int binning = 1;
    double usual_bone = 0;  // mean line integral of the region
    double level = 0;       // geometric mean of exp(-g D) where the pedestal is measured by it
    Vector6 delta = Vector6::Zero();
    Vector6 frozen_at = Vector6::Zero();
    Image bone;  // D at frozen_at
    std::array<Image, 6> bone_by_pose;
    Eigen::Matrix<double, kOfView, 1> values = Eigen::Matrix<double, kOfView, 1>::Zero();
    Eigen::MatrixXf basis;  // pixels x kSlow
    double noise = 1;       // robust standard deviation of the residual
    Eigen::VectorXf residual;
    Eigen::MatrixXf jacobian;  // pixels x (6 + kOfView)

    // Standard deviation of the blur in this level's pixels. A block's average adds (b^2 - 1) / 12 px^2 to its
    // variance.
    double blur() const { return std::sqrt(values[kSoft] + (binning * binning - 1) / 12.0) / binning; }
    Rigid3 pose() const { return given->after_imager_from_femur.perturbed(delta); }
};

class Fit {
  public:
    Fit(const TriangleMesh& mesh, const Rigid3& planned, std::shared_ptr<const Volume> ct,
        const CavityLocationOptions& options)
        : mesh_(mesh),
          planned_(planned),
          pose_(planned),
          options_(options),
          removed_(ct, mesh, {options.mu_water_per_mm, -1000}),
          ct_(std::move(ct)) {}

    Result<CavityLocation> run(const std::vector<CavityView>& views, Progress& progress) {
        const auto start = std::chrono::steady_clock::now();
        Result<VolumeProjector> bone = VolumeProjector::prepare(ct_, {options_.mu_water_per_mm, -1000});
        if (!bone) return bone.error();
        bone_.emplace(std::move(*bone));
        CavityLocation location;
        for (const CavityView& view : views) {
            const auto region =
                regionOf(view.carm, mesh_, view.after_imager_from_femur * planned_, kMarginMm, kBinning[0]);
            if (!region) {
                return invalidInput(
                    fmt::format("view {}", view.name), "a planned cavity whose shadow lies outside the image",
                    "most of the cavity in the picture", "give the pose and the C-arm that belong to this image");
            }
            View one;
            one.given = &view;
            one.axis = bone_->mainAxis(view.carm, view.after_imager_from_femur);
            one.values[kG] = one.values[kRatio] = 1;
            one.values[kPedestal] = 0.1;
            one.values[kSoft] = options_.blur_px * options_.blur_px;
            views_.push_back(std::move(one));
            regions_.push_back(*region);
        }
        for (std::size_t level = 0; level < kBinning.size(); ++level) {
            prepare(kBinning[level]);
            const bool last = level + 1 == kBinning.size();
            const int most = level == 0 ? 12 + kSettle : 12;
            for (int iteration = 0; iteration < most; ++iteration) {
                if (progress.isCancelled()) return cancelled(kStep);
                progress.report((static_cast<double>(level) + static_cast<double>(iteration) / most) / kBinning.size(),
                                "locating the cavity");
                // Bone's derivatives anew at the first look and once the poses have moved.
                const bool robust = level > 0 || iteration >= 3;
                const bool settle = level == 0 && iteration < kSettle;
                Result<double> moved = step(robust, settle, level == 0 || iteration == 0 || stale());
                if (!moved) return moved.error();
                ++location.iterations;
                location.converged = !settle && *moved < (last ? 0.05 : 0.3);
                if (location.converged) break;
            }
        }
        location.femur_from_cavity = {Frame::femur, Frame::cavity, pose_, covariance()};
        for (const View& view : views_)
            location.views.push_back(residualOf(view));
        location.elapsed_ms =
            std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
        return location;
    }

  private:
    void prepare(int binning) {
        fresh_level_ = true;
        for (std::size_t v = 0; v < views_.size(); ++v) {
            View& view = views_[v];
            const Region& r = regions_[v];
            const CArm region = view.given->carm.cropped(r.x, r.y, r.width, r.height);
            view.carm = binning > 1 ? region.binned(binning) : region;
            view.log_seen = logOf(view.given->after, r, binning);
            view.binning = binning;
            view.basis = slowBasis(view.carm.columns, view.carm.rows);
        }
    }

    ViewResidual residualOf(const View& view) const {
        ViewResidual of{view.given->name, view.noise, view.delta};
        const ViewPoseUncertainty& known = options_.view_pose;
        of.pose_sigmas = 0;
        for (int j = 0; j < 6; ++j) {
            of.pose_sigmas = std::max(of.pose_sigmas, std::abs(view.delta[j]) / known.sigma(j));
        }
        of.evidence = evidenceOf(view);
        return of;
    }

    // The fit holds h / g near 1; asked once more, and freely, what factor the cavity's own contrast has in this image
    // when the beam's slow parts may follow: 1 where it is there, 0 where it is not.
    double evidenceOf(const View& view) const {
        const Eigen::VectorXf contrast = view.jacobian.col(6 + kRatio);
        Eigen::MatrixXf slow(view.jacobian.rows(), kSlow + 2);
        slow.leftCols(kSlow) = view.basis;
        slow.col(kSlow) = view.jacobian.col(6 + kG);
        slow.col(kSlow + 1) = view.jacobian.col(6 + kFill);
        const Eigen::MatrixXf weighted = view.weight.asDiagonal() * slow;
        const Eigen::MatrixXf normal = slow.transpose() * weighted;
        const Eigen::VectorXf own = contrast - slow * normal.ldlt().solve(weighted.transpose() * contrast);
        const Eigen::VectorXf pull = view.weight.array() * own.array();
        const double factor = pull.dot(view.residual) / std::max(pull.dot(own), 1e-20f);
        return view.values[kRatio] + factor;
    }

    // Has the cavity moved so far that the derivatives are no longer its own?
    bool stale() const {
        const Vector6 since = pose_.deltaFrom(fresh_at_);
        return since.head<3>().norm() > kStaleMm || since.tail<3>().norm() > kStaleRad;
    }

    void freezeBone(View& view) {
        ProjectionWithGradient projection = bone_->projectWithGradient(view.carm, view.pose(), axisOf(view));
        view.bone = std::move(projection.image);
        view.bone_by_pose = std::move(projection.gradient);
        view.frozen_at = view.delta;
    }

    // One Gauss-Newton step; how far it went in units of what the fit knows (the largest Mahalanobis part). `fresh`:
    // with new derivatives; otherwise those of an earlier step are good enough.
    Result<double> step(bool robust, bool settle, bool fresh) {
        Result<Removed> here = removed_.at(pose_);
        if (!here) return here.error();
        std::array<std::optional<Removed>, 6> there;
        if (fresh) {
            std::array<std::optional<Error>, 6> errors;
            parallelFor(6, 1, [&](std::size_t begin, std::size_t end) {
                for (std::size_t i = begin; i < end; ++i) {
                    Vector6 delta = Vector6::Zero();
                    delta[static_cast<Eigen::Index>(i)] = i < 3 ? kStepMm : kStepRad;
                    auto moved = removed_.at(pose_.perturbed(delta));
                    if (moved)
                        there[i].emplace(std::move(*moved));
                    else
                        errors[i] = moved.error();
                }
            });
            for (const auto& error : errors)
                if (error) return *error;
            fresh_at_ = pose_;
        }

        const auto n = static_cast<Eigen::Index>(6 + kOfView * views_.size());
        Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
        Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
        for (std::size_t v = 0; v < views_.size(); ++v) {
            View& view = views_[v];
            if (fresh) freezeBone(view);
            const Beam beam = look(view, *here, fresh);
            if (fresh) differentiate(view, beam, there);
            weigh(view, robust, settle);
            accumulate(view, 6 + kOfView * static_cast<Eigen::Index>(v), settle ? kSettledSlope : kPedestalSlope,
                       normal, right);
        }
        // A step after which the images fit much worse went beyond what its derivatives know: a part of it, again.
        double misfit = 0, pixels = 0;
        for (const View& view : views_) {
            const auto count = static_cast<double>(view.residual.size());
            misfit += count * std::log(view.noise);
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
        if (settle) {
            normal.topLeftCorner<6, 6>().diagonal().array() += 1e12;
            for (std::size_t v = 0; v < views_.size(); ++v)
                normal.diagonal().segment<8>(6 + kOfView * static_cast<Eigen::Index>(v)).array() +=
                    1e12;  // pose, g, ratio
        }
        const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
        const Eigen::VectorXd change = solver.solve(right);
        if (!change.allFinite()) {
            return noSolution(kStep, "equations without a solution", "images that tell where the cavity is",
                              "see that poses, cavity and images belong together");
        }
        change_ = change;
        const Vector6 move = change.head<6>();
        // Not farther at once than the linear model holds.
        const double far = std::max(move.head<3>().norm() / 1.5, move.tail<3>().norm() / 0.04);
        before_.clear();
        for (const View& view : views_)
            before_.push_back({view.delta, view.values});
        pose_before_ = pose_;
        restore(far > 1 ? 1 / far : 1);
        double moved = 0;
        const Eigen::MatrixXd inverse = solver.solve(Eigen::MatrixXd::Identity(n, n));
        for (int i = 0; i < 6; ++i)
            moved = std::max(moved, std::abs(move[i]) / std::sqrt(std::max(inverse(i, i), 1e-12)));
        inverse_ = inverse;
        return moved;
    }

    // From where the last step began, this part of it.
    void restore(double part) {
        pose_ = pose_before_.perturbed(part * change_.head<6>());
        for (std::size_t v = 0; v < views_.size(); ++v) {
            View& view = views_[v];
            const auto own = change_.segment<kOfView>(6 + kOfView * static_cast<Eigen::Index>(v));
            view.delta = before_[v].delta + part * own.head<6>();
            view.values = before_[v].values;
            view.values.tail<kOfView - 6>() += part * own.tail<kOfView - 6>();
            view.values[kG] = std::clamp(view.values[kG], 0.2, 5.0);
            view.values[kRatio] = std::clamp(view.values[kRatio], 0.5, 2.0);
            view.values[kFill] = std::clamp(view.values[kFill], -0.002, 0.05);
            view.values[kPedestal] = std::clamp(view.values[kPedestal], 0.0, 2.0);
            view.values[kSoft] = std::clamp(view.values[kSoft], 0.05, 9.0);
        }
    }

    // What the model shows, and what it is made of.
    struct Beam {
        Image bone;                              // line integral of the CT
        ProjectionWithGradient removed, length;  // gradients only when asked for
        Image gone;                              // what is missing from the line integral, in all: h K - fill P
        Image primary;                           // exp(gone - g bone)
        Image blurred;                           // without and
        Image seen;                              // with what is added to it
    };

    static ProjectionOptions axisOf(const View& view) {
        ProjectionOptions options;
        options.main_axis = view.axis;
        return options;
    }

    static Image missing(const View& view, const Image& bone, const Image& length) {
        const auto h = static_cast<float>(view.values[kG] * view.values[kRatio]),
                   fill = static_cast<float>(view.values[kFill]);
        Image sum = bone;
        for (std::size_t i = 0; i < sum.size(); ++i)
            sum.pixels()[i] = h * bone.pixels()[i] - fill * length.pixels()[i];
        return sum;
    }

    Beam look(View& view, const Removed& here, bool with_gradient) const {
        Beam beam;
        if (with_gradient) {
            beam.removed = here.bone.projectWithGradient(view.carm, view.pose(), axisOf(view));
            beam.length = here.length.projectWithGradient(view.carm, view.pose(), axisOf(view));
        } else {
            beam.removed.image = here.bone.project(view.carm, view.pose(), axisOf(view));
            beam.length.image = here.length.project(view.carm, view.pose(), axisOf(view));
        }
        beam.gone = missing(view, beam.removed.image, beam.length.image);
        beam.bone = view.bone;
        const Vector6 since = view.delta - view.frozen_at;
        const std::size_t count = beam.bone.size();
        for (int j = 0; j < 6; ++j) {
            const auto by = static_cast<float>(since[j]);
            if (by == 0) continue;
            const Image& change = view.bone_by_pose[static_cast<std::size_t>(j)];
            for (std::size_t i = 0; i < count; ++i)
                beam.bone.pixels()[i] += by * change.pixels()[i];
        }
        const auto g = static_cast<float>(view.values[kG]);
        // About its mean, so that g changes contrast and not brightness.
        if (view.usual_bone == 0) {
            double sum = 0;
            for (const float pixel : beam.bone.pixels())
                sum += pixel;
            view.usual_bone = sum / static_cast<double>(count);
        }
        const auto usual = static_cast<float>(view.usual_bone);
        beam.primary = Image(view.carm.columns, view.carm.rows);
        for (std::size_t i = 0; i < count; ++i)
            beam.primary.pixels()[i] = std::exp(beam.gone.pixels()[i] - g * (beam.bone.pixels()[i] - usual));
        beam.blurred = gaussianBlurred(beam.primary, view.blur());
        if (view.level == 0) {
            double sum = 0;
            for (const float pixel : beam.blurred.pixels())
                sum += std::log(std::max(pixel, 1e-30f));
            view.level = std::exp(sum / static_cast<double>(count));
            // The picture's gain is anything; the rest starts from a picture as bright as this one.
            double seen = 0;
            for (const float value : view.log_seen.pixels())
                seen += value;
            view.values[kPoly] = (seen - sum) / static_cast<double>(count) - std::log1p(view.values[kPedestal]);
        }
        const Eigen::VectorXf added = view.basis * (view.level * view.values.segment<kSlow>(kPedestal)).cast<float>();
        const Eigen::VectorXf slow = view.basis * view.values.tail<kSlow>().cast<float>();
        beam.seen = beam.blurred;
        view.residual.resize(static_cast<Eigen::Index>(count));
        for (std::size_t i = 0; i < count; ++i) {
            float& seen = beam.seen.pixels()[i];
            const auto at = static_cast<Eigen::Index>(i);
            seen = std::max({0.1f * seen, seen + added[at], 1e-30f});
            view.residual[at] = view.log_seen.pixels()[i] - std::log(seen) - slow[at];
        }
        return beam;
    }

    void differentiate(View& view, const Beam& beam, const std::array<std::optional<Removed>, 6>& there) const {
        const std::size_t count = beam.seen.size();
        const auto pixels = static_cast<Eigen::Index>(count);
        view.jacobian.resize(pixels, 6 + kOfView);
        // exp(-line integral), blurred, over what is seen.
        const auto column = [&](Eigen::Index index, auto&& derivative) {
            Image change(view.carm.columns, view.carm.rows);
            for (std::size_t i = 0; i < count; ++i)
                change.pixels()[i] = beam.primary.pixels()[i] * derivative(i);
            change = gaussianBlurred(change, view.blur());
            for (std::size_t i = 0; i < count; ++i)
                view.jacobian(static_cast<Eigen::Index>(i), index) = change.pixels()[i] / beam.seen.pixels()[i];
        };
        const auto g = static_cast<float>(view.values[kG]), ratio = static_cast<float>(view.values[kRatio]),
                   usual = static_cast<float>(view.usual_bone);
        parallelFor(15, 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t c = begin; c < end; ++c) {
                const auto index = static_cast<Eigen::Index>(c);
                if (c < 6) {
                    const float by = 1 / static_cast<float>(c < 3 ? kStepMm : kStepRad);
                    const Image moved = missing(view, there[c]->bone.project(view.carm, view.pose(), axisOf(view)),
                                                there[c]->length.project(view.carm, view.pose(), axisOf(view)));
                    column(index, [&](std::size_t i) { return by * (moved.pixels()[i] - beam.gone.pixels()[i]); });
                } else if (c < 12) {
                    const std::size_t j = c - 6;
                    const Image by_view = missing(view, beam.removed.gradient[j], beam.length.gradient[j]);
                    column(index,
                           [&](std::size_t i) { return by_view.pixels()[i] - g * view.bone_by_pose[j].pixels()[i]; });
                } else if (c == 12) {
                    column(6 + kG, [&](std::size_t i) {
                        return usual - beam.bone.pixels()[i] + ratio * beam.removed.image.pixels()[i];
                    });
                } else if (c == 13) {
                    column(6 + kRatio, [&](std::size_t i) { return g * beam.removed.image.pixels()[i]; });
                } else {
                    column(6 + kFill, [&](std::size_t i) { return -beam.length.image.pixels()[i]; });
                }
            }
        });
        const Image soft = halfLaplacian(beam.blurred);
        const auto area = static_cast<float>(view.binning * view.binning);
        Eigen::VectorXf relative(pixels);
        for (std::size_t i = 0; i < count; ++i) {
            const auto at = static_cast<Eigen::Index>(i);
            view.jacobian(at, 6 + kSoft) = soft.pixels()[i] / (area * beam.seen.pixels()[i]);
            relative[at] = static_cast<float>(view.level) / beam.seen.pixels()[i];
        }
        view.jacobian.middleCols<kSlow>(6 + kPedestal) = relative.asDiagonal() * view.basis;
        view.jacobian.rightCols(kSlow) = view.basis;
    }

    void weigh(View& view, bool robust, bool settle) const {
        Eigen::VectorXf rest = view.residual;
        if (settle) {
            // The first looks know no polynomial yet: what it will take is taken out before the residual's size is
            // asked.
            const Eigen::MatrixXf normal = view.basis.transpose() * view.basis;
            rest -= view.basis * normal.ldlt().solve(view.basis.transpose() * rest);
        }
        std::vector<float> size(static_cast<std::size_t>(rest.size()));
        for (Eigen::Index i = 0; i < rest.size(); ++i)
            size[static_cast<std::size_t>(i)] = std::abs(rest[i]);
        view.noise = std::max(1e-5, 1.4826 * static_cast<double>(median(size)));
        view.weight = Eigen::VectorXf::Constant(rest.size(), static_cast<float>(1 / (view.noise * view.noise)));
        if (!robust) return;
        view.weight.array() /= 1 + (rest.array() / static_cast<float>(3 * view.noise)).square();
    }

    void accumulate(const View& view, Eigen::Index at, double pedestal_slope, Eigen::MatrixXd& normal,
                    Eigen::VectorXd& right) const {
        // In pieces, side by side: sums of floats over some thousand pixels, of doubles over the pieces.
        constexpr Eigen::Index kPiece = 4096;
        const std::size_t pieces = static_cast<std::size_t>((view.residual.size() + kPiece - 1) / kPiece);
        std::vector<Eigen::MatrixXf> parts(pieces);
        parallelFor(pieces, 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t p = begin; p < end; ++p) {
                const Eigen::Index first = static_cast<Eigen::Index>(p) * kPiece;
                const Eigen::Index count = std::min(kPiece, view.residual.size() - first);
                Eigen::MatrixXf both(count, 7 + kOfView);
                both.leftCols(6 + kOfView) = view.jacobian.middleRows(first, count);
                both.rightCols(1) = view.residual.segment(first, count);
                const Eigen::MatrixXf weighted = view.weight.segment(first, count).asDiagonal() * both;
                parts[p] = both.leftCols(6 + kOfView).transpose() * weighted;
            }
        });
        Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(6 + kOfView, 7 + kOfView);
        for (const Eigen::MatrixXf& part : parts)
            sum += part.cast<double>();
        const auto own = sum.leftCols(6 + kOfView);
        const auto pull = sum.col(6 + kOfView);
        normal.topLeftCorner<6, 6>() += own.topLeftCorner<6, 6>();
        normal.block(0, at, 6, kOfView) += own.block(0, 6, 6, kOfView);
        normal.block(at, 0, kOfView, 6) += own.block(6, 0, kOfView, 6);
        normal.block(at, at, kOfView, kOfView) += own.block(6, 6, kOfView, kOfView);
        right.head<6>() += pull.head<6>();
        right.segment(at, kOfView) += pull.tail(kOfView);
        // What is known beforehand.
        const ViewPoseUncertainty& known = options_.view_pose;
        for (int j = 0; j < 6; ++j) {
            const double sigma = known.sigma(j);
            normal(at + j, at + j) += 1 / (sigma * sigma);
            right[at + j] -= view.delta[j] / (sigma * sigma);
        }
        const auto know = [&](int j, double value, double sigma) {
            normal(at + j, at + j) += 1 / (sigma * sigma);
            right[at + j] -= (view.values[j] - value) / (sigma * sigma);
        };
        know(kG, 1, kScaleSigma);
        know(kRatio, 1, kRatioSigma);
        know(kFill, 0, kFillSigma);
        know(kSoft, options_.blur_px * options_.blur_px, kSoftSigma);
        for (int j = kPedestal; j < kPoly; ++j)
            know(j, j == kPedestal ? kPedestalMean : 0, j == kPedestal ? kPedestalMean : pedestal_slope);
        for (int j = kPoly; j < kOfView; ++j)
            normal(at + j, at + j) += 1e-4;
    }

    // The residual is correlated from pixel to pixel (the detector's blur, what the CT does not know): the score's
    // variance is taken from blocks of pixels instead (the sandwich of Huber 1967 over clusters, Liang and Zeger 1986).
    // What was known beforehand counts as it was given.
    Matrix6 covariance() const {
        const auto n = static_cast<Eigen::Index>(6 + kOfView * views_.size());
        Eigen::MatrixXd meat = Eigen::MatrixXd::Zero(n, n);
        for (std::size_t v = 0; v < views_.size(); ++v) {
            const View& view = views_[v];
            const Eigen::Index at = 6 + kOfView * static_cast<Eigen::Index>(v);
            const Eigen::VectorXf rest =
                view.weight.array() * (view.residual - view.jacobian.leftCols<6>() * change_.head<6>().cast<float>() -
                                       view.jacobian.rightCols(kOfView) * change_.segment(at, kOfView).cast<float>())
                                          .array();
            const int width = view.carm.columns, height = view.carm.rows;
            Eigen::MatrixXd own = Eigen::MatrixXd::Zero(6 + kOfView, 6 + kOfView);
            for (int y0 = 0; y0 < height; y0 += kBlock) {
                for (int x0 = 0; x0 < width; x0 += kBlock) {
                    Eigen::VectorXf score = Eigen::VectorXf::Zero(6 + kOfView);
                    for (int y = y0; y < std::min(y0 + kBlock, height); ++y) {
                        const Eigen::Index first = static_cast<Eigen::Index>(y) * width + x0;
                        const Eigen::Index count = std::min(kBlock, width - x0);
                        score += view.jacobian.middleRows(first, count).transpose() * rest.segment(first, count);
                    }
                    own += (score * score.transpose()).cast<double>();
                }
            }
            meat.topLeftCorner<6, 6>() += own.topLeftCorner<6, 6>();
            meat.block(0, at, 6, kOfView) += own.block(0, 6, 6, kOfView);
            meat.block(at, 0, kOfView, 6) += own.block(6, 0, kOfView, 6);
            meat.block(at, at, kOfView, kOfView) += own.block(6, 6, kOfView, kOfView);
            const ViewPoseUncertainty& known = options_.view_pose;
            for (int j = 0; j < 6; ++j) {
                const double sigma = known.sigma(j);
                meat(at + j, at + j) += 1 / (sigma * sigma);
            }
            meat(at + kRatio, at + kRatio) += 1 / (kRatioSigma * kRatioSigma);
            meat(at + kFill, at + kFill) += 1 / (kFillSigma * kFillSigma);
        }
        return (inverse_ * meat * inverse_).topLeftCorner<6, 6>();
    }

    const TriangleMesh& mesh_;
    Rigid3 planned_, pose_;
    const CavityLocationOptions& options_;
    RemovedBone removed_;
    std::shared_ptr<const Volume> ct_;
    std::optional<VolumeProjector> bone_;
    std::vector<View> views_;
    std::vector<Region> regions_;
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
    Eigen::MatrixXd inverse_;
    Eigen::VectorXd change_;
};

}  // namespace

Result<CavityLocation> locateByFullModel(const std::vector<CavityView>& views, const TriangleMesh& mesh,
                                         const Rigid3& planned_femur_from_cavity, std::shared_ptr<const Volume> ct,
                                         const CavityLocationOptions& options, Progress& progress) {
    return Fit(mesh, planned_femur_from_cavity, std::move(ct), options).run(views, progress);
}

}  // namespace fluorocut::cavity
