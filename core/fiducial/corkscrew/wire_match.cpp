#include "core/fiducial/corkscrew/wire_match.h"

#include <algorithm>
#include <numbers>

#include <Eigen/Cholesky>

#include "core/base/median.h"

namespace fluorocut::corkscrew {
namespace {

constexpr int kWireSamples = 200;
constexpr int kShaftSamples = 32;
constexpr int kTwists = 90;
constexpr double kCertain = 0.85 * kFull;  // between two directions and two pixels a full ridge shows this much
constexpr double kTypicalDepth = 0.7;      // of the focal length
constexpr double kWirePixels = 2.2;        // width of a wire on the working grid
// Projected length over length: below it a wire is seen end on, and shows no direction.
constexpr double kLeastForeshortening = 0.25;
constexpr double kShaftWeight = 1.5;

struct Projected {
    double x, y;    // pixels of the working grid
    double tx, ty;  // tangent, px per mm
};

bool project(const CArm& carm, const Vector3& p, const Vector3& t, Projected& out) {
    if (!(p.z() > 1)) return false;
    const double scale = carm.focal_length_mm / carm.pixel_mm.x() / p.z();
    out = {scale * p.x() + carm.principal_point_px.x(), scale * p.y() + carm.principal_point_px.y(),
           scale * (t.x() - p.x() / p.z() * t.z()), scale * (t.y() - p.y() / p.z() * t.z())};
    return true;
}

double nearest(const RidgeMap& map, double x, double y, int direction) {
    if (!map.contains(x, y)) return kChance;
    return map.at(static_cast<int>(x + 0.5), static_cast<int>(y + 0.5))[static_cast<std::size_t>(direction)];
}

double between(const RidgeMap& map, double x, double y, int direction) {
    if (!(x >= 0 && y >= 0 && x < map.width() - 1 && y < map.height() - 1)) return nearest(map, x, y, direction);
    const int ix = static_cast<int>(x), iy = static_cast<int>(y);
    const double fx = x - ix, fy = y - iy;
    const auto k = static_cast<std::size_t>(direction);
    return (1 - fy) * ((1 - fx) * map.at(ix, iy)[k] + fx * map.at(ix + 1, iy)[k]) +
           fy * ((1 - fx) * map.at(ix, iy + 1)[k] + fx * map.at(ix + 1, iy + 1)[k]);
}

struct Observation {
    Vector6 gradient;  // of the residual by the pose: dt, dr
    double residual = 0, weight = 0;
};

Vector6 gradientOf(const CArm& carm, const Vector3& turned, const Vector3& p, double nx, double ny) {
    const double scale = carm.focal_length_mm / carm.pixel_mm.x() / p.z();
    const Vector3 g = scale * Vector3(nx, ny, -(nx * p.x() + ny * p.y()) / p.z());
    Vector6 result;
    result << g, turned.cross(g);
    return result;
}

void observe(const RidgeImage& ridges, const RidgeMap& map, std::span<const WireSample> samples, const Rigid3& pose,
             double reach_px, double weight, double least_length, std::vector<Observation>& observations) {
    const CArm& carm = ridges.image.carm;
    const Matrix3 turn = pose.rotationMatrix();
    const double step = reach_px > 3 ? 1 : 0.5;
    const int steps = static_cast<int>(reach_px / step);
    for (const WireSample& sample : samples) {
        const Vector3 turned = turn * sample.point, p = turned + pose.translation();
        Projected at{};
        if (!project(carm, p, turn * sample.tangent, at) || !ridges.sees(at.x, at.y)) continue;
        const double length = std::hypot(at.tx, at.ty);
        if (!(length > least_length * carm.focal_length_mm / carm.pixel_mm.x() / p.z())) continue;
        const double nx = -at.ty / length, ny = at.tx / length;
        const int direction = directionOf(at.tx, at.ty);
        const auto value = [&](double off) { return between(map, at.x + off * nx, at.y + off * ny, direction); };
        double best = 0, place = 0;
        for (int i = -steps; i <= steps; ++i) {
            const double off = i * step, here = value(off) * (1 - 0.4 * std::abs(off) / reach_px);
            if (here > best) {
                best = here;
                place = off;
            }
        }
        if (!(best > kChance)) continue;
        const double before = value(place - 1), here = value(place), after = value(place + 1);
        const double sum = before + here + after;  // ridges are flat on top: the centre of gravity tells more
        if (sum > 0) place += std::clamp((after - before) / sum, -0.7, 0.7);
        observations.push_back({gradientOf(carm, turned, p, nx, ny), place, weight * here / kFull});
    }
}

}  // namespace

WireSamples::WireSamples(const CorkscrewLayout& layout) {
    double total_mm = layout.helix.length_mm();
    for (const CorkscrewRing& ring : layout.rings)
        total_mm += 2 * std::numbers::pi * ring.radius_mm;
    const double spacing_mm = total_mm / kWireSamples;
    for (const CorkscrewRing& ring : layout.rings) {
        const int count = std::max(8, static_cast<int>(2 * std::numbers::pi * ring.radius_mm / spacing_mm));
        for (int i = 0; i < count; ++i) {
            const double angle = 2 * std::numbers::pi * (i + 0.5) / count;
            wires.push_back({ring.point(angle), ring.tangent(angle)});
        }
    }
    first_of_helix = wires.size();
    const int count = std::max(16, static_cast<int>(layout.helix.length_mm() / spacing_mm));
    for (int i = 0; i < count; ++i) {
        const double t = (i + 0.5) / count;
        wires.push_back({layout.helix.point(t), layout.helix.tangent(t)});
    }
    const double length_mm = layout.shaft_x_mm[1] - layout.shaft_x_mm[0];
    for (int i = 0; i < kShaftSamples; ++i) {
        const double x = layout.shaft_x_mm[0] + length_mm * (i + 0.5) / kShaftSamples;
        shaft.push_back({Vector3(x, 0, 0), Vector3::UnitX()});
    }
}

double workingPixel(const CorkscrewLayout& layout) {
    return 2 * layout.helix.wire_radius_mm / kTypicalDepth / kWirePixels;
}

RidgeImage ridgeImage(WorkingImage image, const CorkscrewLayout& layout) {
    RidgeImage ridges;
    const double pixels_per_mm = 1 / (kTypicalDepth * image.carm.pixel_mm.x());
    ridges.wires = ridgesOfWidth(image, 2 * layout.helix.wire_radius_mm * pixels_per_mm, nullptr);
    ridges.wires_dilated = dilated(ridges.wires);
    ridges.shafts = ridgesOfWidth(image, 2 * layout.shaft_radius_mm * pixels_per_mm, &ridges.shaft_points);
    ridges.image = std::move(image);
    return ridges;
}

WireScore wireScore(const RidgeImage& ridges, std::span<const WireSample> samples,
                    const Rigid3& imager_from_corkscrew) {
    const Matrix3 turn = imager_from_corkscrew.rotationMatrix();
    int inside = 0;
    double sum = 0;
    for (const WireSample& sample : samples) {
        Projected at{};
        if (!project(ridges.image.carm, turn * sample.point + imager_from_corkscrew.translation(),
                     turn * sample.tangent, at) ||
            !ridges.sees(at.x, at.y)) {
            continue;
        }
        ++inside;
        sum += std::min(1.0, between(ridges.wires, at.x, at.y, directionOf(at.tx, at.ty)) / kCertain);
    }
    if (inside == 0) return {};
    const double visible = static_cast<double>(inside) / static_cast<double>(samples.size());
    const double score = sum / inside;
    return {score, visible, (score - kChance / kCertain) * visible};
}

std::vector<Twist> bestTwists(const RidgeImage& ridges, const WireSamples& samples, const Rigid3& pose, int most) {
    std::array<double, kTwists> scores{};
    const double count = static_cast<double>(samples.wires.size() - samples.first_of_helix);
    for (int k = 0; k < kTwists; ++k) {
        const Matrix3 turn = (pose.rotation() * Eigen::Quaterniond(Eigen::AngleAxisd(2 * std::numbers::pi * k / kTwists,
                                                                                     Vector3::UnitX())))
                                 .toRotationMatrix();
        double sum = 0;
        for (std::size_t i = samples.first_of_helix; i < samples.wires.size(); ++i) {
            Projected at{};
            if (!project(ridges.image.carm, turn * samples.wires[i].point + pose.translation(),
                         turn * samples.wires[i].tangent, at)) {
                continue;
            }
            sum += nearest(ridges.wires_dilated, at.x, at.y, directionOf(at.tx, at.ty)) - kChance;
        }
        scores[static_cast<std::size_t>(k)] = sum / count / kFull;
    }
    std::vector<Twist> twists;
    for (int k = 0; k < kTwists; ++k) {
        const double here = scores[static_cast<std::size_t>(k)];
        bool top = true;
        for (int d = 1; d <= 2 && top; ++d) {
            top = here > scores[static_cast<std::size_t>((k + kTwists - d) % kTwists)] &&
                  here >= scores[static_cast<std::size_t>((k + d) % kTwists)];
        }
        if (top) twists.push_back({2 * std::numbers::pi * k / kTwists, here});
    }
    std::stable_sort(twists.begin(), twists.end(), [](const Twist& a, const Twist& b) { return a.score > b.score; });
    if (static_cast<int>(twists.size()) > most) twists.resize(static_cast<std::size_t>(most));
    return twists;
}

Rigid3 polished(const RidgeImage& ridges, const WireSamples& samples, Rigid3 pose, double reach_px, Wires wires) {
    std::vector<Observation> observations;
    std::vector<double> sizes;
    for (double reach = reach_px; reach > 1.4; reach *= 0.7) {
        observations.clear();
        observe(ridges, ridges.wires,
                wires == Wires::all ? std::span<const WireSample>(samples.wires) : samples.rings(), pose, reach, 1,
                kLeastForeshortening, observations);
        observe(ridges, ridges.shafts, samples.shaft, pose, reach, kShaftWeight, 0.1, observations);
        if (observations.size() < 24) return pose;
        const Rigid3 start = pose;
        Vector6 delta = Vector6::Zero();
        for (int pass = 0; pass < 3; ++pass) {
            sizes.clear();
            for (const Observation& o : observations)
                sizes.push_back(std::abs(o.residual - o.gradient.dot(delta)));
            const double cut = 4.7 * std::max(1.4826 * median(sizes), 0.3);
            Matrix6 information = Matrix6::Zero();
            Vector6 right = Vector6::Zero();
            for (const Observation& o : observations) {
                const double off = (o.residual - o.gradient.dot(delta)) / cut;
                if (std::abs(off) >= 1) continue;
                const double weight = o.weight * (1 - off * off) * (1 - off * off);
                information += weight * o.gradient * o.gradient.transpose();
                right += weight * o.residual * o.gradient;
            }
            // As if each part were known, beforehand, to this much (mm, rad) with one observation of 1 px.
            const double depth = pose.translation().z();
            Vector6 known;
            known << 0.02 * depth, 0.02 * depth, 0.05 * depth, 0.2, 0.2, 0.2;
            information.diagonal() += (known.array().square().inverse()).matrix();
            if (wires == Wires::rings) {  // which do not see the twist
                const Vector3 axis = pose.rotate(Vector3::UnitX());
                information.bottomRightCorner<3, 3>() += 1e9 * axis * axis.transpose();
            }
            const Eigen::LDLT<Matrix6> solver(information);
            if (solver.info() != Eigen::Success) return start;
            delta = solver.solve(right);
            if (!delta.allFinite()) return start;
        }
        const double turn = delta.tail<3>().norm(), move = delta.head<3>().norm() / pose.translation().norm();
        delta *= std::min({1.0, 0.2 / std::max(turn, 1e-9), 0.06 / std::max(move, 1e-9)});
        pose = start.perturbed(delta);
        if (!(pose.translation().z() > 1)) return start;
    }
    return pose;
}

}  // namespace fluorocut::corkscrew
