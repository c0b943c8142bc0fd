#include "core/distortion/distortion_map_set.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/base/option_checks.h"
#include "core/base/utc.h"
#include "core/distortion/models/table_model.h"
#include "core/io/atomic_file.h"

namespace fluorocut {
namespace {

constexpr std::string_view kSchema = "fluorocut/distortion-set/1";
constexpr double kLength = 1.5;                         // rad, of the correlation
constexpr double kSamePose = radiansFromDegrees(0.5);   // one pose measured again
constexpr double kOneMapReach = radiansFromDegrees(2);  // of a map that is alone
constexpr double kTableSteps = 32;
constexpr std::size_t kMostMaps = 200;

Matrix3 orientation(const CArmPosition& position) {
    return nominalImagerFromRoom(position, 1000).rotationMatrix();
}

double correlation(const CArmPosition& a, const CArmPosition& b) {
    const double distance2 = (orientation(a) - orientation(b)).squaredNorm() / 2;
    return std::exp(-distance2 / (2 * kLength * kLength));
}

std::string text(const CArmPosition& position) {
    return fmt::format("orbital {:.1f}, angulation {:.1f} degrees", degreesFromRadians(position.orbital_rad),
                       degreesFromRadians(position.angulation_rad));
}

struct Weights {
    Eigen::VectorXd weights;  // their sum is 1
    double variance = 0;      // of the interpolation, for an unknown of variance 1
};

// Ordinary kriging: minimise the variance of sum w_i f_i - f under sum w = 1.
Weights weightsFor(const CArmPosition& at, const std::vector<CArmPosition>& known) {
    const auto n = static_cast<Eigen::Index>(known.size());
    Eigen::MatrixXd system = Eigen::MatrixXd::Ones(n + 1, n + 1);
    Eigen::VectorXd right = Eigen::VectorXd::Ones(n + 1);
    system(n, n) = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
        const CArmPosition& one = known[static_cast<std::size_t>(i)];
        right[i] = correlation(one, at);
        for (Eigen::Index j = 0; j < n; ++j)
            system(i, j) = correlation(one, known[static_cast<std::size_t>(j)]);
        system(i, i) += 1e-9;  // poses near each other
    }
    const Eigen::VectorXd solution = system.fullPivLu().solve(right);
    return {solution.head(n), std::max(0.0, 1 - solution.dot(right))};
}

}  // namespace

double angleBetween(const CArmPosition& a, const CArmPosition& b) {
    const auto beam = [](const CArmPosition& p) {
        return Vector3(std::sin(p.orbital_rad) * std::cos(p.angulation_rad),
                       -std::cos(p.orbital_rad) * std::cos(p.angulation_rad), std::sin(p.angulation_rad));
    };
    return std::atan2(beam(a).cross(beam(b)).norm(), beam(a).dot(beam(b)));
}

Result<void> DistortionSetLimits::validate() const {
    return requireRanges({{"max_angle_rad", max_angle_rad, 0, radiansFromDegrees(90), "rad"},
                          {"max_age_days", max_age_days, 0, 36500, "days"}});
}

Result<DistortionMapSet> DistortionMapSet::create(std::vector<DistortionMap> maps) {
    if (maps.empty() || maps.size() > kMostMaps) {
        return invalidInput("distortion map set", fmt::format("{} maps", maps.size()),
                            fmt::format("1 to {}", kMostMaps));
    }
    for (std::size_t i = 0; i < maps.size(); ++i) {
        const DistortionMapParts& parts = maps[i].parts();
        const std::string where = fmt::format("distortion map set, map {}", i + 1);
        if (!parts.position) return invalidInput(where, "no position of the C-arm", "its angles");
        if (!daysFromUtc(parts.measured_at)) {
            return invalidInput(where, "measured_at \"" + parts.measured_at + "\"",
                                "a time like \"2026-03-01T09:30:00Z\"");
        }
        if (parts.columns != maps[0].columns() || parts.rows != maps[0].rows()) {
            return invalidInput(where, fmt::format("{} x {} pixels", parts.columns, parts.rows),
                                fmt::format("{} x {}, as the first", maps[0].columns(), maps[0].rows()));
        }
    }
    return DistortionMapSet(std::move(maps));
}

