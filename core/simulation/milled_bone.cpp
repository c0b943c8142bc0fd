#include "core/simulation/milled_bone.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/base/option_checks.h"
#include "core/cutting/removal.h"

namespace fluorocut {
namespace {

constexpr double kBallTolerance = 0.005;  // mm
constexpr double kShankTolerance = 0.02;
constexpr double kShankAt = 60;          // mm up the spindle
constexpr std::size_t kLongestRun = 60;  // places between two that are kept
constexpr double kBlock = 4;             // mm
constexpr double kPart = 0.5;            // mm
constexpr double kFeelEvery = 0.1;       // mm of way
constexpr double kHandedOut = 0.02;      // of what is pending, with every step
constexpr double kShortShank = 4;        // mm, where it cuts nothing

// Of a point from the chord a b.
double offChord(const Vector3& point, const Vector3& a, const Vector3& b) {
    const Vector3 way = b - a;
    const double length2 = way.squaredNorm();
    const double at = length2 > 0 ? std::clamp((point - a).dot(way) / length2, 0.0, 1.0) : 0;
    return (point - a - at * way).norm();
}

}  // namespace

Result<void> MilledBoneOptions::validate() const {
    return requireRanges({{"fill_hu", fill_hu, -1024, 3071, "HU"},
                          {"hard_above_hu", hard_above_hu, -1024, 3071, "HU"},
                          {"matter_above_hu", matter_above_hu, -1024, 3071, "HU"}});
}

MilledBone::MilledBone(std::shared_ptr<const Volume> whole, const Cutter& cutter, const MilledBoneOptions& options)
    : whole_(std::move(whole)), cutter_(cutter), options_(options) {
    if (!whole_ || whole_->empty()) throw std::logic_error("MilledBone: no volume");
    if (auto ok = options_.validate(); !ok) throw std::logic_error(ok.error().message());
    if (auto ok = cutter_.validate(); !ok) throw std::logic_error(ok.error().message());
    const VolumeGrid& grid = whole_->grid();
    std::size_t parts = grid.voxelCount(), blocks = 1;
    std::array<int, 3> grow{};
    for (std::size_t a = 0; a < 3; ++a) {
        const double spacing = grid.spacing_mm[static_cast<Eigen::Index>(a)];
        parts_[a] = std::max(1, static_cast<int>(std::ceil(spacing / kPart - 1e-9)));
        parts *= static_cast<std::size_t>(parts_[a]);
        block_voxels_[a] = std::max(1, static_cast<int>(std::lround(kBlock / spacing)));
        blocks_[a] = (grid.size[a] + block_voxels_[a] - 1) / block_voxels_[a];
        blocks *= static_cast<std::size_t>(blocks_[a]);
        // A block more, since places on the shank are looked at half a block apart.
        grow[a] = 1 + static_cast<int>(std::ceil(cutter_.radius_mm / (block_voxels_[a] * spacing)));
    }
    gone_.assign(parts, false);
    matter_.assign(blocks, false);
    const auto at = [&](int i, int j, int k) {
        return (static_cast<std::size_t>(k) * static_cast<std::size_t>(blocks_[1]) + static_cast<std::size_t>(j)) *
                   static_cast<std::size_t>(blocks_[0]) +
               static_cast<std::size_t>(i);
    };
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j) {
            const float* row = whole_->row(j, k);
            for (int i = 0; i < grid.size[0]; ++i)
                if (row[i] > options_.matter_above_hu)
                    matter_[at(i / block_voxels_[0], j / block_voxels_[1], k / block_voxels_[2])] = true;
        }
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::vector<bool> before = matter_;
        for (int k = 0; k < blocks_[2]; ++k)
            for (int j = 0; j < blocks_[1]; ++j)
                for (int i = 0; i < blocks_[0]; ++i) {
                    if (!before[at(i, j, k)]) continue;
                    for (int g = -grow[axis]; g <= grow[axis]; ++g) {
                        std::array<int, 3> n{i, j, k};
                        n[axis] = std::clamp(n[axis] + g, 0, blocks_[axis] - 1);
                        matter_[at(n[0], n[1], n[2])] = true;
                    }
                }
    }
}

