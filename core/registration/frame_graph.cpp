#include "core/registration/frame_graph.h"

#include <algorithm>
#include <limits>
#include <map>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "core/base/chi_square.h"

namespace fluorocut {
namespace {

constexpr double kLeverMm = 100;
// Edges that are exact still count as steps, and their loops must close to this (rounding in files).
constexpr double kLeastSigmaMm = 1e-4;

double lengthOf(const MeasuredPose& edge) {
    double variance = kLeastSigmaMm * kLeastSigmaMm;
    if (edge.pose.covariance) {
        variance += edge.pose.covariance->topLeftCorner<3, 3>().trace() +
                    kLeverMm * kLeverMm * edge.pose.covariance->bottomRightCorner<3, 3>().trace();
    }
    return variance;
}

}  // namespace

std::string FrameNode::text() const {
    std::string text(name(frame));
    if (!view.empty()) text += " of " + view;
    return text;
}

// The pose along some steps and how it follows the error of each measurement.
struct FrameGraph::Product {
    Rigid3 pose;
    struct Effect {
        std::size_t edge;  // the first that has this error
        Matrix6 by_error;
    };
    std::vector<Effect> effects;

    Matrix6 covariance(const std::vector<MeasuredPose>& edges) const {
        Matrix6 sum = Matrix6::Zero();
        for (const Effect& effect : effects) {
            if (const auto& covariance = edges[effect.edge].pose.covariance)
                sum += effect.by_error * *covariance * effect.by_error.transpose();
        }
        return sum;
    }
};

std::size_t FrameGraph::nodeOf(const FrameNode& node) const {
    return static_cast<std::size_t>(std::find(nodes_.begin(), nodes_.end(), node) - nodes_.begin());
}

std::size_t FrameGraph::add(MeasuredPose edge) {
    if (edge.pose.target != edge.target.frame || edge.pose.source != edge.source.frame || edge.target == edge.source) {
        throw std::logic_error("FrameGraph: a pose " + std::string(name(edge.pose.target)) + "_from_" +
                               std::string(name(edge.pose.source)) + " between " + edge.target.text() + " and " +
                               edge.source.text());
    }
    for (const FrameNode& node : {edge.target, edge.source})
        if (nodeOf(node) == nodes_.size()) nodes_.push_back(node);
    edges_.push_back(std::move(edge));
    return edges_.size() - 1;
}

int FrameGraph::markStale(const FrameNode& node, const std::string& why) {
    int count = 0;
    for (MeasuredPose& edge : edges_) {
        if (edge.target != node && edge.source != node) continue;
        if (edge.stale.empty()) ++count;
        edge.stale = why;
    }
    return count;
}

FrameGraph::Product FrameGraph::product(const std::vector<FrameStep>& steps) const {
    Product result;
    std::map<std::string, std::size_t> common;
    for (const FrameStep& step : steps) {
        const MeasuredPose& edge = edges_[step.edge];
        const Rigid3& measured = edge.pose.target_from_source;
        const Rigid3 next = step.inverted ? measured.inverse() : measured;
        // Errors so far, seen through the next factor; then the next one's own.
        const Matrix6 left = productByLeft(result.pose, next);
        for (Product::Effect& effect : result.effects)
            effect.by_error = left * effect.by_error;
        Matrix6 own = productByRight(result.pose);
        if (step.inverted) own = own * inverseByPose(measured);
        result.pose = result.pose * next;
        if (!edge.common.empty()) {
            const auto [known, is_new] = common.try_emplace(edge.common, result.effects.size());
            if (!is_new) {
                result.effects[known->second].by_error += own;
                continue;
            }
        }
        result.effects.push_back({step.edge, own});
    }
    return result;
}

std::string FrameGraph::textOf(const FrameNode& from, const std::vector<FrameStep>& steps) const {
    std::string text = from.text();
    for (const FrameStep& step : steps) {
        const MeasuredPose& edge = edges_[step.edge];
        text += " <- " + (step.inverted ? edge.target : edge.source).text() + " (" + edge.measured_by;
        if (!edge.time.empty()) text += ", " + edge.time;
        if (!edge.stale.empty()) text += ", stale: " + edge.stale;
        text += ")";
    }
    return text;
}

std::vector<std::vector<FrameStep>> FrameGraph::pathsFrom(std::size_t node, const std::vector<bool>& use,
                                                          std::vector<bool>* tree) const {
    std::vector<std::vector<FrameStep>> paths(nodes_.size());
    std::vector<double> length(nodes_.size(), std::numeric_limits<double>::infinity());
    std::vector<bool> done(nodes_.size(), false);
    if (node >= nodes_.size()) return paths;
    length[node] = 0;
    for (;;) {
        std::size_t next = nodes_.size();
        for (std::size_t i = 0; i < nodes_.size(); ++i) {
            if (!done[i] && length[i] < std::numeric_limits<double>::infinity() &&
                (next == nodes_.size() || length[i] < length[next]))
                next = i;
        }
        if (next == nodes_.size()) break;
        done[next] = true;
        if (tree && !paths[next].empty()) (*tree)[paths[next].back().edge] = true;
        for (std::size_t e = 0; e < edges_.size(); ++e) {
            if (!use[e]) continue;
            const std::size_t target = nodeOf(edges_[e].target), source = nodeOf(edges_[e].source);
            if (target != next && source != next) continue;
            const std::size_t other = target == next ? source : target;
            const double reached = length[next] + lengthOf(edges_[e]);
            if (done[other] || reached >= length[other]) continue;
            length[other] = reached;
            paths[other] = paths[next];
            paths[other].push_back({e, source == next});
        }
    }
    return paths;
}

Result<FoundTransform> FrameGraph::find(const FrameNode& target, const FrameNode& source, bool allow_stale) const {
    const std::string where = target.text() + " from " + source.text();
    if (target == source) throw std::logic_error("FrameGraph::find: " + where);
    const std::size_t to = nodeOf(target), from = nodeOf(source);
    std::vector<bool> fresh(edges_.size());
    for (std::size_t e = 0; e < edges_.size(); ++e)
        fresh[e] = edges_[e].stale.empty();
    const std::vector<bool> all(edges_.size(), true);
    std::vector<FrameStep> steps;
    if (to < nodes_.size() && from < nodes_.size()) {
        steps = pathsFrom(to, fresh, nullptr)[from];
        if (steps.empty()) {
            const std::vector<FrameStep> stale = pathsFrom(to, all, nullptr)[from];
            if (!stale.empty() && !allow_stale) {
                return noSolution(where, "only measurements that hold no longer: " + textOf(target, stale),
                                  "fresh measurements", "measure anew what is stale");
            }
            steps = stale;
        }
    }
    if (steps.empty())
        return noSolution(where, "no measurements that join the two", "a chain of measured poses between them");
    const Product along = product(steps);
    FoundTransform found;
    found.pose = {target.frame, source.frame, along.pose, along.covariance(edges_)};
    found.steps = steps;
    found.text = textOf(target, steps);
    for (const FrameStep& step : steps) {
        const MeasuredPose& edge = edges_[step.edge];
        if (!edge.stale.empty()) found.stale.push_back(edge.measured_by + ": " + edge.stale);
    }
    return found;
}

std::vector<StepShare> FrameGraph::budget(const FoundTransform& found, const Vector3& point_in_source) const {
    const Product along = product(found.steps);
    const auto by_pose = pointByPose(along.pose, point_in_source);
    std::vector<StepShare> shares;
    double all = 0;
    for (const Product::Effect& effect : along.effects) {
        const MeasuredPose& edge = edges_[effect.edge];
        const auto by_error = by_pose * effect.by_error;
        const Matrix3 covariance = by_error * edge.pose.covariance.value_or(Matrix6::Zero()) * by_error.transpose();
        shares.push_back({edge.measured_by, covariance, covariance.trace()});
        all += covariance.trace();
    }
    for (StepShare& share : shares)
        share.share = all > 0 ? share.share / all : 0;
    std::stable_sort(shares.begin(), shares.end(),
                     [](const StepShare& a, const StepShare& b) { return a.share > b.share; });
    return shares;
}

std::vector<FrameLoop> FrameGraph::loops() const {
    std::vector<bool> fresh(edges_.size()), tree(edges_.size(), false);
    for (std::size_t e = 0; e < edges_.size(); ++e)
        fresh[e] = edges_[e].stale.empty();
    // A tree for every island.
    std::vector<bool> seen(nodes_.size(), false);
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
        if (seen[i]) continue;
        const auto paths = pathsFrom(i, fresh, &tree);
        for (std::size_t j = 0; j < nodes_.size(); ++j)
            seen[j] = seen[j] || j == i || !paths[j].empty();
    }
    std::vector<FrameLoop> loops;
    for (std::size_t e = 0; e < edges_.size(); ++e) {
        if (!fresh[e] || tree[e]) continue;
        FrameLoop loop;
        // The edge from its target to its source, then back over the tree.
        loop.steps = pathsFrom(nodeOf(edges_[e].source), tree, nullptr)[nodeOf(edges_[e].target)];
        loop.steps.insert(loop.steps.begin(), FrameStep{e, false});
        const Product around = product(loop.steps);
        const Vector6 gap = around.pose.deltaFrom(Rigid3::identity());
        Vector6 scale;
        scale << 1, 1, 1, kLeverMm, kLeverMm, kLeverMm;
        Matrix6 scaled = scale.asDiagonal() * around.covariance(edges_) * scale.asDiagonal();
        scaled.diagonal().array() += kLeastSigmaMm * kLeastSigmaMm;
        const Vector6 whitened = scale.cwiseProduct(gap);
        loop.chi_square = whitened.dot(scaled.ldlt().solve(whitened));
        loop.probability = chiSquareTail(loop.chi_square, 6);
        loop.gap_mm = gap.head<3>().norm();
        loop.gap_rad = gap.tail<3>().norm();
        loop.text = textOf(edges_[e].target, loop.steps);
        loops.push_back(std::move(loop));
    }
    std::stable_sort(loops.begin(), loops.end(),
                     [](const FrameLoop& a, const FrameLoop& b) { return a.chi_square > b.chi_square; });
    return loops;
}

}  // namespace fluorocut
