#include "core/registration/hand_eye.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <numeric>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/option_checks.h"
#include "core/base/random.h"
#include "core/base/units.h"
#include "core/registration/hand_eye_start.h"
#include "core/registration/pose_network.h"

namespace fluorocut {
namespace {

const char* const kWhere = "robot-corkscrew calibration";

// Of a squared distance with 6 degrees of freedom: its median, and what one in 10,000 exceeds.
constexpr double kMedianSquare = 5.348;
constexpr double kOutlierSquare = 27.86;
constexpr int kSamples = 150;
// Poses that miss the others by this many times the noise contradict them; and where the noise is only assumed, by this
// much in absolute terms.
constexpr double kContradiction = 10;
constexpr double kContradictionMm = 3, kContradictionRad = 0.035;

// What one in 1000 values of chi squared exceeds (Wilson and Hilferty).
double chiSquaredLimit(double freedom) {
    const double v = 2 / (9 * freedom);
    return freedom * std::pow(1 - v + 3.09 * std::sqrt(v), 3);
}

struct Fit {
    PoseNetworkResult network;  // pose 0: flange_from_corkscrew, then the imagers
    std::vector<bool> used;
    double factor = 1;                                        // noise over what is stated or assumed
    bool found = false;                                       // a start was
    double median = std::numeric_limits<double>::infinity();  // of the distances of all, in standard deviations

