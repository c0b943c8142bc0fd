#include "core/cutting/sweep_tree.h"

#include <algorithm>
#include <cmath>

namespace fluorocut {
namespace {

constexpr std::uint32_t kLeaf = 4;

double squaredDistanceToBox(const Vector3& low, const Vector3& high, const Vector3& point) {
    return (low - point).cwiseMax(point - high).cwiseMax(0).squaredNorm();
}

}  // namespace

SweepTree::SweepTree(const ToolPath& path) : length_mm_(path.cutter.length_mm) {
    for (const ToolMove& move : path.moves)
        if (move.motion != ToolMotion::rapid) segments_.push_back(move.segment);
    nodes_.reserve(segments_.size());
    if (!segments_.empty()) build(0, static_cast<std::uint32_t>(segments_.size()));
}

std::uint32_t SweepTree::build(std::uint32_t begin, std::uint32_t end) {
    const std::uint32_t id = static_cast<std::uint32_t>(nodes_.size());
    Node node;
    node.begin = begin;
    node.end = end;
    node.low.setConstant(std::numeric_limits<double>::infinity());
    node.high = -node.low;
    Vector3 low = node.low, high = node.high;  // of the balls' ways alone: what is told apart
    for (std::uint32_t i = begin; i < end; ++i) {
        const ToolSegment& s = segments_[i];
        low = low.cwiseMin(s.from_mm + s.to_mm);
        high = high.cwiseMax(s.from_mm + s.to_mm);
        for (const Vector3& end_point : {s.from_mm, s.to_mm}) {
            const Vector3 up = end_point + length_mm_ * s.spindle;
            node.low = node.low.cwiseMin(end_point).cwiseMin(up);
            node.high = node.high.cwiseMax(end_point).cwiseMax(up);
        }
    }
    nodes_.push_back(node);
    if (end - begin <= kLeaf) return id;
    Eigen::Index axis = 0;
    (high - low).maxCoeff(&axis);
    const std::uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(segments_.begin() + begin, segments_.begin() + middle, segments_.begin() + end,
                     [axis](const ToolSegment& a, const ToolSegment& b) {
                         return a.from_mm[axis] + a.to_mm[axis] < b.from_mm[axis] + b.to_mm[axis];
                     });
    build(begin, middle);
    const std::uint32_t right = build(middle, end);
    nodes_[id].right = right;
    return id;
}

SweepTree::Nearest SweepTree::nearest(const Vector3& point, double most_mm, double enough_mm) const {
    Nearest best;
    if (nodes_.empty()) return best;
    double best2 = most_mm * most_mm;
    const double enough2 = enough_mm * enough_mm;
    struct Open {
        std::uint32_t node;
        double bound2;
    };
    Open stack[64];
    int open = 0;
    stack[open++] = {0, squaredDistanceToBox(nodes_[0].low, nodes_[0].high, point)};
    while (open > 0) {
        const Open here = stack[--open];
        if (here.bound2 >= best2) continue;
        const Node& node = nodes_[here.node];
        if (node.right == 0) {
            for (std::uint32_t i = node.begin; i < node.end; ++i) {
                const Vector3 foot = nearestOnSweep(segments_[i], length_mm_, point);
                const double distance2 = (point - foot).squaredNorm();
                if (distance2 >= best2) continue;
                best2 = distance2;
                best.foot = foot;
                best.distance_mm = std::sqrt(distance2);
                if (best2 <= enough2) return best;
            }
            continue;
        }
        Open left{here.node + 1, 0}, right{node.right, 0};
        left.bound2 = squaredDistanceToBox(nodes_[left.node].low, nodes_[left.node].high, point);
        right.bound2 = squaredDistanceToBox(nodes_[right.node].low, nodes_[right.node].high, point);
        // The nearer one is looked at first.
        if (left.bound2 < right.bound2) std::swap(left, right);
        stack[open++] = left;
        stack[open++] = right;
    }
    return best;
}

}  // namespace fluorocut
