#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/random.h"
#include "core/experiments/corkscrew_experiment.h"

namespace fluorocut {
namespace {

constexpr std::uint64_t kPoses = 0x7461626c;  // their random stream

// The six numbers that the robot moves: twist, roll, pitch in degrees; x, y, z in mm.
Vector6 numbersOf(const Rigid3& pose) {
    Vector6 numbers;
    numbers << pose.twistRollPitch() * degreesFromRadians(1), pose.translation();
    return numbers;
}

Rigid3 poseOf(const Vector6& numbers) {
    return Rigid3::fromTranslation(numbers.tail<3>()) * Rigid3::fromTwistRollPitch(radiansFromDegrees(numbers[0]),
                                                                                   radiansFromDegrees(numbers[1]),
                                                                                   radiansFromDegrees(numbers[2]));
}

// Where the corkscrew is before it moves: anywhere near the middle, so that every motion of the tables leaves it in the
// picture.
Vector6 startingNumbers(const CorkscrewTablesOptions& options, Random random) {
    const double depth = 0.5 * (options.scenes.least_depth_mm + options.scenes.most_depth_mm);
    Vector6 numbers;
    numbers << random.uniform(-180, 180), random.uniform(-10, 10), random.uniform(-10, 10), random.uniform(-4, 4),
        random.uniform(-4, 4), depth + random.uniform(-10, 10);
    return numbers;
}

struct Measured {
    std::array<std::array<std::vector<double>, kPaperTrials>, kCorkscrewMotions.size()> computed;
    CorkscrewTables tables;
};

}  // namespace

CorkscrewTableCell::CorkscrewTableCell() : computed(std::numeric_limits<double>::quiet_NaN()) {}

const PaperTable& paperCorkscrewTable() {
    // Table 1 and Table 2 of the paper, as printed.
    static const PaperTable table{{{{{30, 30.28}, {60, 59.53}, {90, 88.95}, {120, 120.64}, {150, 149.74}}},
                                   {{{15, 17.26}, {30, 31.76}, {45, 44.17}, {-15, -12.31}, {-30, -31.82}}},
                                   {{{15, 14.82}, {30, 29.34}, {45, 47.07}, {-15, -13.84}, {-30, -30.28}}},
                                   {{{5, 5.04}, {10, 9.73}, {15, 14.2}, {-5, -5.13}, {-10, -9.93}}},
                                   {{{5, 5.13}, {10, 10.39}, {15, 14.35}, {-5, -5.18}, {-10, -9.76}}},
                                   {{{5, 5.61}, {10, 11.25}, {15, 13.62}, {-5, -5.42}, {-10, -10.96}}}}};
    return table;
}

Result<void> CorkscrewTablesOptions::validate() const {
    if (const Result<void> good = scenes.validate(); !good) return good;
    if (const Result<void> good = pose.validate(); !good) return good;
    return requireRange("repeats", repeats, 1, 10000, "");
}

Result<std::vector<CorkscrewTables>> runCorkscrewTables(const CorkscrewTablesOptions& options,
                                                        const std::vector<PoseFromImage>& methods, Progress& progress) {
    if (const Result<void> good = options.validate(); !good) return good.error();
    CorkscrewSceneOptions setup = options.scenes;
    setup.clutter = CorkscrewClutter::none();
    setup.inverted = 0;
    setup.least_visible = 0;
    setup.most_covered = 1;
    setup.imagers = options.repeats;
    SubProgress preparing(progress, 0, 0.2);
    const Result<CorkscrewScenes> scenes = CorkscrewScenes::prepare(setup, preparing);
    if (!scenes) return scenes.error();

    std::vector<Measured> measured(methods.size());
    const Random dice = Random(options.scenes.seed).fork(kPoses);
    for (int repeat = 0; repeat < options.repeats; ++repeat) {
        const auto index = static_cast<std::uint64_t>(repeat);
        const Vector6 start = startingNumbers(options, dice.fork(index));
        std::uint64_t exposure = 0;
        // What each method makes of the corkscrew there; nothing where it refuses.
        const auto look = [&](const Vector6& numbers) -> Result<std::vector<std::optional<Vector6>>> {
            const Result<CorkscrewScene> scene = scenes->sceneWith(index, poseOf(numbers), ++exposure);
            if (!scene) return scene.error();
            std::vector<std::optional<Vector6>> seen;
            for (std::size_t m = 0; m < methods.size(); ++m) {
                const Result<Rigid3> pose = methods[m](scene->image, scene->carm, scene->layout);
                if (!pose && pose.error().code != ErrorCode::noSolution) return pose.error();
                ++measured[m].tables.images;
                if (!pose) ++measured[m].tables.refused;
                seen.push_back(pose ? std::optional(numbersOf(*pose)) : std::nullopt);
            }
            return seen;
        };
        const auto before = look(start);
        if (!before) return before.error();
        for (std::size_t motion = 0; motion < kCorkscrewMotions.size(); ++motion) {
            for (std::size_t trial = 0; trial < kPaperTrials; ++trial) {
                if (progress.isCancelled()) return cancelled("corkscrew tables");
                const double done = (static_cast<double>(motion * kPaperTrials + trial)) / 30;
                progress.report(0.2 + 0.8 * (repeat + done) / options.repeats, "corkscrew tables");
                Vector6 numbers = start;
                const auto i = static_cast<Eigen::Index>(motion);
                numbers[i] += paperCorkscrewTable()[motion][trial].moved;
                const auto after = look(numbers);
                if (!after) return after.error();
                for (std::size_t m = 0; m < methods.size(); ++m) {
                    const auto &a = (*before)[m], &b = (*after)[m];
                    if (!a || !b) {
                        ++measured[m].tables.cells[motion][trial].refused;
                        continue;
                    }
                    const double way = (*b)[i] - (*a)[i];
                    measured[m].computed[motion][trial].push_back(motion < 3 ? std::remainder(way, 360) : way);
                }
            }
        }
    }
    std::vector<CorkscrewTables> result;
    for (Measured& of : measured) {
        for (std::size_t motion = 0; motion < kCorkscrewMotions.size(); ++motion) {
            std::vector<double> all;
            for (std::size_t trial = 0; trial < kPaperTrials; ++trial) {
                CorkscrewTableCell& cell = of.tables.cells[motion][trial];
                std::vector<double> errors;
                double sum = 0;
                for (const double computed : of.computed[motion][trial]) {
                    errors.push_back(std::abs(computed - paperCorkscrewTable()[motion][trial].moved));
                    sum += computed;
                }
                cell.computed = sum / static_cast<double>(errors.size());
                cell.errors = figuresOf(errors);
                all.insert(all.end(), errors.begin(), errors.end());
            }
            of.tables.errors[motion] = figuresOf(all);
        }
        result.push_back(std::move(of.tables));
    }
    return result;
}

}  // namespace fluorocut