bool MilledBone::nearMatter(const Rigid3& femur_from_cutter) const {
    const VolumeGrid& grid = whole_->grid();
    const Vector3 ball = grid.indexFromPoint(femur_from_cutter.translation());
    const Vector3 step =
        (grid.direction.transpose() * femur_from_cutter.rotate(Vector3::UnitZ())).cwiseQuotient(grid.spacing_mm) *
        (0.5 * kBlock);
    const int steps = static_cast<int>(std::ceil(cutter_.length_mm / (0.5 * kBlock)));
    // The grid reaches no farther than its own matter: a cutter beside it is a radius away at most.
    const Vector3 margin = (Vector3::Constant(cutter_.radius_mm + kBlock)).cwiseQuotient(grid.spacing_mm);
    for (int s = 0; s <= steps; ++s) {
        const Vector3 index = ball + s * step;
        std::array<int, 3> block{};
        bool inside = true;
        for (std::size_t a = 0; a < 3; ++a) {
            const auto n = static_cast<Eigen::Index>(a);
            inside = inside && index[n] > -margin[n] && index[n] < grid.size[a] + margin[n];
            if (!inside) break;
            const double within = std::clamp(index[n] + 0.5, 0.0, grid.size[a] - 1.0);
            block[a] = static_cast<int>(within) / block_voxels_[a];
        }
        if (inside && matter_[(static_cast<std::size_t>(block[2]) * static_cast<std::size_t>(blocks_[1]) +
                               static_cast<std::size_t>(block[1])) *
                                  static_cast<std::size_t>(blocks_[0]) +
                              static_cast<std::size_t>(block[0])])
            return true;
    }
    return false;
}

double MilledBone::cut(const Rigid3& before, const Rigid3& after) {
    const auto placeOf = [](const Rigid3& pose) { return Place{pose.translation(), pose * Vector3(0, 0, kShankAt)}; };
    if (nearMatter(after)) {
        if (run_.empty()) run_.push_back(placeOf(before));
        take(placeOf(after));
        if ((after.translation() - felt_at_).norm() >= kFeelEvery) {
            felt_at_ = after.translation();
            pending_mm3_ += removeBall(felt_at_);
        }
    } else if (!run_.empty()) {
        endRun();
        run_.clear();
    }
    const double felt = kHandedOut * pending_mm3_;
    pending_mm3_ -= felt;
    return felt;
}

void MilledBone::take(const Place& place) {
    bool straight = run_.size() < kLongestRun;
    for (std::size_t n = 1; n < run_.size() && straight; ++n) {
        straight = offChord(run_[n].ball, run_.front().ball, place.ball) <= kBallTolerance &&
                   offChord(run_[n].shank, run_.front().shank, place.shank) <= kShankTolerance;
    }
    if (!straight) {
        endRun();
        const Place last = run_.back();
        run_.assign(1, last);
    }
    run_.push_back(place);
}

void MilledBone::appendRun(std::vector<ToolMove>& way) const {
    if (run_.size() < 2) return;
    const Place &from = run_.front(), &to = run_.back();
    ToolMove move;
    move.segment.from_mm = from.ball;
    move.segment.to_mm = to.ball;
    move.segment.spindle = (from.shank - from.ball + to.shank - to.ball).normalized();
    way.push_back(move);
}

void MilledBone::endRun() {
    if (run_.size() < 2) return;
    appendRun(removeShank(run_.back()) ? shank_way_ : way_);
}

bool MilledBone::isThere(const Vector3& point) const {
    const VolumeGrid& grid = whole_->grid();
    const Vector3 index = grid.indexFromPoint(point) + Vector3::Constant(0.5);
    std::size_t part = 0;
    for (Eigen::Index n = 2; n >= 0; --n) {
        const auto a = static_cast<std::size_t>(n);
        if (!(index[n] >= 0 && index[n] < grid.size[a])) return false;
        part =
            part * static_cast<std::size_t>(grid.size[a] * parts_[a]) + static_cast<std::size_t>(index[n] * parts_[a]);
    }
    if (gone_[part]) return false;
    return (*whole_)(static_cast<int>(index.x()), static_cast<int>(index.y()), static_cast<int>(index.z())) >
           options_.matter_above_hu;
}

bool MilledBone::removeShank(const Place& place) {
    const Vector3 axis = (place.shank - place.ball).normalized();
    const Vector3 u = axis.unitOrthogonal(), v = axis.cross(u);
    const double rim = std::max(0.0, cutter_.radius_mm - 1);
    bool cuts = false;
    for (double up = kShortShank; up < cutter_.length_mm; up += 1.5) {
        const Vector3 middle = place.ball + up * axis;
        if (!isThere(middle) && !isThere(middle + rim * u) && !isThere(middle - rim * u) &&
            !isThere(middle + rim * v) && !isThere(middle - rim * v))
            continue;
        cuts = true;
        pending_mm3_ += removeBall(middle);
    }
    return cuts;
}

bool MilledBone::hard(int i, int j, int k) const {
    return (*whole_)(i / parts_[0], j / parts_[1], k / parts_[2]) > options_.hard_above_hu;
}

