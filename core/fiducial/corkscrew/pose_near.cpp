#include "core/fiducial/corkscrew/pose_near.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/base/parallel.h"
#include "core/fiducial/corkscrew/wire_match.h"
#include "core/fiducial/corkscrew_refinement/predicted_image.h"

namespace fluorocut::corkscrew {
namespace {

constexpr double kReachMm = 6;      // across the ray
constexpr double kMarginMm = 12;    // of the picture that is looked at, about the expected corkscrew
constexpr int kShiftPx = 2;         // on the working grid; wires are as wide, their ridges dilated by 1
constexpr int kMostShifts = 20;     // to either side: 6 mm are 6 of them at 0.7 of the focal length
constexpr double kTurnRad = 0.026;  // 1.5 degrees: 2 px at the rod's ends
constexpr int kTurns = 2;           // to either side
constexpr int kRolls = 1;
constexpr double kRollRad = 0.035;
constexpr std::size_t kPolished = 4;
constexpr double kReachPx = 4;         // of polishing
constexpr double kLeastScore = 0.4;    // as in the search
constexpr double kSureScore = 0.65;    // no need to try the other polarity
constexpr double kSameTwistRad = 0.2;  // a wrong twist is 0.28 away and more

struct Place {
    float x = 0, y = 0;
    std::size_t direction = 0;
};

struct Start {
    double score = 0;
    Rigid3 pose;
};

// The image about the corkscrew, with the C-arm that would have taken it.
struct Cutting {
    Image image;
    CArm carm;
};

Cutting cuttingAround(const Image& image, const CArm& carm, const CorkscrewLayout& layout, const Rigid3& expected) {
    const double magnification = carm.focal_length_mm / expected.translation().z() / carm.pixel_mm.minCoeff();
    const PixelRegion region = regionAround(carm, layout, expected, kMarginMm * magnification);
    Cutting cutting{Image(std::max(0, region.width), std::max(0, region.height)), carm};
    for (int y = 0; y < cutting.image.height(); ++y)
        std::copy_n(image.row(region.y + y) + region.x, cutting.image.width(), cutting.image.row(y));
    cutting.carm.columns = cutting.image.width();
    cutting.carm.rows = cutting.image.height();
    cutting.carm.principal_point_px -= Vector2(region.x, region.y);
    return cutting;
}

std::vector<Place> placesOf(const CArm& carm, const std::vector<WireSample>& wires, const Rigid3& pose) {
    const Matrix3 turn = pose.rotationMatrix();
    std::vector<Place> places;
    for (const WireSample& wire : wires) {
        const Vector3 at = turn * wire.point + pose.translation(), along = turn * wire.tangent;
        if (!(at.z() > 1)) continue;
        const Vector2 pixel = carm.projectIdeal(at);
        const Vector2 tangent = along.head<2>() - at.head<2>() * (along.z() / at.z());
        places.push_back({static_cast<float>(pixel.x() + 0.5), static_cast<float>(pixel.y() + 0.5),
                          static_cast<std::size_t>(directionOf(tangent.x(), tangent.y()))});
    }
    return places;
}

// The best shift of one turn and roll, by nearest pixels.
Start bestShift(const RidgeImage& ridges, const std::vector<Place>& places, const Rigid3& pose) {
    const CArm& carm = ridges.image.carm;
    const double pixels_per_mm = carm.focal_length_mm / pose.translation().z() / carm.pixel_mm.x();
    const int steps = std::min(static_cast<int>(std::ceil(kReachMm * pixels_per_mm / kShiftPx)), kMostShifts);
    const int width = ridges.wires_dilated.width(), height = ridges.wires_dilated.height();
    Start best{-1, pose};
    for (int j = -steps; j <= steps; ++j) {
        for (int i = -steps; i <= steps; ++i) {
            int sum = 0;
            for (const Place& place : places) {
                const int x = static_cast<int>(std::floor(place.x)) + i * kShiftPx;
                const int y = static_cast<int>(std::floor(place.y)) + j * kShiftPx;
                const bool inside = x >= 0 && y >= 0 && x < width && y < height;
                sum += inside ? ridges.wires_dilated.at(x, y)[place.direction] : kChance;
            }
            if (sum <= best.score) continue;
            const Vector3 shift(i * kShiftPx / pixels_per_mm, j * kShiftPx / pixels_per_mm, 0);
            best = {static_cast<double>(sum), Rigid3(pose.rotation(), pose.translation() + shift)};
        }
    }
    return best;
}

Rigid3 turnedAboutOrigin(const Rigid3& pose, const Vector3& axis, double angle_rad) {
    return {Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, axis)) * pose.rotation(), pose.translation()};
}

