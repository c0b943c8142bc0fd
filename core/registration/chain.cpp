#include "core/registration/chain.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "core/base/chi_square.h"
#include "core/base/option_checks.h"
#include "core/base/units.h"
#include "core/geometry/point_error.h"
#include "core/registration/chain_system.h"

namespace fluorocut {
namespace {

using chain::Solution;
using chain::Source;
using chain::System;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double probabilityOf(double chi_square, int degrees) {
    return degrees > 0 ? chiSquareTail(std::max(chi_square, 0.0), degrees) : kNaN;
}

int degreesOf(std::size_t views) {
    return 6 * (static_cast<int>(views) - 1);
}

void requireFrames(const Pose& pose, Frame target, Frame source) {
    if (pose.target != target || pose.source != source) {
        throw std::logic_error("solveChain: a pose " + std::string(name(pose.target)) + "_from_" +
                               std::string(name(pose.source)) + " where " + std::string(name(target)) + "_from_" +
                               std::string(name(source)) + " belongs");
    }
}

Result<void> check(const std::string& where, const std::optional<Matrix6>& covariance) {
    if (!covariance) return {};
    if (!covariance->allFinite()) {
        return invalidInput(where, "a covariance that is not finite", "a finite one",
                            "the pose is not determined by what it was measured from: see its own report");
    }
    const double least = Eigen::SelfAdjointEigenSolver<Matrix6>(*covariance, Eigen::EigenvaluesOnly).eigenvalues()[0];
    if (!(least >= -1e-5 * covariance->cwiseAbs().maxCoeff()))
        return invalidInput(where, "a covariance with a negative variance", "a positive semi-definite one");
    return {};
}

Result<void> check(const ChainProblem& problem) {
    const std::string where = "registration chain";
    if (problem.views.empty()) return invalidInput(where, "no views", "at least one");
    requireFrames(problem.flange_from_corkscrew, Frame::flange, Frame::corkscrew);
    if (const auto good = check("flange_from_corkscrew", problem.flange_from_corkscrew.covariance); !good)
        return good.error();
    std::set<std::string> names;
    for (const ChainView& view : problem.views) {
        if (!names.insert(view.name).second)
            return invalidInput(where, "two views of the name \"" + view.name + "\"", "a name for each view");
        requireFrames(view.imager_from_corkscrew.pose, Frame::imager, Frame::corkscrew);
        requireFrames(view.imager_from_femur.pose, Frame::imager, Frame::femur);
        requireFrames(view.robot_from_flange, Frame::robot, Frame::flange);
        for (const auto& [what, measurement] : {std::pair{"imager_from_corkscrew", &view.imager_from_corkscrew},
                                                std::pair{"imager_from_femur", &view.imager_from_femur}}) {
            const std::string field = "view " + view.name + ", " + what;
            if (!measurement->pose.covariance) {
                return invalidInput(field, "no covariance", "the pose's covariance",
                                    "without it nobody knows how much this view is worth beside the others");
            }
            if (const auto good = check(field, measurement->pose.covariance); !good) return good.error();
            const auto columns = static_cast<Eigen::Index>(measurement->parameters.size());
            if (measurement->sensitivity.cols() != columns || (columns > 0 && measurement->sensitivity.rows() != 6))
                throw std::logic_error("solveChain: a sensitivity of another size than its parameters");
            for (const std::size_t index : measurement->parameters) {
                if (index >= problem.parameters.size()) throw std::logic_error("solveChain: no such parameter");
            }
        }
        if (const auto good = check("view " + view.name + ", robot_from_flange", view.robot_from_flange.covariance);
            !good)
            return good.error();
    }
    return {};
}

double viewAngle(const Vector3& a, const Vector3& b) {
    return std::atan2(a.cross(b).norm(), std::abs(a.dot(b)));
}

Vector3 beamInRobot(const ChainProblem& problem, const ChainView& view) {
    return (view.robot_from_flange.target_from_source * problem.flange_from_corkscrew.target_from_source *
            view.imager_from_corkscrew.pose.target_from_source.inverse())
        .rotate(Vector3::UnitZ());
}

double chiSquareOf(const ChainProblem& problem, const std::vector<std::size_t>& views) {
    return views.size() < 2 ? 0 : chain::solve(chain::buildSystem(problem, views)).chi_square;
}

// Views that belong together only after something of two of them is exchanged.
std::optional<Error> exchanged(const ChainProblem& problem, const ChainOptions& options, double chi_square,
                               const Vector3& point) {
    const std::size_t count = problem.views.size();
    std::vector<std::size_t> all(count);
    std::iota(all.begin(), all.end(), std::size_t{0});
    struct Exchange {
        const char* what;
        void (*apply)(ChainView&, ChainView&);
    };
    const Exchange exchanges[] = {
        {"robot poses", [](ChainView& a, ChainView& b) { std::swap(a.robot_from_flange, b.robot_from_flange); }},
        {"poses of the femur", [](ChainView& a, ChainView& b) { std::swap(a.imager_from_femur, b.imager_from_femur); }},
        {"poses of the corkscrew",
         [](ChainView& a, ChainView& b) { std::swap(a.imager_from_corkscrew, b.imager_from_corkscrew); }}};
    double best = options.outlier_probability;
    std::optional<Error> error;
    const auto spread = [&](const ChainProblem& of) {
        const System system = chain::buildSystem(of, all);
        double most = 0;
        for (const Rigid3& a : system.answers)
            for (const Rigid3& b : system.answers)
                most = std::max(most, (a * point - b * point).norm());
        return most;
    };
    for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t j = i + 1; j < count; ++j) {
            for (const Exchange& exchange : exchanges) {
                ChainProblem other = problem;
                exchange.apply(other.views[i], other.views[j]);
                const double probability = probabilityOf(chiSquareOf(other, all), degreesOf(count));
                if (!(probability > best)) continue;
                best = probability;
                error = noSolution(
                    "registration chain",
                    fmt::format("views that contradict each other by {:.3g} mm (chi-square {:.3g}, {} degrees of "
                                "freedom), but agree within {:.2g} mm once the {} of {} and {} are exchanged",
                                spread(problem), chi_square, degreesOf(count), spread(other), exchange.what,
                                problem.views[i].name, problem.views[j].name),
                    "each image with its own poses",
                    fmt::format("exchange the {} of {} and {}", exchange.what, problem.views[i].name,
                                problem.views[j].name));
            }
        }
    }
    return error;
}

