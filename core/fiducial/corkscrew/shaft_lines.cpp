#include "core/fiducial/corkscrew/shaft_lines.h"

#include <algorithm>
#include <numbers>

namespace fluorocut::corkscrew {
namespace {

constexpr int kAngles = 180;     // over half a turn
constexpr int kReach = 5;        // angles on either side that a point votes for
constexpr int kAlikeAngles = 2;  // lines nearer than this in both are one
constexpr double kAlikeOffsetPx = 3;

struct Accumulator {
    int offsets = 0;
    double half = 0;
    std::vector<float> votes;

    explicit Accumulator(double reach_px)
        : offsets(2 * static_cast<int>(std::ceil(reach_px)) + 5), half(0.5 * (offsets - 1)) {
        votes.assign(static_cast<std::size_t>(kAngles) * static_cast<std::size_t>(offsets), 0.0F);
    }
    // Half a turn on, a line comes back with its offset reversed.
    float& at(int angle, int offset) {
        if (angle < 0 || angle >= kAngles) {
            angle = angle < 0 ? angle + kAngles : angle - kAngles;
            offset = offsets - 1 - offset;
        }
        return votes[static_cast<std::size_t>(angle) * static_cast<std::size_t>(offsets) +
                     static_cast<std::size_t>(offset)];
    }
};

}  // namespace

std::vector<ImageLine> shaftLines(const std::vector<RidgePoint>& points, const CArm& ideal, int most) {
    const Vector2 centre = ideal.principal_point_px;
    double reach = 0;
    for (const Vector2& corner :
         {Vector2(0, 0), Vector2(ideal.columns, 0), Vector2(0, ideal.rows), Vector2(ideal.columns, ideal.rows)}) {
        reach = std::max(reach, (corner - centre).norm());
    }
    if (!(reach < 1e4)) return {};  // a principal point far outside: no picture of this kind
    std::vector<float> cosines(kAngles), sines(kAngles);
    for (int k = 0; k < kAngles; ++k) {
        cosines[static_cast<std::size_t>(k)] = static_cast<float>(std::cos(std::numbers::pi * k / kAngles));
        sines[static_cast<std::size_t>(k)] = static_cast<float>(std::sin(std::numbers::pi * k / kAngles));
    }
    Accumulator sum(reach);
    for (const RidgePoint& point : points) {
        const float x = point.x - static_cast<float>(centre.x()), y = point.y - static_cast<float>(centre.y());
        const double degrees = (point.angle_rad + 0.5 * std::numbers::pi) * kAngles / std::numbers::pi;
        const int nearest = static_cast<int>(std::lround(degrees));
        for (int step = -kReach; step <= kReach; ++step) {
            const int angle = ((nearest + step) % kAngles + kAngles) % kAngles;
            const float offset = x * cosines[static_cast<std::size_t>(angle)] +
                                 y * sines[static_cast<std::size_t>(angle)] + static_cast<float>(sum.half);
            const int low = static_cast<int>(offset);
            if (low < 0 || low + 1 >= sum.offsets) continue;
            const float weight =
                point.strength * (1 - static_cast<float>(std::abs(step)) / static_cast<float>(kReach + 1));
            const float part = offset - static_cast<float>(low);
            sum.at(angle, low) += weight * (1 - part);
            sum.at(angle, low + 1) += weight * part;
        }
    }
    struct Peak {
        int angle, offset;
        float votes;
    };
    std::vector<Peak> peaks;
    const auto smooth = [&](int a, int o) {
        return 0.5F * sum.at(a, o) + 0.25F * (sum.at(a, o - 1) + sum.at(a, o + 1));
    };
    for (int a = 0; a < kAngles; ++a) {
        for (int o = 2; o + 2 < sum.offsets; ++o) {
            const float votes = smooth(a, o);
            if (votes < 4) continue;
            bool top = true;
            for (int da = -1; da <= 1 && top; ++da)
                for (int d = -1; d <= 1 && top; ++d)
                    top = (da == 0 && d == 0) || smooth(a + da, o + d) < votes ||
                          (smooth(a + da, o + d) == votes && (da > 0 || (da == 0 && d > 0)));
            if (top) peaks.push_back({a, o, votes});
        }
    }
    std::sort(peaks.begin(), peaks.end(), [](const Peak& a, const Peak& b) {
        return std::tie(b.votes, a.angle, a.offset) < std::tie(a.votes, b.angle, b.offset);
    });
    std::vector<ImageLine> lines;
    for (const Peak& peak : peaks) {
        if (static_cast<int>(lines.size()) >= most) break;
        // The top of a parabola through neighbours, along angle and offset.
        const auto top = [](float before, float here, float after) {
            const float bend = before - 2 * here + after;
            return bend < 0 ? std::clamp(0.5F * (before - after) / bend, -0.5F, 0.5F) : 0.0F;
        };
        const double angle =
            peak.angle + top(smooth(peak.angle - 1, peak.offset), peak.votes, smooth(peak.angle + 1, peak.offset));
        const double offset =
            peak.offset + top(smooth(peak.angle, peak.offset - 1), peak.votes, smooth(peak.angle, peak.offset + 1));
        ImageLine line{angle * std::numbers::pi / kAngles, offset - sum.half, peak.votes};
        const bool known = std::any_of(lines.begin(), lines.end(), [&](const ImageLine& other) {
            double turn = std::abs(other.normal_rad - line.normal_rad), away = other.offset_px - line.offset_px;
            if (turn > 0.5 * std::numbers::pi) {
                turn = std::numbers::pi - turn;
                away = other.offset_px + line.offset_px;
            }
            return turn < (kAlikeAngles + 0.01) * std::numbers::pi / kAngles && std::abs(away) < kAlikeOffsetPx;
        });
        if (!known) lines.push_back(line);
    }
    return lines;
}

}  // namespace fluorocut::corkscrew