double MilledBone::removeBall(const Vector3& center) {
    const VolumeGrid& grid = whole_->grid();
    // Parts are numbered through; the first one's corner is the first voxel's.
    const Vector3 parts(parts_[0], parts_[1], parts_[2]);
    const Vector3 size = grid.spacing_mm.cwiseQuotient(parts);
    const Vector3 middle =
        (grid.indexFromPoint(center) + Vector3::Constant(0.5)).cwiseProduct(parts) - Vector3::Constant(0.5);
    std::array<int, 3> low{}, high{}, count{};
    for (std::size_t a = 0; a < 3; ++a) {
        const auto n = static_cast<Eigen::Index>(a);
        count[a] = grid.size[a] * parts_[a];
        const double reach = cutter_.radius_mm / size[n];
        low[a] = static_cast<int>(std::ceil(std::clamp(middle[n] - reach, 0.0, 1e9)));
        high[a] = static_cast<int>(std::floor(std::clamp(middle[n] + reach, -1.0, count[a] - 1.0)));
    }
    std::size_t removed = 0;
    const double radius2 = cutter_.radius_mm * cutter_.radius_mm;
    for (int k = low[2]; k <= high[2]; ++k) {
        for (int j = low[1]; j <= high[1]; ++j) {
            const double rest2 =
                radius2 - std::pow((k - middle.z()) * size.z(), 2) - std::pow((j - middle.y()) * size.y(), 2);
            if (!(rest2 >= 0)) continue;
            const double half = std::sqrt(rest2) / size.x();
            const int first = std::max(low[0], static_cast<int>(std::ceil(middle.x() - half)));
            const int last = std::min(high[0], static_cast<int>(std::floor(middle.x() + half)));
            const std::size_t row =
                (static_cast<std::size_t>(k) * static_cast<std::size_t>(count[1]) + static_cast<std::size_t>(j)) *
                static_cast<std::size_t>(count[0]);
            for (int i = first; i <= last; ++i) {
                if (gone_[row + static_cast<std::size_t>(i)]) continue;
                gone_[row + static_cast<std::size_t>(i)] = true;
                removed += hard(i, j, k);
            }
        }
    }
    return static_cast<double>(removed) * size.prod();
}

namespace {

// What a way sweeps, put into `fraction` where it is more. Only the part of the grid is looked at that it can reach.
void addSwept(const ToolPath& path, Volume& fraction) {
    if (path.moves.empty()) return;
    const VolumeGrid& grid = fraction.grid();
    Vector3 low = Vector3::Constant(1e9), high = -low;
    for (const ToolMove& move : path.moves) {
        for (const Vector3& end : {move.segment.from_mm, move.segment.to_mm}) {
            for (const Vector3& point : {end, Vector3(end + path.cutter.length_mm * move.segment.spindle)}) {
                const Vector3 index = grid.indexFromPoint(point);
                low = low.cwiseMin(index);
                high = high.cwiseMax(index);
            }
        }
    }
    VolumeGrid part = grid;
    std::array<int, 3> first{};
    for (std::size_t a = 0; a < 3; ++a) {
        const auto n = static_cast<Eigen::Index>(a);
        const double reach = path.cutter.radius_mm / grid.spacing_mm[n] + 1;
        first[a] = static_cast<int>(std::floor(std::clamp(low[n] - reach, 0.0, grid.size[a] - 1.0)));
        const int last = static_cast<int>(std::ceil(std::clamp(high[n] + reach, 0.0, grid.size[a] - 1.0)));
        part.size[a] = last - first[a] + 1;
    }
    part.origin_mm = grid.pointFromIndex(Vector3(first[0], first[1], first[2]));
    const Volume swept = removedFraction(path, Rigid3(), part);
    for (int k = 0; k < part.size[2]; ++k)
        for (int j = 0; j < part.size[1]; ++j)
            for (int i = 0; i < part.size[0]; ++i) {
                float& here = fraction(i + first[0], j + first[1], k + first[2]);
                here = std::max(here, swept(i, j, k));
            }
}

}  // namespace

Volume MilledBone::removedFraction() const {
    Volume fraction(whole_->grid());
    ToolPath path;
    path.cutter = cutter_;
    path.moves = shank_way_;
    appendRun(path.moves);
    addSwept(path, fraction);
    path.moves = way_;
    path.cutter.length_mm = std::min(kShortShank, cutter_.length_mm);
    addSwept(path, fraction);
    return fraction;
}

std::shared_ptr<const Volume> MilledBone::remaining() const {
    const Volume fraction = removedFraction();
    auto left = std::make_shared<Volume>(*whole_);
    const auto fill = static_cast<float>(options_.fill_hu);
    for (std::size_t n = 0; n < left->voxels().size(); ++n) {
        const float gone = fraction.voxels()[n];
        // What is thinner than the filling, air above the opening, is not filled.
        float& hu = left->voxels()[n];
        if (gone > 0 && hu > options_.matter_above_hu) hu += gone * (fill - hu);
    }
    return left;
}

}  // namespace fluorocut
