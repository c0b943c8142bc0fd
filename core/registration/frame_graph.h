// FrameGraph: which measurement each transform came from, when, and how uncertain it is. Frames are nodes (those that
// exist once for each image carry its name: "imager of ap"), measured poses are edges with the text of who measured
// them, their time, and whether they still hold: after the patient has moved, what was measured before is stale.
//
//     target_from_source = product of the poses along a path, each as measured or inverted
//
// The path is the one of the least variance (of a point 100 mm from the origins, in the sum over the edges) over fresh
// edges; the covariance of the product is propagated to first order. Edges that come from one measurement (the
// hand-eye pose, used once for every image) share its error: they name it in `common`, and their effects are added
// before they are squared.
//
// A loop of edges must close: the pose around it is the identity but for the edges' errors. One that does not, by
// chi-square, contradicts itself: at least one of its edges is wrong, or moved.
#pragma once

#include <compare>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/pose.h"

namespace fluorocut {

struct FrameNode {
    Frame frame = Frame::robot;
    std::string view;  // of frames that exist once for each image; otherwise empty

    std::string text() const;  // "imager of ap"
    friend auto operator<=>(const FrameNode&, const FrameNode&) = default;
};

struct MeasuredPose {
    FrameNode target, source;
    Pose pose;                // of the same frames; without covariance: exact
    std::string measured_by;  // "corkscrew in ap.dcm, 0.04 px"
    std::string time;         // when, ISO 8601; empty: unknown
    std::string common;       // edges of one name share one error
    std::string stale;        // why it does not hold any more; empty: it does
};

struct FrameStep {
    std::size_t edge = 0;
    bool inverted = false;
};

struct FoundTransform {
    Pose pose;                       // with covariance
    std::vector<FrameStep> steps;    // from target to source
    std::string text;                // "robot <- flange of ap (robot controller) <- ..."
    std::vector<std::string> stale;  // of stale edges that were taken because they were allowed: why
};

struct StepShare {
    std::string measured_by;  // edges with a common error are one
    Matrix3 covariance_mm2;
    double share = 0;  // of the variance; the shares add up to 1
};

struct FrameLoop {
    std::vector<FrameStep> steps;
    std::string text;
    double gap_mm = 0;  // around the loop, from the first node back to it
    double gap_rad = 0;
    double chi_square = 0;   // 6 degrees of freedom
    double probability = 1;  // of a larger one
};

class FrameGraph {
  public:
    // Throws std::logic_error where the pose's frames are not those of the nodes, or a node is joined to itself.
    std::size_t add(MeasuredPose edge);
    // What was measured in these views, or between these frames, holds no longer. Gives the number of edges.
    int markStale(const FrameNode& node, const std::string& why);

    const std::vector<MeasuredPose>& edges() const { return edges_; }

    // noSolution when nothing joins the two; says which stale edges would.
    Result<FoundTransform> find(const FrameNode& target, const FrameNode& source, bool allow_stale = false) const;
    // What each step adds to the error of a point fixed in the source frame, largest first.
    std::vector<StepShare> budget(const FoundTransform& found, const Vector3& point_in_source) const;
    // One loop for every fresh edge beyond those of the best tree, the least likely first. Those of probability below
    // a limit contradict themselves.
    std::vector<FrameLoop> loops() const;

  private:
    struct Product;
    Product product(const std::vector<FrameStep>& steps) const;
    std::string textOf(const FrameNode& from, const std::vector<FrameStep>& steps) const;
    // Steps to every node from one, over edges that `use` allows; least variance first.
    std::vector<std::vector<FrameStep>> pathsFrom(std::size_t node, const std::vector<bool>& use,
                                                  std::vector<bool>* tree) const;
    std::size_t nodeOf(const FrameNode& node) const;  // nodes_.size(): none

    std::vector<FrameNode> nodes_;
    std::vector<MeasuredPose> edges_;
};

}  // namespace fluorocut