std::vector<ChainTerm> termsOf(const ChainProblem& problem, const System& system, const Solution& solution) {
    std::vector<ChainTerm> terms;
    const auto add = [&](std::string name, std::string view, const Source& source, Eigen::Index first,
                         Eigen::Index count) {
        const Eigen::MatrixXd by_error = solution.gain * source.effect;
        const Matrix6 half =
            by_error.middleCols(first, count) * source.covariance.middleRows(first, count) * by_error.transpose();
        const Matrix6 part = 0.5 * (half + half.transpose());
        if (part.cwiseAbs().maxCoeff() > 0) terms.push_back({std::move(name), std::move(view), part});
    };
    for (const Source& source : system.sources) {
        const std::string& view = problem.views[source.view].name;
        switch (source.kind) {
            case Source::Kind::corkscrew:
                add("corkscrew, in-plane", view, source, 0, 2);
                add("corkscrew, depth", view, source, 2, 1);
                add("corkscrew, rotation", view, source, 3, 3);
                break;
            case Source::Kind::beads:
                add("beads", view, source, 0, 6);
                break;
            case Source::Kind::robot:
                add("robot's pose", view, source, 0, 6);
                break;
            case Source::Kind::hand_eye:
                add("hand-eye calibration", "", source, 0, 6);
                break;
            case Source::Kind::parameters:
                add(problem.parameters[source.parameters.front()].group, "", source, 0, source.covariance.rows());
                break;
        }
    }
    return terms;
}

}  // namespace

Result<void> ChainLimits::validate() const {
    return requireRanges(
        {{"most_radius95_mm", most_radius95_mm, 0, 1000, "mm"}, {"least_probability", least_probability, 0, 1, ""}});
}

