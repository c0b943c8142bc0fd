// The nearest of many sweeps to a point, through a tree of bounding boxes. mm.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "core/cutting/tool_path.h"

namespace fluorocut {

class SweepTree {
  public:
    // Of the moves that may take something away (all but rapid ones).
    explicit SweepTree(const ToolPath& path);

    struct Nearest {
        double distance_mm = std::numeric_limits<double>::infinity();  // of the point from the sweep's parallelogram
        Vector3 foot = Vector3::Zero();                                // on it
    };
    // Of the sweeps nearer than `most_mm`; any that is nearer than `enough_mm` will do.
    Nearest nearest(const Vector3& point, double most_mm = std::numeric_limits<double>::infinity(),
                    double enough_mm = 0) const;

    bool empty() const { return segments_.empty(); }

  private:
    struct Node {
        Vector3 low, high;
        std::uint32_t begin = 0, end = 0;  // of the segments below it
        std::uint32_t right = 0;           // the left child follows its parent; 0: a leaf
    };
    std::uint32_t build(std::uint32_t begin, std::uint32_t end);

    std::vector<ToolSegment> segments_;
    double length_mm_;
    std::vector<Node> nodes_;
};

}  // namespace fluorocut
