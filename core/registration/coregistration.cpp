#include "core/registration/coregistration.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "core/base/chi_square.h"
#include "core/base/option_checks.h"
#include "core/base/stopwatch.h"
#include "core/base/units.h"
#include "core/registration/pose_network.h"

namespace fluorocut {
namespace {

const char* const kWhere = "co-registration of views";

// Views that contradict each other with less than this probability do.
constexpr double kUnlikely = 1e-4;
// Rotations between views may differ so much from what the C-arm's scales say; an exchange is named when it brings
// them from beyond the one to within the other.
constexpr double kScalesWrong = 0.349, kScalesRight = 0.175;  // 20 and 10 degrees

const Rigid3& poseOf(const CoregistrationView& view) {
    return view.evidence ? view.evidence->target_from_source : view.imager_from_corkscrew;
}

// The part of a view that comes from its image.
void exchangeImages(CoregistrationView& a, CoregistrationView& b) {
    std::swap(a.imager_from_corkscrew, b.imager_from_corkscrew);
    std::swap(a.covariance, b.covariance);
    std::swap(a.evidence, b.evidence);
}

class Views {
  public:
    Views(const std::vector<CoregistrationView>& views, const CoregistrationOptions& options)
        : views_(views), options_(options) {
        std::map<std::string, int> known;
        for (const CoregistrationView& view : views) {
            const bool own = view.position.empty();
            const auto next = static_cast<int>(positions_);
            const int k = own ? next : known.emplace(view.position, next).first->second;
            if (k == next) ++positions_;
            position_.push_back(k);
        }
        moved_ = !views.empty() && views[0].robot_from_flange && options.flange_from_corkscrew;
    }

    bool moved() const { return moved_; }
    std::size_t positions() const { return positions_; }
    int position(std::size_t view) const { return position_[view]; }
    int degreesOfFreedom() const { return 6 * (static_cast<int>(views_.size()) - static_cast<int>(positions_)); }
    SharedLayout shared() const { return {options_.shared, positions_}; }

    PoseNetwork network() const {
        const SharedLayout parameters = shared();
        Matrix6 robot = Matrix6::Zero();
        robot.diagonal().head<3>().setConstant(options_.robot_place_mm * options_.robot_place_mm);
        robot.diagonal().tail<3>().setConstant(options_.robot_rotation_rad * options_.robot_rotation_rad);
        PoseNetwork network;
        network.poses.resize(positions_);
        network.shared = parameters.mean;
        network.shared_information = parameters.information;
        // The mount is the same in all views: known well or not, it is an unknown with a prior of its own.
        const bool mount = moved_ && options_.flange_from_corkscrew->covariance &&
                           !options_.flange_from_corkscrew->covariance->isZero(0);
        const int mount_index = static_cast<int>(positions_);
        if (moved_ && mount) network.poses.push_back(options_.flange_from_corkscrew->target_from_source);
        for (std::size_t i = 0; i < views_.size(); ++i) {
            const CoregistrationView& view = views_[i];
            PoseFactor factor;
            factor.chain = {PoseStep::unknown(position_[i])};
            if (moved_) {
                factor.chain.push_back(PoseStep::about(*view.robot_from_flange, robot));
                factor.chain.push_back(mount ? PoseStep::unknown(mount_index)
                                             : PoseStep::exactly(options_.flange_from_corkscrew->target_from_source));
            }
            factor.evidence =
                view.evidence ? *view.evidence
                              : evidenceOf(view.imager_from_corkscrew,
                                           view.covariance ? *view.covariance
                                                           : options_.assumed.covarianceAt(view.imager_from_corkscrew));
            if (view.evidence && view.evidence->shared.size() > 0)
                factor.shared = parameters.index[static_cast<std::size_t>(position_[i])];
            // A start for the imager: what this view alone says.
            network.poses[static_cast<std::size_t>(position_[i])] = poseOf(view) * baseFromCorkscrew(i).inverse();
            network.factors.push_back(std::move(factor));
        }
        if (mount) {
            network.factors.push_back({{PoseStep::unknown(mount_index)},
                                       evidenceOf(options_.flange_from_corkscrew->target_from_source,
                                                  *options_.flange_from_corkscrew->covariance),
                                       {},
                                       1});
        }
        return network;
    }