Result<void> ChainOptions::validate() const {
    if (const Result<void> good = limits.validate(); !good) return good;
    if (points.empty()) return invalidOption("points", "none", "at least one point whose error is wanted");
    for (const NamedPoint& point : points) {
        if (!(point.in_femur.cwiseAbs().maxCoeff() <= 1e4))
            return invalidOption("points, " + point.name, "a coordinate out of range", "at most 10000 mm");
    }
    return requireRanges({{"least_view_angle_rad", least_view_angle_rad, 0, std::numbers::pi / 2, "rad"},
                          {"outlier_probability", outlier_probability, 0, 0.5, ""}});
}

ChainViewResult::ChainViewResult()
    : residual(Vector6::Constant(kNaN)),
      residual_mm(kNaN),
      chi_square(kNaN),
      probability(kNaN),
      beam_in_robot(Vector3::Constant(kNaN)) {}

Chain::Chain() : chi_square(kNaN), probability(kNaN), view_angle_rad(kNaN) {}

std::string ChainTerm::text() const {
    return view.empty() ? name : name + " of view " + view;
}

PoseMeasurement measurementOf(Frame target, Frame source, const PoseEvidence& evidence, const Matrix6& own_covariance,
                              std::vector<std::size_t> parameters) {
    if (static_cast<Eigen::Index>(parameters.size()) != evidence.shared.size())
        throw std::logic_error("measurementOf: another number of parameters than the evidence has");
    PoseMeasurement measurement;
    measurement.pose = {target, source, evidence.target_from_source, own_covariance};
    measurement.sensitivity = evidence.sensitivity();
    measurement.parameters = std::move(parameters);
    return measurement;
}

PointBudget budgetAt(const Chain& chain, const NamedPoint& point) {
    const Rigid3& pose = chain.robot_from_femur.target_from_source;
    const auto by_pose = pointByPose(pose, point.in_femur);
    PointBudget budget;
    budget.point = point;
    budget.in_robot = pose * point.in_femur;
    budget.covariance_mm2 = pointCovariance(chain.robot_from_femur, point.in_femur);
    budget.radius95_mm = errorRadius(budget.covariance_mm2);
    const WorstDirection worst = worstDirection(budget.covariance_mm2);
    budget.worst_sigma_mm = worst.sigma_mm;
    budget.worst_direction = worst.direction;
    const double all = budget.covariance_mm2.trace();
    for (const ChainTerm& term : chain.terms)
        budget.shares.push_back((by_pose * term.covariance * by_pose.transpose()).trace() / all);
    budget.largest_first.resize(budget.shares.size());
    std::iota(budget.largest_first.begin(), budget.largest_first.end(), std::size_t{0});
    std::stable_sort(budget.largest_first.begin(), budget.largest_first.end(),
                     [&](std::size_t a, std::size_t b) { return budget.shares[a] > budget.shares[b]; });
    budget.sentence = fmt::format("{:.2g} mm (95 %) at the {}", budget.radius95_mm, point.name);
    if (!budget.shares.empty()) {
        const std::size_t first = budget.largest_first.front();
        budget.sentence +=
            fmt::format(": {} contributes most ({:.0f} %)", chain.terms[first].text(), 100 * budget.shares[first]);
    }
    budget.sentence += '.';
    return budget;
}