Result<DistortionMap> DistortionMapSet::mapAt(const CArmPosition& position, const std::string& now,
                                              const DistortionSetLimits& limits) const {
    if (const Result<void> good = limits.validate(); !good) return good.error();
    if (const Result<void> good = position.validate(); !good) return good.error();
    const std::optional<double> today = daysFromUtc(now);
    if (!today) return invalidOption("now", "\"" + now + "\"", "a time like \"2026-03-01T09:30:00Z\"");
    const auto angleTo = [&](const DistortionMap& map) { return angleBetween(*map.parts().position, position); };
    const auto age = [&](const DistortionMap& map) { return *today - *daysFromUtc(map.parts().measured_at); };

    // The newest first; of one pose only the newest counts.
    std::vector<const DistortionMap*> all;
    for (const DistortionMap& map : maps_)
        all.push_back(&map);
    std::stable_sort(all.begin(), all.end(), [&](auto* a, auto* b) { return age(*a) < age(*b); });
    std::vector<const DistortionMap*> use;
    for (const DistortionMap* map : all) {
        if (age(*map) < -1) {
            return invalidInput("distortion map measured at " + map->parts().measured_at, "a time after now, " + now,
                                "an earlier one", "check the clocks of both computers");
        }
        const bool again = std::any_of(use.begin(), use.end(), [&](const DistortionMap* other) {
            return angleBetween(*other->parts().position, *map->parts().position) < kSamePose;
        });
        if (!again && age(*map) <= limits.max_age_days) use.push_back(map);
    }
    const auto nearer = [&](const DistortionMap* a, const DistortionMap* b) { return angleTo(*a) < angleTo(*b); };
    const DistortionMap& nearest_of_all = **std::min_element(all.begin(), all.end(), nearer);
    const double reach = use.size() == 1 ? std::min(kOneMapReach, limits.max_angle_rad) : limits.max_angle_rad;
    const auto inReach = [&](const DistortionMap& map) { return angleTo(map) <= reach; };
    if (use.empty() || !inReach(**std::min_element(use.begin(), use.end(), nearer))) {
        const bool old = inReach(nearest_of_all);
        return noSolution(
            "distortion map for " + text(position),
            old ? fmt::format("one that is {:.0f} days old", age(nearest_of_all))
                : fmt::format("the nearest {:.1f} degrees away, at {}", degreesFromRadians(angleTo(nearest_of_all)),
                              text(*nearest_of_all.parts().position)),
            old ? fmt::format("not more than {:.0f} days", limits.max_age_days)
                : fmt::format("one within {:.1f} degrees", degreesFromRadians(reach)),
            "take an image of the plate at this pose");
    }
    const DistortionMap& nearest = **std::min_element(use.begin(), use.end(), nearer);
    if (angleTo(nearest) < 1e-9) return nearest;

    std::vector<CArmPosition> known;
    for (const DistortionMap* map : use)
        known.push_back(*map->parts().position);
    const Weights weights = weightsFor(position, known);
    // Row j: map j less what the others predict for it, over the variance of that prediction.
    const auto n = static_cast<Eigen::Index>(use.size());
    Eigen::MatrixXd left_out = Eigen::MatrixXd::Zero(n, n);
    for (Eigen::Index j = 0; n > 1 && j < n; ++j) {
        std::vector<CArmPosition> others = known;
        others.erase(others.begin() + j);
        const Weights from = weightsFor(known[static_cast<std::size_t>(j)], others);
        left_out.row(j).head(j) = -from.weights.head(j).transpose();
        left_out.row(j).tail(n - j - 1) = -from.weights.tail(n - j - 1).transpose();
        left_out(j, j) = 1;
        left_out.row(j) /= std::sqrt(std::max(from.variance, 1e-9));
    }

    const auto values = [&](const Vector2& pixel) {
        Eigen::MatrixX2d mm(n, 2);
        for (Eigen::Index i = 0; i < n; ++i) {
            const DistortionMap& map = *use[static_cast<std::size_t>(i)];
            mm.row(i) = (map.parts().detector_from_plate * map.smoothModel().plateFromPixel(pixel)).transpose();
        }
        return mm;
    };
    std::vector<std::vector<Vector2>> rims;
    for (const DistortionMap* map : use)
        rims.push_back(map->parts().support.polygon());
    const Result<Support> support = Support::around(rims, 0);
    if (!support) return support.error();

    DistortionMapParts parts = nearest.parts();
    parts.support = *support;
    parts.detector_from_plate = {};
    parts.model = TableModel::sampled(
        nearest.columns(), nearest.rows(), std::max(nearest.columns(), nearest.rows()) / kTableSteps,
        [&](const Vector2& pixel) -> Vector2 { return values(pixel).transpose() * weights.weights; },
        [&](const Vector2& pixel) -> Matrix2 {
            // The worst of a few: their mean has been too hopeful.
            const double spread = 0.5 * (left_out * values(pixel)).rowwise().squaredNorm().maxCoeff();
            Matrix2 sum = weights.variance * spread * Matrix2::Identity();
            for (Eigen::Index i = 0; i < n; ++i) {
                const Matrix2 one = use[static_cast<std::size_t>(i)]->covariance(pixel);
                // Holes of the paper's model: nothing is known there that this sum could hold.
                sum += weights.weights[i] * weights.weights[i] * one;
            }
            return sum;
        });
    if (!parts.model) return noSolution("distortion map for " + text(position), "no answer", "maps that have one");
    parts.quality = {};
    parts.position = position;
    for (const DistortionMap* map : use) {
        if (age(*map) > *today - *daysFromUtc(parts.measured_at)) parts.measured_at = map->parts().measured_at;
    }
    Result<DistortionMap> map = DistortionMap::create(parts);
    if (!map) return map;
    parts.quality.coverage = coverage(*map);
    return DistortionMap::create(std::move(parts));
}