    PoseNetworkOptions networkOptions() const {
        PoseNetworkOptions result;
        if (options_.relinearise) {
            result.relinearise = [this](std::size_t i, const Rigid3& pose, const Eigen::VectorXd& parameters) {
                if (i >= views_.size() || !views_[i].evidence) return PoseEvidence();
                Result<PoseEvidence> answer = options_.relinearise(i, pose, parameters);
                return answer ? std::move(*answer) : PoseEvidence();
            };
        }
        return result;
    }

    Rigid3 baseFromCorkscrew(std::size_t i) const {
        if (!moved_) return Rigid3::identity();
        return *views_[i].robot_from_flange * options_.flange_from_corkscrew->target_from_source;
    }

  private:
    const std::vector<CoregistrationView>& views_;
    const CoregistrationOptions& options_;
    std::vector<int> position_;
    std::size_t positions_ = 0;
    bool moved_ = false;
};

double chiSquareOf(const PoseNetworkResult& result) {
    double sum = 0;
    for (const double d : result.squared_distances)
        sum += d;
    return sum;
}

// Of how likely views are to disagree as they do; 1 where nothing could disagree.
double likelihood(const std::vector<CoregistrationView>& views, const CoregistrationOptions& options) {
    const Views problem(views, options);
    if (problem.degreesOfFreedom() <= 0) return 1;
    return chiSquareTail(chiSquareOf(solvePoseNetwork(problem.network())), problem.degreesOfFreedom());
}

// The largest angle between the views' rotations relative to each other and what the C-arm's scales say.
double offScales(const std::vector<CoregistrationView>& views, const Views& problem) {
    double worst = 0;
    for (std::size_t i = 0; i < views.size(); ++i) {
        for (std::size_t j = i + 1; j < views.size(); ++j) {
            if (!views[i].imager_from_room || !views[j].imager_from_room) continue;
            const Rigid3 seen = poseOf(views[i]) * problem.baseFromCorkscrew(i).inverse() *
                                (poseOf(views[j]) * problem.baseFromCorkscrew(j).inverse()).inverse();
            const Rigid3 scales = *views[i].imager_from_room * views[j].imager_from_room->inverse();
            worst = std::max(
                worst,
                (seen.rotation() * scales.rotation().conjugate()).angularDistance(Eigen::Quaterniond::Identity()));
        }
    }
    return worst;
}

Result<void> check(const std::vector<CoregistrationView>& views, const CoregistrationOptions& options) {
    if (Result<void> valid = options.validate(); !valid) return valid;
    if (views.size() < 2) {
        return noSolution(kWhere, fmt::format("{} view{}", views.size(), views.size() == 1 ? "" : "s"),
                          "two or more views of one corkscrew");
    }
    bool differ = false;
    for (const CoregistrationView& view : views) {
        if (view.robot_from_flange.has_value() != views[0].robot_from_flange.has_value()) {
            return invalidInput(view.robot_from_flange ? views[0].name : view.name,
                                "no robot pose, and others have one", "the robot's pose of every view, or of none");
        }
        if (view.robot_from_flange) {
            const Vector6 apart = view.robot_from_flange->deltaFrom(*views[0].robot_from_flange);
            differ |= apart.head<3>().norm() > 1e-6 || apart.tail<3>().norm() > 1e-9;
        }
        if (view.evidence && view.evidence->shared.size() != options.shared.size()) {
            return invalidInput(view.name, fmt::format("{} shared parameters", view.evidence->shared.size()),
                                fmt::format("{}", options.shared.size()));
        }
        const Matrix6 covariance = view.evidence     ? view.evidence->covariance()
                                   : view.covariance ? *view.covariance
                                                     : Matrix6::Identity();
        if (!(covariance.allFinite() && Eigen::LLT<Matrix6>(covariance).info() == Eigen::Success)) {
            return invalidInput(view.name + ", covariance", "a matrix with a direction of no or negative variance",
                                "a positive definite 6x6 matrix", "leave it out when the noise is not known");
        }
    }
    if (differ && !options.flange_from_corkscrew) {
        return invalidInput(kWhere, "a robot that moved between the views, and no flange_from_corkscrew",
                            "where the corkscrew sits on the flange", "measure it with calibrate robot");
    }
    return {};
}

// Views that fit once two of them are exchanged, or none.
std::optional<std::pair<std::size_t, std::size_t>> findExchange(
    const std::vector<CoregistrationView>& views,
    const std::function<bool(const std::vector<CoregistrationView>&)>& fits) {
    std::optional<std::pair<std::size_t, std::size_t>> found;
    for (std::size_t i = 0; i < views.size(); ++i) {
        for (std::size_t j = i + 1; j < views.size(); ++j) {
            std::vector<CoregistrationView> tried = views;
            exchangeImages(tried[i], tried[j]);
            if (!fits(tried)) continue;
            if (found) return std::nullopt;  // not to be told
            found = {i, j};
        }
    }
    return found;
}

Result<void> checkOrder(const std::vector<CoregistrationView>& views, const CoregistrationOptions& options) {
    const Views problem(views, options);
    const auto swapped = [&](const std::pair<std::size_t, std::size_t>& pair, const std::string& found,
                             const std::string& expected) {
        return invalidInput(fmt::format("views {} ({}) and {} ({})", pair.first + 1, views[pair.first].name,
                                        pair.second + 1, views[pair.second].name),
                            found + "; with the two images exchanged they fit: they seem to be swapped", expected,
                            "give each image its own C-arm and robot pose");
    };
    // What the C-arm's scales say of the views' directions.
    const double off = offScales(views, problem);
    if (off > kScalesWrong) {
        const auto pair = findExchange(views, [&](const std::vector<CoregistrationView>& tried) {
            return offScales(tried, Views(tried, options)) < kScalesRight;
        });
        if (pair) {
            return swapped(
                *pair, fmt::format("rotations that miss the C-arm's scales by {:.0f} degrees", degreesFromRadians(off)),
                "views turned against each other as the scales say");
        }
    }
    if (likelihood(views, options) < kUnlikely) {
        const auto pair = findExchange(views, [&](const std::vector<CoregistrationView>& tried) {
            return likelihood(tried, options) > kUnlikely;
        });
        if (pair)
            return swapped(*pair, "poses that contradict the robot's motion", "poses that follow the robot's motion");
    }
    return {};
}

// ", which ends when view 3 (c.png) is left out"; empty when none or several views do that.
std::string culprit(const std::vector<CoregistrationView>& views, const CoregistrationOptions& options) {
    std::string text;
    for (std::size_t i = 0; i < views.size(); ++i) {
        std::vector<CoregistrationView> others = views;
        others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
        if (!(likelihood(others, options) > kUnlikely)) continue;
        if (!text.empty()) return {};
        text = fmt::format(", which ends when view {} ({}) is left out", i + 1, views[i].name);
    }
    return text;
}

Vector3 directionOf(const Rigid3& imager_from_base) {
    return imager_from_base.inverse().rotate(Vector3::UnitZ());
}

// Opposite views see the same lines: between 0 and 90 degrees.
double angleBetween(const Vector3& a, const Vector3& b) {
    return std::atan2(a.cross(b).norm(), std::abs(a.dot(b)));
}

std::string sameDirection(const std::vector<CoregistrationView>& views, std::size_t i, std::size_t j, double angle) {
    return fmt::format("views {} ({}) and {} ({}) look from the same direction ({:.1f} degrees apart)", i + 1,
                       views[i].name, j + 1, views[j].name, degreesFromRadians(angle));
}

// The rows of the derivative of each view_from_first by the network's poses.
Eigen::MatrixXd relativeDerivative(const Views& problem, std::size_t views, const PoseNetworkResult& solved) {
    Eigen::MatrixXd jacobian =
        Eigen::MatrixXd::Zero(6 * (static_cast<Eigen::Index>(views) - 1), solved.covariance.cols());
    for (std::size_t i = 1; i < views; ++i) {
        if (problem.position(i) == problem.position(0)) continue;
        const std::vector<PoseStep> chain{PoseStep::unknown(problem.position(i)),
                                          PoseStep::inverseOf(problem.position(0))};
        const Eigen::Index row = 6 * (static_cast<Eigen::Index>(i) - 1);
        jacobian.block<6, 6>(row, 6 * problem.position(i)) = stepDerivative(chain, 0, solved.poses);
        jacobian.block<6, 6>(row, 6 * problem.position(0)) = stepDerivative(chain, 1, solved.poses);
    }
    return jacobian;
}

double worstSigma(const Matrix3& covariance) {
    const double value = Eigen::SelfAdjointEigenSolver<Matrix3>(covariance, Eigen::EigenvaluesOnly).eigenvalues()[2];
    return std::sqrt(std::max(0.0, value));
}

void describeViews(const std::vector<CoregistrationView>& views, const Views& problem, const PoseNetworkResult& solved,
                   Coregistration& result) {
    const Eigen::MatrixXd jacobian = relativeDerivative(problem, views.size(), solved);
    result.covariance = jacobian * solved.covariance * jacobian.transpose();
    const SharedLayout shared = problem.shared();
    const Eigen::Index of_poses = 6 * static_cast<Eigen::Index>(solved.poses.size());
    const Rigid3& first = solved.poses[static_cast<std::size_t>(problem.position(0))];
    for (std::size_t i = 0; i < views.size(); ++i) {
        const auto k = static_cast<std::size_t>(problem.position(i));
        CoregisteredView view;
        view.name = views[i].name;
        view.imager_from_base = {Frame::imager, problem.moved() ? Frame::robot : Frame::corkscrew, solved.poses[k],
                                 solved.covarianceOf(static_cast<int>(k))};
        view.view_from_first = {Frame::imager, Frame::imager, solved.poses[k] * first.inverse(), Matrix6::Zero()};
        if (i > 0) {
            const Eigen::Index at = 6 * (static_cast<Eigen::Index>(i) - 1);
            view.view_from_first.covariance = result.covariance.block<6, 6>(at, at);
        }
        const Rigid3 base_from_corkscrew = problem.baseFromCorkscrew(i);
        view.imager_from_corkscrew = {Frame::imager, Frame::corkscrew, solved.poses[k] * base_from_corkscrew,
                                      std::nullopt};
        view.shared = shared.valuesOf(solved.shared, k);
        view.shared_sigma = view.shared;
        for (std::size_t p = 0; p < shared.index[k].size(); ++p) {
            const Eigen::Index at = of_poses + shared.index[k][p];
            view.shared_sigma[static_cast<Eigen::Index>(p)] = std::sqrt(solved.covariance(at, at));
        }
        view.seen_minus_predicted = solved.residuals[i];
        view.angle_to_first_rad = angleBetween(directionOf(solved.poses[k]), directionOf(first));
        view.worst_place_mm =
            worstSigma(pointCovariance(view.view_from_first, first * base_from_corkscrew.translation()));
        view.worst_rotation_rad = worstSigma(view.view_from_first.covariance->bottomRightCorner<3, 3>());
        result.views.push_back(std::move(view));
    }
}

}  // namespace

Result<void> CoregistrationLimits::validate() const {
    return requireRanges({{"most_place_mm", most_place_mm, 0, 1000, "mm"},
                          {"most_rotation_rad", most_rotation_rad, 0, 3.2, "rad"},
                          {"least_angle_rad", least_angle_rad, 0, 1.5708, "rad"}});
}

Result<void> CoregistrationOptions::validate() const {
    if (Result<void> valid = assumed.validate(); !valid) return valid;
    if (Result<void> valid = shared.validate(); !valid) return valid;
    if (Result<void> valid = limits.validate(); !valid) return valid;
    return requireRanges({{"robot_place_mm", robot_place_mm, 0, 100, "mm"},
                          {"robot_rotation_rad", robot_rotation_rad, 0, 1, "rad"},
                          {"same_direction_rad", same_direction_rad, 0, 1.5708, "rad"}});
}

Result<Coregistration> coregisterViews(const std::vector<CoregistrationView>& views,
                                       const CoregistrationOptions& options, Progress& progress) {
    const Stopwatch stopwatch;
    if (const Result<void> valid = check(views, options); !valid) return valid.error();
    progress.report(0, "Co-registering views");
    if (const Result<void> order = checkOrder(views, options); !order) return order.error();
    if (progress.isCancelled()) return cancelled(kWhere);
    const Views problem(views, options);
    const PoseNetwork network = problem.network();
    const PoseNetworkResult solved = solvePoseNetwork(network, problem.networkOptions());

    Coregistration result;
    result.base = problem.moved() ? Frame::robot : Frame::corkscrew;
    result.degrees_of_freedom = problem.degreesOfFreedom();
    if (result.degrees_of_freedom > 0) {
        result.chi_square = chiSquareOf(solved);
        if (chiSquareTail(result.chi_square, result.degrees_of_freedom) < kUnlikely) {
            result.warnings.push_back(
                fmt::format("the views contradict each other ({:.1f} times their noise){}: did C-arm, corkscrew or "
                            "patient move?",
                            std::sqrt(result.chi_square / result.degrees_of_freedom), culprit(views, options)));
        }
    }
    const bool scales = std::all_of(views.begin(), views.end(),
                                    [](const CoregistrationView& view) { return view.imager_from_room.has_value(); });
    if (problem.moved() && result.degrees_of_freedom == 0 && !scales) {
        result.warnings.push_back(
            "nothing tells whether each image has its own robot pose: give the C-arm's angles, or two shots with the "
            "C-arm at rest; beads in the bone, registered with these views, tell it too");
    }
    describeViews(views, problem, solved, result);

    result.widest_angle_rad = 0;
    std::pair<std::size_t, std::size_t> widest{0, 1};
    for (std::size_t i = 0; i < views.size(); ++i) {
        for (std::size_t j = i + 1; j < views.size(); ++j) {
            const double angle = angleBetween(directionOf(result.views[i].imager_from_base.target_from_source),
                                              directionOf(result.views[j].imager_from_base.target_from_source));
            if (angle > result.widest_angle_rad) {
                result.widest_angle_rad = angle;
                widest = {i, j};
            }
            if (angle < options.same_direction_rad && problem.position(i) != problem.position(j))
                result.warnings.push_back(sameDirection(views, i, j, angle));
        }
    }
    if (result.widest_angle_rad < options.same_direction_rad) {
        return noSolution(kWhere, sameDirection(views, widest.first, widest.second, result.widest_angle_rad),
                          fmt::format("views at least {:.0f} degrees apart: depth is not determined otherwise",
                                      degreesFromRadians(options.same_direction_rad)),
                          "turn the C-arm by 30 to 90 degrees between the views");
    }
    double place = 0, rotation = 0;
    for (const CoregisteredView& view : result.views) {
        place = std::max(place, view.worst_place_mm);
        rotation = std::max(rotation, view.worst_rotation_rad);
    }
    result.acceptance = {
        atMost("standard deviation of a point carried from the first view", place, options.limits.most_place_mm, "mm"),
        atMost("standard deviation of a view's rotation", degreesFromRadians(rotation),
               degreesFromRadians(options.limits.most_rotation_rad), "degrees"),
        atLeast("angle between the views that differ most", degreesFromRadians(result.widest_angle_rad),
                degreesFromRadians(options.limits.least_angle_rad), "degrees")};
    if (result.degrees_of_freedom > 0) {
        result.acceptance.push_back(atLeast("probability of the views' disagreement",
                                            chiSquareTail(result.chi_square, result.degrees_of_freedom), kUnlikely,
                                            ""));
    }
    result.elapsed_ms = stopwatch.ms();
    progress.report(1, "Co-registering views");
    return result;
}

}  // namespace fluorocut
