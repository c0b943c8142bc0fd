#include "core/registration/hand_eye/problem.h"

#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include <Eigen/Dense>

#include "core/base/chi_square.h"
#include "core/base/median.h"
#include "core/base/random.h"

namespace fluorocut::hand_eye {
namespace {

// Of a squared distance with 6 degrees of freedom: its median, and what one in 10,000 exceeds.
constexpr double kMedianSquare = 5.348;
constexpr double kOutlierSquare = 27.86;
constexpr int kSamples = 150;
// Noise is taken at its word unless the residuals are less likely than this.
constexpr double kUnlikely = 0.001;

}  // namespace

double Fit::placeMm() const {
    double sum = 0;
    for (std::size_t i = 0; i < used.size(); ++i)
        sum += used[i] ? network.residuals[i].head<3>().squaredNorm() : 0;
    return std::sqrt(sum / static_cast<double>(count()));
}

double Fit::rotationRad() const {
    double sum = 0;
    for (std::size_t i = 0; i < used.size(); ++i)
        sum += used[i] ? network.residuals[i].tail<3>().squaredNorm() : 0;
    return std::sqrt(sum / static_cast<double>(count()));
}

const Rigid3& poseOf(const HandEyeObservation& observation) {
    return observation.evidence ? observation.evidence->target_from_source : observation.imager_from_corkscrew;
}

Problem::Problem(const std::vector<HandEyeObservation>& observations, const HandEyeOptions& options)
    : observations_(observations), options_(options) {
    std::map<std::string, int> known;
    for (const HandEyeObservation& one : observations) {
        const auto [place, is_new] = known.emplace(one.imager, static_cast<int>(names_.size()));
        if (is_new) names_.push_back(one.imager);
        position_.push_back(place->second);
        evidence_.push_back(one.evidence
                                ? *one.evidence
                                : evidenceOf(one.imager_from_corkscrew,
                                             one.covariance ? *one.covariance
                                                            : options.assumed.covarianceAt(one.imager_from_corkscrew)));
        stated_ = stated_ && (one.evidence || one.covariance);
    }
    for (std::size_t i = 0; i < observations.size(); ++i) {
        for (std::size_t j = i + 1; j < observations.size(); ++j) {
            if (position_[i] != position_[j]) continue;
            motions_.push_back({observations[i].robot_from_flange.inverse() * observations[j].robot_from_flange,
                                evidence_[i].target_from_source.inverse() * evidence_[j].target_from_source});
        }
    }
}

Fit Problem::solve() const {
    const std::vector<bool> all(observations_.size(), true);
    Fit fit;
    if (const std::optional<Rigid3> start = solveHandEye(motions_)) {
        fit = refine(posesFrom(*start), all);
        if (fit.found && clean(fit)) return fit;
    }
    Fit searched = search();
    if (!searched.found) return fit;
    // With the noise unknown, leaving images out must pay: half the scatter.
    if (fit.found && !stated_ && fit.count() >= searched.count() && searched.factor > 0.5 * fit.factor) return fit;
    if (fit.found && searched.median > fit.median) return fit;
    return searched;
}

std::vector<Rigid3> Problem::posesFrom(const Rigid3& flange_from_corkscrew, double* score) const {
    std::vector<Rigid3> poses{flange_from_corkscrew};
    std::vector<Matrix6> information;
    std::vector<double> distances;
    for (std::size_t k = 0; k < names_.size(); ++k) {
        Rigid3 best;
        std::vector<double> best_distances;
        for (std::size_t i = 0; i < evidence_.size(); ++i) {
            if (position_[i] != static_cast<int>(k)) continue;
            const Rigid3 imager_from_robot = evidence_[i].target_from_source *
                                             (observations_[i].robot_from_flange * flange_from_corkscrew).inverse();
            std::vector<double> own;
            for (std::size_t j = 0; j < evidence_.size(); ++j) {
                if (position_[j] != static_cast<int>(k)) continue;
                const Rigid3 predicted = imager_from_robot * observations_[j].robot_from_flange * flange_from_corkscrew;
                const Vector6 d = predicted.deltaFrom(evidence_[j].target_from_source);
                own.push_back(d.dot(evidence_[j].information.topLeftCorner<6, 6>() * d));
            }
            if (best_distances.empty() || median(own) < median(best_distances)) {
                best = imager_from_robot;
                best_distances = std::move(own);
            }
        }
        poses.push_back(best);
        // A position's own candidate fits itself.
        if (best_distances.size() > 1) distances.insert(distances.end(), best_distances.begin(), best_distances.end());
    }
    if (score) *score = median(distances);
    return poses;
}

PoseNetwork Problem::network(const std::vector<Rigid3>& poses, const std::vector<bool>& used) const {
    const SharedLayout shared = sharedLayout();
    Matrix6 robot = Matrix6::Zero();
    robot.diagonal().head<3>().setConstant(options_.robot_place_mm * options_.robot_place_mm);
    robot.diagonal().tail<3>().setConstant(options_.robot_rotation_rad * options_.robot_rotation_rad);
    PoseNetwork result;
    result.poses = poses;
    result.shared = shared.mean;
    result.shared_information = shared.information;
    for (std::size_t i = 0; i < evidence_.size(); ++i) {
        const auto k = static_cast<std::size_t>(position_[i]);
        result.factors.push_back({{PoseStep::unknown(position_[i] + 1),
                                   PoseStep::about(observations_[i].robot_from_flange, robot), PoseStep::unknown(0)},
                                  evidence_[i],
                                  evidence_[i].shared.size() > 0 ? shared.index[k] : std::vector<int>(),
                                  used[i] ? 1.0 : 0.0});
    }
    return result;
}

PoseNetworkOptions Problem::networkOptions() const {
    PoseNetworkOptions result;
    if (options_.relinearise) {
        result.relinearise = [this](std::size_t i, const Rigid3& pose, const Eigen::VectorXd& shared) {
            if (!observations_[i].evidence) return PoseEvidence();
            Result<PoseEvidence> answer = options_.relinearise(i, pose, shared);
            return answer ? std::move(*answer) : PoseEvidence();
        };
    }
    return result;
}

double Problem::freedom(const std::vector<bool>& used) const {
    std::vector<bool> seen(names_.size(), false);
    double count = -6;
    for (std::size_t i = 0; i < used.size(); ++i) {
        if (!used[i]) continue;
        count += 6;
        const auto k = static_cast<std::size_t>(position_[i]);
        if (!seen[k]) count -= 6;
        seen[k] = true;
    }
    return count;
}

double Problem::sumOfSquares(const PoseNetworkResult& network, const std::vector<bool>& used) {
    double sum = 0;
    for (std::size_t i = 0; i < used.size(); ++i)
        sum += used[i] ? network.squared_distances[i] : 0;
    return sum;
}

Fit Problem::refine(const std::vector<Rigid3>& start, const std::vector<bool>& used) const {
    Fit fit;
    fit.used = used;
    fit.network = solvePoseNetwork(network(start, used), networkOptions());
    const double free = freedom(used);
    fit.found = free > 0 && std::isfinite(sumOfSquares(fit.network, used));
    if (!fit.found) return fit;
    const double squares = sumOfSquares(fit.network, used);
    const double factor = std::sqrt(squares / free);
    const bool unlikely = chiSquareTail(squares, static_cast<int>(free)) < kUnlikely;
    fit.factor = stated_ ? (unlikely ? factor : 1) : std::max(factor, 1e-6);
    if (options_.shared.size() > 0 && fit.factor != 1) {
        // Images that are noisier than they say have less to say against what is known of the parameters, too.
        PoseNetwork weaker = network(fit.network.poses, used);
        for (PoseFactor& one : weaker.factors)
            one.weight /= fit.factor * fit.factor;
        fit.network = solvePoseNetwork(weaker, networkOptions());
    } else {
        fit.network.covariance *= fit.factor * fit.factor;
    }
    fit.median = std::sqrt(median(fit.network.squared_distances));
    return fit;
}

bool Problem::clean(const Fit& fit) const {
    const double limit = kOutlierSquare * fit.factor * fit.factor;
    for (const double d : fit.network.squared_distances)
        if (!(d <= limit)) return false;
    // Unknown noise swallows outliers: only a look without some of the images tells.
    return stated_ ? fit.factor <= 1 : observations_.size() < 5;
}

Matrix6 Problem::predictionCovariance(const PoseNetworkResult& result, const PoseFactor& factor) const {
    const Eigen::Index all = result.covariance.rows();
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(6, all);
    for (std::size_t s = 0; s < factor.chain.size(); ++s) {
        if (factor.chain[s].variable >= 0)
            jacobian.middleCols(6 * factor.chain[s].variable, 6) += stepDerivative(factor.chain, s, result.poses);
    }
    return jacobian * result.covariance * jacobian.transpose();
}

Fit Problem::withoutOutliers(Fit fit) const {
    for (int round = 0; round < 10; ++round) {
        // The noise from the better half, so that outliers do not hide each other.
        double robust = std::sqrt(median(fit.network.squared_distances) / kMedianSquare);
        const double share = freedom(fit.used) / (6 * static_cast<double>(fit.count()));
        robust /= std::sqrt(std::max(share, 0.2));
        if (stated_) robust = std::max(robust, 1.0);
        const PoseNetwork judged = network(fit.network.poses, fit.used);
        std::vector<bool> used(fit.used.size());
        for (std::size_t i = 0; i < used.size(); ++i) {
            double square = fit.network.squared_distances[i] / (robust * robust);
            if (!fit.used[i] && square > kOutlierSquare) {
                // It is not to pay for what those in use do not know.
                const Matrix6 own = evidence_[i].covariance() * robust * robust;
                const Matrix6 total = own + predictionCovariance(fit.network, judged.factors[i]);
                const Vector6& r = fit.network.residuals[i];
                square = r.dot(total.ldlt().solve(r));
            }
            used[i] = square <= kOutlierSquare;
        }
        if (used == fit.used || freedom(used) <= 0) break;
        Fit next = refine(fit.network.poses, used);
        if (!next.found) break;
        fit = std::move(next);
    }
    return fit;
}

Fit Problem::search() const {
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    for (std::size_t i = 0; i < motions_.size(); ++i)
        for (std::size_t j = i + 1; j < motions_.size(); ++j)
            pairs.emplace_back(i, j);
    Random random(options_.seed);
    double best_score = std::numeric_limits<double>::infinity();
    std::vector<Rigid3> best;
    for (int sample = 0; sample < kSamples && !pairs.empty(); ++sample) {
        const std::size_t pick = random.below(pairs.size());
        const auto [i, j] = pairs[pick];
        pairs[pick] = pairs.back();
        pairs.pop_back();
        const std::vector<HandEyeMotion> two{motions_[i], motions_[j]};
        if (!(spreadOf(two).second_turn_rad >= options_.least_turn_rad)) continue;
        const std::optional<Rigid3> start = solveHandEye(two);
        if (!start) continue;
        double score = 0;
        std::vector<Rigid3> poses = posesFrom(*start, &score);
        if (score < best_score) {
            best_score = score;
            best = std::move(poses);
        }
    }
    if (best.empty()) return {};
    // Robust, with the noise narrowing as the fit improves; then plain, without what disagrees.
    const std::vector<bool> all(observations_.size(), true);
    double scale = std::max(1.0, std::sqrt(best_score / kMedianSquare));
    PoseNetworkResult robust;
    for (int round = 0; round < 4; ++round) {
        PoseNetworkOptions soft = networkOptions();
        soft.relinearise = nullptr;
        soft.robust_scale = 5 * scale;
        const PoseNetwork problem = network(best, all);
        robust = solvePoseNetwork(problem, soft);
        best = robust.poses;
        const double now = std::sqrt(median(robust.squared_distances) / kMedianSquare);
        scale = stated_ ? std::max(1.0, now) : std::max(now, 1e-3);
    }
    std::vector<bool> used(observations_.size());
    for (std::size_t i = 0; i < used.size(); ++i)
        used[i] = robust.squared_distances[i] <= 2 * kOutlierSquare * scale * scale;
    if (freedom(used) <= 0) return {};
    const Fit fit = refine(best, used);
    return fit.found ? withoutOutliers(fit) : fit;
}

}  // namespace fluorocut::hand_eye