Result<Chain> solveChain(const ChainProblem& problem, const ChainOptions& options) {
    if (const Result<void> good = options.validate(); !good) return good.error();
    if (const Result<void> good = check(problem); !good) return good.error();
    const std::size_t count = problem.views.size();
    const NamedPoint& point = options.points.front();
    std::vector<std::size_t> used(count);
    std::iota(used.begin(), used.end(), std::size_t{0});

    double chi_square = chiSquareOf(problem, used);
    const auto contradicts = [&] {
        return used.size() > 1 && !(probabilityOf(chi_square, degreesOf(used.size())) >= options.outlier_probability);
    };
    if (contradicts()) {
        if (std::optional<Error> error = exchanged(problem, options, chi_square, point.in_femur)) return *error;
    }
    Chain result;
    while (contradicts() && used.size() > 2) {
        std::size_t worst = 0;
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < used.size(); ++i) {
            std::vector<std::size_t> others = used;
            others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
            const double without = chiSquareOf(problem, others);
            if (without < least) {
                least = without;
                worst = i;
            }
        }
        result.outliers.push_back(problem.views[used[worst]].name);
        used.erase(used.begin() + static_cast<std::ptrdiff_t>(worst));
        chi_square = least;
    }

    result.view_angle_rad = 0;
    for (const std::size_t i : used)
        for (const std::size_t j : used)
            result.view_angle_rad = std::max(result.view_angle_rad, viewAngle(beamInRobot(problem, problem.views[i]),
                                                                              beamInRobot(problem, problem.views[j])));
    if (used.size() > 1 && result.view_angle_rad < options.least_view_angle_rad) {
        return noSolution(
            "registration chain",
            fmt::format("{} views from the same direction, {:.1f} degrees apart at most", used.size(),
                        degreesFromRadians(result.view_angle_rad)),
            fmt::format("views at least {:.0f} degrees apart", degreesFromRadians(options.least_view_angle_rad)),
            "turn the C-arm, best by 90 degrees: along the beam both say equally little");
    }

    const System system = chain::buildSystem(problem, used);
    const Solution solution = chain::solve(system);
    result.robot_from_femur = {Frame::robot, Frame::femur, solution.robot_from_femur, solution.covariance};
    result.chi_square = used.size() > 1 ? solution.chi_square : kNaN;
    result.degrees_of_freedom = degreesOf(used.size());
    result.probability = probabilityOf(result.chi_square, result.degrees_of_freedom);
    result.terms = termsOf(problem, system, solution);
    for (std::size_t i = 0; i < count; ++i) {
        ChainViewResult view;
        view.name = problem.views[i].name;
        const auto at = std::find(used.begin(), used.end(), i);
        view.used = at != used.end();
        const System alone = chain::buildSystem(problem, {i});
        view.robot_from_femur = {Frame::robot, Frame::femur, alone.answers.front(), Matrix6(alone.covariance)};
        view.residual = alone.answers.front().deltaFrom(solution.robot_from_femur);
        view.residual_mm = (alone.answers.front() * point.in_femur - solution.robot_from_femur * point.in_femur).norm();
        view.beam_in_robot = beamInRobot(problem, problem.views[i]);
        if (count > 1) {
            std::vector<std::size_t> others = used;
            if (view.used) {
                others.erase(others.begin() + (at - used.begin()));
                view.chi_square = std::max(0.0, solution.chi_square - chiSquareOf(problem, others));
            } else {
                others.push_back(i);
                view.chi_square = std::max(0.0, chiSquareOf(problem, others) - solution.chi_square);
            }
            view.probability = probabilityOf(view.chi_square, 6);
        }
        result.views.push_back(std::move(view));
    }
    for (const NamedPoint& one : options.points)
        result.points.push_back(budgetAt(result, one));

    for (const std::string& name : result.outliers) {
        result.warnings.push_back(
            fmt::format("View {} contradicts the others and was left out: take it again, or check which files belong "
                        "to it.",
                        name));
    }
    if (used.size() == 1) {
        result.warnings.push_back(
            "One view alone: nothing checks it, and the depth along its beam is its weakest direction; add a second "
            "view, best at 90 degrees.");
    }
    const auto worst =
        std::max_element(result.points.begin(), result.points.end(),
                         [](const PointBudget& a, const PointBudget& b) { return a.radius95_mm < b.radius95_mm; });
    result.acceptance.push_back(atMost(fmt::format("error at the {} (95 %)", worst->point.name), worst->radius95_mm,
                                       options.limits.most_radius95_mm, "mm"));
    if (used.size() > 1) {
        result.acceptance.push_back(
            atLeast("agreement of the views (probability)", result.probability, options.limits.least_probability, ""));
    }
    return result;
}

}  // namespace fluorocut