Result<DistortionMapSet> readDistortionMapSet(const std::filesystem::path& path) {
    Result<JsonObject> file = readJson(path, kSchema);
    if (!file) return file.error();
    struct Entry {
        std::filesystem::path file;
        CArmPosition position;
        std::string measured_at;
    };
    std::vector<Entry> entries;
    for (JsonObject object : file->objects("maps")) {
        Entry entry;
        entry.file = path.parent_path() / object.text("file");
        entry.position.orbital_rad = radiansFromDegrees(object.number("orbital_deg", -360, 360));
        entry.position.angulation_rad = radiansFromDegrees(object.number("angulation_deg", -90, 90));
        entry.measured_at = object.text("measured_at");
        if (!object.failed() && !daysFromUtc(entry.measured_at)) {
            object.fail("measured_at", "\"" + entry.measured_at + "\"", "a time like \"2026-03-01T09:30:00Z\"");
        }
        entries.push_back(std::move(entry));
    }
    if (!file->failed() && (entries.empty() || entries.size() > kMostMaps)) {
        file->fail("maps", fmt::format("{} maps", entries.size()), fmt::format("1 to {}", kMostMaps));
    }
    if (const Result<void> read = file->finish(); !read) return read.error();
    std::vector<DistortionMap> maps;
    for (const Entry& entry : entries) {
        const Result<DistortionMap> map = readDistortionMap(entry.file);
        if (!map) return map.error();
        maps.push_back(map->measured(entry.position, entry.measured_at));
    }
    Result<DistortionMapSet> set = DistortionMapSet::create(std::move(maps));
    if (!set) {
        Error error = set.error();
        error.where = path.string() + ", " + error.where;
        return error;
    }
    return set;
}

Result<void> writeDistortionMapSet(const std::filesystem::path& path, const DistortionMapSet& set,
                                   const std::vector<std::filesystem::path>& map_files) {
    if (map_files.size() != set.maps().size()) throw std::logic_error("writeDistortionMapSet: a file for each map");
    const std::filesystem::path folder = std::filesystem::absolute(path).lexically_normal().parent_path();
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < map_files.size(); ++i) {
        const DistortionMapParts& parts = set.maps()[i].parts();
        const std::filesystem::path file = std::filesystem::absolute(map_files[i]).lexically_normal();
        list.push_back({{"file", file.lexically_relative(folder).string()},
                        {"orbital_deg", degreesFromRadians(parts.position->orbital_rad)},
                        {"angulation_deg", degreesFromRadians(parts.position->angulation_rad)},
                        {"measured_at", parts.measured_at}});
    }
    nlohmann::ordered_json json;
    json["schema"] = kSchema;
    json["maps"] = std::move(list);
    return writeWhole(path, json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
}

}  // namespace fluorocut
