#include "core/distortion/spline_filter.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/parallel.h"

namespace fluorocut {
namespace {

constexpr std::size_t kLanes = 16;  // lines filtered side by side: the recursion waits for itself, they do not
constexpr float kPole = -0.26794919243112270647F;  // sqrt(3) - 2
constexpr float kGain = 6;                         // (1 - pole) (1 - 1 / pole)
constexpr float kEnd = kPole / (kPole * kPole - 1);
constexpr int kHorizon = 14;  // |pole|^14 = 1e-8

struct Lanes {
    float v[kLanes];
};

// Values at line[0], line[1] ... of kLanes lines become coefficients.
void filter(Lanes* line, int count) {
    if (count == 1) return;  // a constant
    for (std::size_t l = 0; l < kLanes; ++l) {
        // Causal start: the mirrored line, as far as it is felt.
        float sum = 0, power = 1;
        const int period = 2 * (count - 1);
        for (int k = 0; k < kHorizon; ++k, power *= kPole) {
            const int phase = k % period;
            sum += power * line[phase < count ? phase : period - phase].v[l];
        }
        line[0].v[l] = kGain * sum;
    }
    for (int i = 1; i < count; ++i) {
        for (std::size_t l = 0; l < kLanes; ++l)
            line[i].v[l] = kGain * line[i].v[l] + kPole * line[i - 1].v[l];
    }
    Lanes& last = line[count - 1];
    for (std::size_t l = 0; l < kLanes; ++l)
        last.v[l] = kEnd * (last.v[l] + kPole * line[count - 2].v[l]);
    for (int i = count - 2; i >= 0; --i) {
        for (std::size_t l = 0; l < kLanes; ++l)
            line[i].v[l] = kPole * (line[i + 1].v[l] - line[i].v[l]);
    }
}

}  // namespace

void splineFilterRows(Image& image) {
    const int width = image.width();
    parallelFor(static_cast<std::size_t>(image.height()), kLanes, [&](std::size_t begin, std::size_t end) {
        std::vector<Lanes> buffer(static_cast<std::size_t>(width));
        const int first = static_cast<int>(begin), count = static_cast<int>(end - begin);
        for (int l = 0; l < count; ++l) {
            const float* row = image.row(first + l);
            for (int x = 0; x < width; ++x)
                buffer[static_cast<std::size_t>(x)].v[l] = row[x];
        }
        filter(buffer.data(), width);
        for (int l = 0; l < count; ++l) {
            float* row = image.row(first + l);
            for (int x = 0; x < width; ++x)
                row[x] = buffer[static_cast<std::size_t>(x)].v[l];
        }
    });
}

void splineFilterColumns(Image& image) {
    // A strip of columns at a time, all of them side by side.
    constexpr std::size_t kStrip = 256;
    const int height = image.height();
    if (height == 1) return;
    parallelFor(static_cast<std::size_t>(image.width()), kStrip, [&](std::size_t begin, std::size_t end) {
        const std::size_t count = end - begin;
        std::vector<float> start(count);
        const int period = 2 * (height - 1);
        float power = kGain;
        for (int k = 0; k < kHorizon; ++k, power *= kPole) {
            const int phase = k % period;
            const float* row = image.row(phase < height ? phase : period - phase) + begin;
            for (std::size_t x = 0; x < count; ++x)
                start[x] += power * row[x];
        }
        std::copy(start.begin(), start.end(), image.row(0) + begin);
        for (int y = 1; y < height; ++y) {
            float* row = image.row(y) + begin;
            const float* above = image.row(y - 1) + begin;
            for (std::size_t x = 0; x < count; ++x)
                row[x] = kGain * row[x] + kPole * above[x];
        }
        float* last = image.row(height - 1) + begin;
        const float* above = image.row(height - 2) + begin;
        for (std::size_t x = 0; x < count; ++x)
            last[x] = kEnd * (last[x] + kPole * above[x]);
        for (int y = height - 2; y >= 0; --y) {
            float* row = image.row(y) + begin;
            const float* below = image.row(y + 1) + begin;
            for (std::size_t x = 0; x < count; ++x)
                row[x] = kPole * (below[x] - row[x]);
        }
    });
}

}  // namespace fluorocut