struct Found {
    Rigid3 pose;
    WireScore score;
};

Found bestNear(const RidgeImage& ridges, const WireSamples& samples, const Rigid3& expected) {
    const Vector3 sight = expected.translation().normalized();
    const Vector3 tilt = sight.cross(expected.rotate(Vector3::UnitX())).normalized();
    std::vector<Rigid3> turned;
    for (int roll = -kRolls; roll <= kRolls; ++roll) {
        for (int turn = -kTurns; turn <= kTurns; ++turn) {
            const Rigid3 rolled = tilt.allFinite() ? turnedAboutOrigin(expected, tilt, roll * kRollRad) : expected;
            turned.push_back(turnedAboutOrigin(rolled, sight, turn * kTurnRad));
        }
    }
    std::vector<Start> starts(turned.size());
    parallelFor(turned.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i)
            starts[i] = bestShift(ridges, placesOf(ridges.image.carm, samples.wires, turned[i]), turned[i]);
    });
    std::stable_sort(starts.begin(), starts.end(), [](const Start& a, const Start& b) { return a.score > b.score; });
    std::array<Found, kPolished> found;
    parallelFor(found.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            found[i].pose = polished(ridges, samples, starts[i].pose, kReachPx);
            found[i].score = wireScore(ridges, samples.wires, found[i].pose);
        }
    });
    return *std::max_element(found.begin(), found.end(),
                             [](const Found& a, const Found& b) { return a.score.evidence < b.score.evidence; });
}

bool twistLeads(const RidgeImage& ridges, const WireSamples& samples, const Rigid3& pose) {
    const std::vector<Twist> best = bestTwists(ridges, samples, pose, 1);
    return !best.empty() && std::abs(std::remainder(best.front().angle_rad, 2 * std::numbers::pi)) < kSameTwistRad;
}

}  // namespace

std::optional<NearPose> poseNear(const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                                 const Rigid3& expected) {
    constexpr int kLeastPixels = 48;
    if (!(expected.translation().z() > layout.rod_radius_mm)) return {};
    const Cutting cutting = cuttingAround(image, carm, layout, expected);
    if (cutting.image.width() < kLeastPixels || cutting.image.height() < kLeastPixels) return {};
    const double pixel_mm = workingPixel(layout);
    Result<WorkingImage> dark = workingImage(cutting.image, cutting.carm, pixel_mm, false);
    if (!dark) return {};
    const bool bright_first = looksBright(*dark);
    const WireSamples samples(layout);
    Found best;
    NearPose answer;
    for (const bool second : {false, true}) {
        const bool bright = bright_first != second;
        Result<WorkingImage> working =
            bright ? workingImage(cutting.image, cutting.carm, pixel_mm, true) : std::move(dark);
        if (!working) continue;
        const RidgeImage ridges = ridgeImage(std::move(*working), layout);
        const Found found = bestNear(ridges, samples, expected);
        if (found.score.evidence > best.score.evidence && twistLeads(ridges, samples, found.pose)) {
            best = found;
            answer = {found.pose, bright};
        }
        if (best.score.score >= kSureScore) break;
    }
    if (best.score.score < kLeastScore) return {};
    return answer;
}

}  // namespace fluorocut::corkscrew