    std::size_t count() const { return static_cast<std::size_t>(std::count(used.begin(), used.end(), true)); }
};

class HandEye {
  public:
    HandEye(const std::vector<HandEyeObservation>& observations, const HandEyeOptions& options)
        : observations_(observations), options_(options) {
        std::map<std::string, int> known;
        for (const HandEyeObservation& one : observations) {
            const auto [place, is_new] = known.emplace(one.imager, static_cast<int>(names_.size()));
            if (is_new) names_.push_back(one.imager);
            position_.push_back(place->second);
            evidence_.push_back(
                one.evidence ? *one.evidence
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

    MotionSpread spread() const { return spreadOf(motions_); }
    const std::vector<std::string>& names() const { return names_; }
    const std::vector<int>& position() const { return position_; }
    bool stated() const { return stated_; }

    Fit solve() const {
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

    SharedLayout sharedLayout() const { return {prior(), names_.size()}; }

  private:
    SharedPrior prior() const { return options_.shared; }

    // For each position of the C-arm the imager that agrees best with its images: the least median of distances.
    std::vector<Rigid3> posesFrom(const Rigid3& flange_from_corkscrew, double* score = nullptr) const {
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
                    const Rigid3 predicted =
                        imager_from_robot * observations_[j].robot_from_flange * flange_from_corkscrew;
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
            if (best_distances.size() > 1)
                distances.insert(distances.end(), best_distances.begin(), best_distances.end());
        }
        if (score) *score = median(distances);
        return poses;
    }

    PoseNetwork network(const std::vector<Rigid3>& poses, const std::vector<bool>& used) const {
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
            result.factors.push_back(
                {{PoseStep::unknown(position_[i] + 1), PoseStep::about(observations_[i].robot_from_flange, robot),
                  PoseStep::unknown(0)},
                 evidence_[i],
                 evidence_[i].shared.size() > 0 ? shared.index[k] : std::vector<int>(),
                 used[i] ? 1.0 : 0.0});
        }
        return result;
    }

    PoseNetworkOptions networkOptions() const {
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

    double freedom(const std::vector<bool>& used) const {
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

    static double sumOfSquares(const PoseNetworkResult& network, const std::vector<bool>& used) {
        double sum = 0;
        for (std::size_t i = 0; i < used.size(); ++i)
            sum += used[i] ? network.squared_distances[i] : 0;
        return sum;
    }

    // The plain solution over some of the images, and the noise it speaks of.
    Fit refine(const std::vector<Rigid3>& start, const std::vector<bool>& used) const {
        Fit fit;
        fit.used = used;
        fit.network = solvePoseNetwork(network(start, used), networkOptions());
        const double free = freedom(used);
        fit.found = free > 0 && std::isfinite(sumOfSquares(fit.network, used));
        if (!fit.found) return fit;
        const double squares = sumOfSquares(fit.network, used);
        const double factor = std::sqrt(squares / free);
        fit.factor = !stated_ ? std::max(factor, 1e-6) : squares > chiSquaredLimit(free) ? factor : 1;
        fit.median = std::sqrt(median(fit.network.squared_distances));
        return fit;
    }

    bool clean(const Fit& fit) const {
        const double limit = kOutlierSquare * fit.factor * fit.factor;
        for (const double d : fit.network.squared_distances)
            if (!(d <= limit)) return false;
        // Unknown noise swallows outliers: only a look without some of the images tells.
        return stated_ ? fit.factor <= 1 : observations_.size() < 5;
    }

    // What the result leaves open of a factor's prediction.
    Matrix6 predictionCovariance(const PoseNetworkResult& result, const PoseFactor& factor) const {
        const Eigen::Index all = result.covariance.rows();
        Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(6, all);
        for (std::size_t s = 0; s < factor.chain.size(); ++s) {
            if (factor.chain[s].variable >= 0)
                jacobian.middleCols(6 * factor.chain[s].variable, 6) += stepDerivative(factor.chain, s, result.poses);
        }
        return jacobian * result.covariance * jacobian.transpose();
    }

    // Images that agree with the answer, judged with the noise of those that do.
    Fit withoutOutliers(Fit fit) const {
        for (int round = 0; round < 10; ++round) {
            // The noise from the better half, so that outliers do not hide each other.
            double robust = std::sqrt(median(fit.network.squared_distances) / kMedianSquare);
            const double share = freedom(fit.used) / (6 * static_cast<double>(fit.count()));
            robust /= std::sqrt(std::max(share, 0.2));
            if (stated_) robust = std::clamp(robust, 1.0, 2.0);
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

    Fit search() const {
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

    const std::vector<HandEyeObservation>& observations_;
    const HandEyeOptions& options_;
    std::vector<std::string> names_;  // of the positions
    std::vector<int> position_;       // of each observation
    std::vector<PoseEvidence> evidence_;
    std::vector<HandEyeMotion> motions_;
    bool stated_ = true;  // the noise of every pose
};

// Root mean squares of those in use.
void measure(const Fit& fit, double& place_mm, double& rotation_rad) {
    double place = 0, rotation = 0, count = 0;
    for (std::size_t i = 0; i < fit.used.size(); ++i) {
        if (!fit.used[i]) continue;
        place += fit.network.residuals[i].head<3>().squaredNorm();
        rotation += fit.network.residuals[i].tail<3>().squaredNorm();
        ++count;
    }
    place_mm = std::sqrt(place / count);
    rotation_rad = std::sqrt(rotation / count);
}

bool contradictory(const Fit& fit, bool stated) {
    if (!fit.found || 2 * fit.count() <= fit.used.size()) return true;
    double place = 0, rotation = 0;
    measure(fit, place, rotation);
    const bool far = place > kContradictionMm || rotation > kContradictionRad;
    return far || (stated && fit.factor > kContradiction);
}

// One simple mistake, undone.
struct Mistake {
    const char* sentence;  // "found: ..., but ... fit"
    void (*undo)(std::vector<HandEyeObservation>&);
};

void replacePose(HandEyeObservation& one, const Rigid3& pose) {
    // What was known of the pose's noise belongs to the pose as it was; its size is all that is asked here.
    one.imager_from_corkscrew = pose;
    one.covariance.reset();
    one.evidence.reset();
}

const Rigid3& poseOf(const HandEyeObservation& one) {
    return one.evidence ? one.evidence->target_from_source : one.imager_from_corkscrew;
}

void scaleRobot(std::vector<HandEyeObservation>& all, double factor) {
    for (HandEyeObservation& one : all)
        one.robot_from_flange = Rigid3(one.robot_from_flange.rotation(), factor * one.robot_from_flange.translation());
}

void shiftRobot(std::vector<HandEyeObservation>& all, std::size_t by) {
    std::vector<Rigid3> poses;
    for (const HandEyeObservation& one : all)
        poses.push_back(one.robot_from_flange);
    for (std::size_t i = 0; i < all.size(); ++i)
        all[i].robot_from_flange = poses[(i + by) % all.size()];
}

const Mistake kMistakes[] = {
    {"the robot poses fit when they are inverted: they seem to be flange_from_robot",
     [](std::vector<HandEyeObservation>& all) {
         for (HandEyeObservation& one : all)
             one.robot_from_flange = one.robot_from_flange.inverse();
     }},
    {"the corkscrew poses fit when they are inverted: they seem to be corkscrew_from_imager",
     [](std::vector<HandEyeObservation>& all) {
         for (HandEyeObservation& one : all)
             replacePose(one, poseOf(one).inverse());
     }},
    {"the poses fit when all are inverted: they seem to be flange_from_robot and corkscrew_from_imager",
     [](std::vector<HandEyeObservation>& all) {
         for (HandEyeObservation& one : all) {
             one.robot_from_flange = one.robot_from_flange.inverse();
             replacePose(one, poseOf(one).inverse());
         }
     }},
    {"the robot poses fit when they are multiplied by 1000: they seem to be in metres",
     [](std::vector<HandEyeObservation>& all) { scaleRobot(all, 1000); }},
    {"the robot poses fit when they are divided by 1000: they seem to be in micrometres",
     [](std::vector<HandEyeObservation>& all) { scaleRobot(all, 0.001); }},
    {"the robot poses fit when they are multiplied by 25.4: they seem to be in inches",
     [](std::vector<HandEyeObservation>& all) { scaleRobot(all, 25.4); }},
    {"the robot poses fit in reverse order",
     [](std::vector<HandEyeObservation>& all) {
         std::vector<Rigid3> poses;
         for (const HandEyeObservation& one : all)
             poses.push_back(one.robot_from_flange);
         for (std::size_t i = 0; i < all.size(); ++i)
             all[i].robot_from_flange = poses[all.size() - 1 - i];
     }},
    {"the robot poses fit when each is taken for the image before it",
     [](std::vector<HandEyeObservation>& all) { shiftRobot(all, 1); }},
    {"the robot poses fit when each is taken for the image after it",
     [](std::vector<HandEyeObservation>& all) { shiftRobot(all, all.size() - 1); }}};

Error contradiction(const std::vector<HandEyeObservation>& observations, const HandEyeOptions& options,
                    const Fit& fit) {
    double place = 0, rotation = 0;
    measure(fit, place, rotation);
    const std::string found =
        fit.found && fit.count() > 0
            ? fmt::format("poses that contradict each other: {} of {} agree, within {:.2g} mm and {:.2g} degrees",
                          fit.count(), fit.used.size(), place, degreesFromRadians(rotation))
            : "poses that contradict each other";
    for (const Mistake& mistake : kMistakes) {
        std::vector<HandEyeObservation> tried = observations;
        mistake.undo(tried);
        // Judged by pose and covariance alone: a start is all that is needed.
        HandEyeOptions plain = options;
        plain.relinearise = nullptr;
        const HandEye problem(tried, plain);
        const Fit other = problem.solve();
        if (contradictory(other, problem.stated()) || 5 * other.count() < 4 * other.used.size()) continue;
        double other_place = 0, other_rotation = 0;
        measure(other, other_place, other_rotation);
        if (fit.found && fit.count() > fit.used.size() / 2 &&
            !(5 * other_place < place || 5 * other_rotation < rotation))
            continue;
        return invalidInput(
            kWhere, found,
            fmt::format("robot_from_flange and imager_from_corkscrew of the same moment, in mm; {}", mistake.sentence),
            "correct the file");
    }
    return noSolution(kWhere, found, "one place of the corkscrew on the flange that explains the images",
                      "see whether the robot poses are in another order or unit, and whether C-arm or corkscrew moved");
}

std::string names(const std::vector<HandEyeObservation>& observations, const std::vector<bool>& which, bool value) {
    std::string text;
    for (std::size_t i = 0; i < which.size(); ++i)
        if (which[i] == value) text += (text.empty() ? "" : ", ") + observations[i].name;
    return text;
}

// Two images left out that fit with each other's robot pose.
bool fitExchanged(const std::vector<HandEyeObservation>& observations, const Fit& fit, const std::vector<int>& position,
                  std::size_t a, std::size_t b) {
    const auto distance = [&](std::size_t image, std::size_t robot) {
        const Rigid3 predicted = fit.network.poses[static_cast<std::size_t>(position[image]) + 1] *
                                 observations[robot].robot_from_flange * fit.network.poses[0];
        const Vector6 d = predicted.deltaFrom(poseOf(observations[image]));
        return Vector2(d.head<3>().norm(), d.tail<3>().norm());
    };
    for (const auto& [i, j] : {std::pair(a, b), std::pair(b, a)}) {
        const Vector2 own = distance(i, i), other = distance(i, j);
        if (!(other.x() < 0.2 * own.x() && other.y() < 0.2 * own.y() + 1e-3)) return false;
    }
    return true;
}

void describeWeakness(HandEyeCalibration& result, const HandEyeLimits& limits) {
    const Matrix6& covariance = *result.flange_from_corkscrew.covariance;
    const Eigen::SelfAdjointEigenSolver<Matrix3> place(covariance.topLeftCorner<3, 3>());
    const Eigen::SelfAdjointEigenSolver<Matrix3> rotation(covariance.bottomRightCorner<3, 3>());
    result.worst_place_mm = std::sqrt(std::max(0.0, place.eigenvalues()[2]));
    result.worst_rotation_rad = std::sqrt(std::max(0.0, rotation.eigenvalues()[2]));
    if (!(result.worst_place_mm <= limits.most_place_mm)) {
        result.weak_directions.push_back(fmt::format(
            "the corkscrew's place along {} is known to {:.2g} mm only: turn the flange about axes across it",
            axisInWords(place.eigenvectors().col(2), "flange"), result.worst_place_mm));
    }
    if (!(result.worst_rotation_rad <= limits.most_rotation_rad)) {
        result.weak_directions.push_back(fmt::format(
            "the corkscrew's rotation about {} is known to {:.2g} degrees only: take more images, with larger turns",
            axisInWords(rotation.eigenvectors().col(2), "flange"), degreesFromRadians(result.worst_rotation_rad)));
    }
}

Result<void> check(const std::vector<HandEyeObservation>& observations, const HandEyeOptions& options) {
    if (Result<void> valid = options.validate(); !valid) return valid;
    for (const HandEyeObservation& one : observations) {
        if (one.evidence && one.evidence->shared.size() != options.shared.size()) {
            return invalidInput(one.name, fmt::format("{} shared parameters", one.evidence->shared.size()),
                                fmt::format("{}", options.shared.size()));
        }
        const Matrix6 covariance = one.evidence     ? one.evidence->covariance()
                                   : one.covariance ? *one.covariance
                                                    : Matrix6::Identity();
        if (!(covariance.allFinite() && Eigen::LLT<Matrix6>(covariance).info() == Eigen::Success)) {
            return invalidInput(one.name + ", covariance", "a matrix with a direction of no or negative variance",
                                "a positive definite 6x6 matrix", "leave it out when the noise is not known");
        }
    }
    return {};
}

}  // namespace

std::size_t HandEyeCalibration::used() const {
    return static_cast<std::size_t>(
        std::count_if(residuals.begin(), residuals.end(), [](const HandEyeResidual& one) { return !one.rejected; }));
}

Result<void> HandEyeLimits::validate() const {
    return requireRanges({{"most_place_mm", most_place_mm, 0, 1000, "mm"},
                          {"most_rotation_rad", most_rotation_rad, 0, 3.2, "rad"},
                          {"most_noise_factor", most_noise_factor, 0, 1e6, ""},
                          {"least_share", least_share, 0, 1, ""}});
}

Result<void> HandEyeOptions::validate() const {
    if (Result<void> valid = assumed.validate(); !valid) return valid;
    if (Result<void> valid = shared.validate(); !valid) return valid;
    if (Result<void> valid = limits.validate(); !valid) return valid;
    return requireRanges({{"robot_place_mm", robot_place_mm, 0, 100, "mm"},
                          {"robot_rotation_rad", robot_rotation_rad, 0, 1, "rad"},
                          {"least_turn_rad", least_turn_rad, 1e-4, 3, "rad"}});
}

Result<HandEyeCalibration> calibrateHandEye(const std::vector<HandEyeObservation>& observations,
                                            const HandEyeOptions& options, Progress& progress) {
    const auto start = std::chrono::steady_clock::now();
    if (const Result<void> valid = check(observations, options); !valid) return valid.error();
    const HandEye problem(observations, options);
    if (const Result<void> enough =
            requireSpread(problem.spread(), observations.size(), problem.names().size(), options.least_turn_rad);
        !enough)
        return enough.error();
    progress.report(0.1, "Calibrating robot and corkscrew");
    const Fit fit = problem.solve();
    if (progress.isCancelled()) return cancelled(kWhere);
    if (contradictory(fit, problem.stated())) return contradiction(observations, options, fit);

    HandEyeCalibration result;
    const double inflation = fit.factor * fit.factor;
    result.covariance = inflation * fit.network.covariance;
    result.flange_from_corkscrew = {Frame::flange, Frame::corkscrew, fit.network.poses[0],
                                    Matrix6(result.covariance.topLeftCorner<6, 6>())};
    const SharedLayout shared = problem.sharedLayout();
    const Eigen::Index of_poses = 6 * static_cast<Eigen::Index>(fit.network.poses.size());
    for (std::size_t k = 0; k < problem.names().size(); ++k) {
        const Eigen::Index at = 6 * static_cast<Eigen::Index>(k + 1);
        result.imagers.push_back(
            {problem.names()[k],
             {Frame::imager, Frame::robot, fit.network.poses[k + 1], Matrix6(result.covariance.block<6, 6>(at, at))}});
        result.shared.push_back(shared.valuesOf(fit.network.shared, k));
    }
    const std::vector<int>& first = shared.index.front();
    result.shared_covariance.resize(static_cast<Eigen::Index>(first.size()), static_cast<Eigen::Index>(first.size()));
    for (std::size_t i = 0; i < first.size(); ++i)
        for (std::size_t j = 0; j < first.size(); ++j)
            result.shared_covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
                result.covariance(of_poses + first[i], of_poses + first[j]);
    for (std::size_t i = 0; i < observations.size(); ++i) {
        const Vector6& r = fit.network.residuals[i];
        result.residuals.push_back({observations[i].name, r, r.head<3>().norm(), r.tail<3>().norm(),
                                    std::sqrt(fit.network.squared_distances[i]) / fit.factor, !fit.used[i]});
    }
    measure(fit, result.rms_place_mm, result.rms_rotation_rad);
    result.noise_factor = fit.factor;
    describeWeakness(result, options.limits);

    if (fit.count() < fit.used.size()) {
        result.warnings.push_back("left out, because they contradict the others: " +
                                  names(observations, fit.used, false));
        for (std::size_t a = 0; a < fit.used.size(); ++a) {
            for (std::size_t b = a + 1; b < fit.used.size(); ++b) {
                if (!fit.used[a] && !fit.used[b] && fitExchanged(observations, fit, problem.position(), a, b)) {
                    result.warnings.push_back(
                        fmt::format("{} and {} fit with each other's robot pose: were they swapped?",
                                    observations[a].name, observations[b].name));
                }
            }
        }
    }
    for (std::size_t k = 0; k < problem.names().size(); ++k) {
        std::size_t images = 0;
        for (std::size_t i = 0; i < fit.used.size(); ++i)
            images += problem.position()[i] == static_cast<int>(k) && fit.used[i];
        if (images < 2) {
            result.warnings.push_back(
                fmt::format("the C-arm's position {} has {} image{}: it adds nothing to the calibration",
                            problem.names()[k], images, images == 1 ? "" : "s"));
        }
    }
    if (problem.stated() && fit.factor > 1) {
        result.warnings.push_back(fmt::format(
            "the images disagree by {:.1f} times what their covariances allow; the result's covariance is inflated",
            fit.factor));
    }
    if (!problem.stated() && observations.size() < 5)
        result.warnings.push_back("the noise is estimated from few poses: so are the standard deviations");
    result.acceptance = {atMost("standard deviation of the corkscrew's place", result.worst_place_mm,
                                options.limits.most_place_mm, "mm"),
                         atMost("standard deviation of its rotation", degreesFromRadians(result.worst_rotation_rad),
                                degreesFromRadians(options.limits.most_rotation_rad), "degrees"),
                         atLeast("share of images that agree",
                                 static_cast<double>(fit.count()) / static_cast<double>(observations.size()),
                                 options.limits.least_share, "")};
    if (problem.stated()) {
        result.acceptance.push_back(
            atMost("noise over what was stated", fit.factor, options.limits.most_noise_factor, ""));
    }
    result.elapsed_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    progress.report(1, "Calibrating robot and corkscrew");
    return result;
}

}  // namespace fluorocut
