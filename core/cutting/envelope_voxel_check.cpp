// The envelope check on voxels: see envelope_check.h.
//
// The distance transform is Felzenszwalb's and Huttenlocher's (2012), exact and linear in the voxels: the lower
// envelope of parabolas along each axis in turn. Its sites are all voxels that the envelope does not fill. Where the
// surface cuts one, it lies at a signed distance e from the voxel's centre along its normal, told by the filled part; a
// cutter whose centre is at the distance L from the voxel's centre along that normal is L + e from the surface. With
// the site's start value
//
//     2 R e + e^2              (L + e)^2 = L^2 + 2 R e + e^2 + 2 e (L - R)
//
// the transform gives the distance to the surface itself where it is the cutter's radius R, the only distance that is
// asked for: within e (L - R) / R.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include <fmt/format.h>

#include "core/base/parallel.h"
#include "core/cutting/envelope_check.h"
#include "core/cutting/move_flaw.h"
#include "core/geometry/mesh_properties.h"
#include "core/image/voxelize.h"

namespace fluorocut {
namespace {

constexpr double kOwnTolerance = 0.25;  // voxels: see envelope_check.h
constexpr std::size_t kMostVoxels = std::size_t{1} << 27;
constexpr float kFar = 1e9f;  // no site

// Where a plane with this normal leaves this part of a unit cube on its inner side: its distance from the cube's middle
// along the normal.
double planeOffset(const Vector3& normal, double filled) {
    // The volume below a plane in a cube is a sum of tetrahedra at its corners; flat ones are kept from vanishing.
    const Vector3 n = normal.cwiseAbs().cwiseMax(1e-3);
    const double sum = n.sum();
    const auto cube = [](double x) { return x > 0 ? x * x * x : 0.0; };
    const auto volume = [&](double t) {
        double v = cube(t) - cube(t - sum);
        for (int k = 0; k < 3; ++k)
            v += cube(t - n[k] - n[(k + 1) % 3]) - cube(t - n[k]);
        return v / (6 * n.prod());
    };
    double low = 0, high = sum;
    for (int i = 0; i < 30; ++i)
        (volume(0.5 * (low + high)) < filled ? low : high) = 0.5 * (low + high);
    return 0.5 * (low + high) - 0.5 * sum;
}

// min over q of (p - q)^2 h^2 + f(q), in place, for values `step` apart, and the site at which it is reached.
class LineTransform {
  public:
    explicit LineTransform(int count)
        : values_(static_cast<std::size_t>(count)),
          names_(static_cast<std::size_t>(count)),
          sites_(static_cast<std::size_t>(count)),
          from_(static_cast<std::size_t>(count)) {}

    void operator()(float* line, std::int32_t* name, std::size_t step, double h) {
        const int count = static_cast<int>(values_.size());
        const double h2 = h * h;
        int last = -1;
        for (int q = 0; q < count; ++q) {
            const double f = static_cast<double>(line[static_cast<std::size_t>(q) * step]);
            at(values_, q) = f;
            at(names_, q) = name[static_cast<std::size_t>(q) * step];
            if (f >= static_cast<double>(kFar)) continue;
            double from = -std::numeric_limits<double>::infinity();
            while (last >= 0) {
                const int v = at(sites_, last);
                from = 0.5 * (q + v) + 0.5 * (f - at(values_, v)) / (h2 * (q - v));
                if (from > at(from_, last)) break;
                --last;
            }
            if (last < 0) from = -std::numeric_limits<double>::infinity();
            ++last;
            at(sites_, last) = q;
            at(from_, last) = from;
        }
        if (last < 0) return;
        for (int p = 0, k = 0; p < count; ++p) {
            while (k < last && at(from_, k + 1) <= p)
                ++k;
            const int v = at(sites_, k);
            line[static_cast<std::size_t>(p) * step] = static_cast<float>(h2 * (p - v) * (p - v) + at(values_, v));
            name[static_cast<std::size_t>(p) * step] = at(names_, v);
        }
    }

  private:
    template <class T>
    static T& at(std::vector<T>& values, int i) {
        return values[static_cast<std::size_t>(i)];
    }
    std::vector<double> values_;
    std::vector<std::int32_t> names_;
    std::vector<int> sites_;
    std::vector<double> from_;
};

// Distance from the envelope's walls for a cutter of one radius; its open end is the grid's upper face.
class VoxelEnvelope {
  public:
    static Result<VoxelEnvelope> of(const TriangleMesh& mesh, double radius, double voxel_mm) {
        Vector3 low = Vector3::Constant(std::numeric_limits<double>::infinity()), high = -low;
        for (const Vector3& v : mesh.vertices) {
            low = low.cwiseMin(v);
            high = high.cwiseMax(v);
        }
        // Two voxels of nothing round it, but none above the open end.
        VolumeGrid grid;
        grid.spacing_mm.setConstant(voxel_mm);
        double count = 1;
        for (int axis = 0; axis < 3; ++axis) {
            const double size = std::ceil((high[axis] - low[axis]) / voxel_mm) + (axis == 2 ? 2 : 4);
            if (!((count *= size) <= static_cast<double>(kMostVoxels))) {
                return invalidInput("envelope", fmt::format("more than {} voxels of {:g} mm", kMostVoxels, voxel_mm),
                                    "a smaller envelope", "Take coarser voxels.");
            }
            grid.size[static_cast<std::size_t>(axis)] = static_cast<int>(size);
        }
        grid.origin_mm = low - Vector3::Constant(1.5 * voxel_mm);
        grid.origin_mm.z() = high.z() - (grid.size[2] - 0.5) * voxel_mm;
        Result<VoxelCoverage> coverage = voxelize(mesh, Rigid3(), grid, "envelope");
        if (!coverage) return coverage.error();
        return VoxelEnvelope(grid, *coverage, radius, high.z());
    }

    double open() const { return open_; }
    double voxel() const { return grid_.spacing_mm.x(); }

    // Between the voxels' centres: to the nearest of the sites that the eight voxels around have, which is right on
    // ridges of the distance too, where interpolation is not. 0 outside.
    double distance(const Vector3& p) const {
        Vector3 place = (p - grid_.origin_mm) / voxel();
        place.z() = std::min(place.z(), static_cast<double>(grid_.size[2] - 1));
        int base[3];
        for (int axis = 0; axis < 3; ++axis) {
            const int last = grid_.size[static_cast<std::size_t>(axis)] - 1;
            if (!(place[axis] >= 0 && place[axis] <= last)) return 0;
            base[axis] = std::min(static_cast<int>(place[axis]), last - 1);
        }
        double least = std::numeric_limits<double>::infinity();
        std::int32_t before = -1;
        for (int corner = 0; corner < 8; ++corner) {
            const std::int32_t site =
                nearest_(base[0] + (corner & 1), base[1] + (corner >> 1 & 1), base[2] + (corner >> 2));
            if (site == before) continue;
            before = site;
            const int i = site % grid_.size[0], row = site / grid_.size[0];
            const Vector3 at(i, row % grid_.size[1], row / grid_.size[1]);
            const double start = static_cast<double>(start_.voxels()[static_cast<std::size_t>(site)]);
            least = std::min(least, (place - at).squaredNorm() * voxel() * voxel() + start);
        }
        return least > 0 ? std::sqrt(least) : 0;
    }

  private:
    VoxelEnvelope(const VolumeGrid& grid, const VoxelCoverage& coverage, double radius, double open)
        : grid_(grid), start_(grid), nearest_(grid), open_(open) {
        Volume filled(grid);
        const Volume& block = coverage.fraction;
        for (int k = 0; k < block.size(2); ++k)
            for (int j = 0; j < block.size(1); ++j)
                std::copy_n(block.row(j, k), block.size(0),
                            filled.row(j + coverage.offset[1], k + coverage.offset[2]) + coverage.offset[0]);
        placeSites(filled, radius);
        transform();
    }

    void placeSites(const Volume& filled, double radius) {
        const int nx = filled.size(0), ny = filled.size(1), nz = filled.size(2);
        parallelFor(static_cast<std::size_t>(nz), 4, [&](std::size_t begin, std::size_t end) {
            for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k)
                for (int j = 0; j < ny; ++j)
                    for (int i = 0; i < nx; ++i) {
                        float& site = start_(i, j, k);
                        const double part = static_cast<double>(filled(i, j, k));
                        if (part >= 1 - 1e-6) {
                            site = kFar;
                            continue;
                        }
                        // Out of the envelope: down the filled part, over the 3^3 voxels round this one.
                        Vector3 out = Vector3::Zero();
                        for (int dk = -1; dk <= 1; ++dk)
                            for (int dj = -1; dj <= 1; ++dj)
                                for (int di = -1; di <= 1; ++di) {
                                    const double f = static_cast<double>(filled(std::clamp(i + di, 0, nx - 1),
                                                                                std::clamp(j + dj, 0, ny - 1),
                                                                                std::clamp(k + dk, 0, nz - 1)));
                                    const int steps = std::abs(di) + std::abs(dj) + std::abs(dk);
                                    const double weight = steps == 1 ? 4 : steps == 2 ? 2 : 1;
                                    out -= weight * f * Vector3(di, dj, dk);
                                }
                        const double size = out.norm();
                        if (!(size > 1e-6)) {
                            site = 0;  // far outside, or a hole of less than a voxel: its middle
                            continue;
                        }
                        const double e = voxel() * planeOffset(out / size, part);
                        site = static_cast<float>(2 * radius * e + e * e);
                    }
        });
    }

    void transform() {
        Volume work = start_;
        std::iota(nearest_.voxels().begin(), nearest_.voxels().end(), 0);
        const std::size_t nx = static_cast<std::size_t>(grid_.size[0]), ny = static_cast<std::size_t>(grid_.size[1]),
                          nz = static_cast<std::size_t>(grid_.size[2]);
        const auto along = [&](std::size_t count, std::size_t step, std::size_t lines, auto start) {
            parallelFor(lines, 256, [&](std::size_t begin, std::size_t end) {
                LineTransform line(static_cast<int>(count));
                for (std::size_t l = begin; l < end; ++l)
                    line(work.voxels().data() + start(l), nearest_.voxels().data() + start(l), step, voxel());
            });
        };
        along(nx, 1, ny * nz, [&](std::size_t l) { return l * nx; });
        along(ny, nx, nx * nz, [&](std::size_t l) { return l / nx * nx * ny + l % nx; });
        along(nz, nx * ny, nx * ny, [&](std::size_t l) { return l; });
    }

    VolumeGrid grid_;
    Volume start_;                       // of the sites
    BasicVolume<std::int32_t> nearest_;  // site of every voxel, as an index into start_
    double open_;
};

// Farthest that the cutter reaches beyond the envelope on its way, sampled at half a voxel; steps are longer where
// there is room.
double beyondOnTheWay(const VoxelEnvelope& envelope, const ToolSegment& s, double radius) {
    const double step = 0.5 * envelope.voxel(), length = (s.to_mm - s.from_mm).norm();
    const auto stride = [&](double room) { return std::max(step, room - envelope.voxel()); };
    double nearest = std::numeric_limits<double>::infinity();
    for (double way = 0;;) {
        const Vector3 ball = length > 0 ? Vector3(s.from_mm + way / length * (s.to_mm - s.from_mm)) : s.from_mm;
        const double top = (envelope.open() - ball.z()) / s.spindle.z();
        double least = std::numeric_limits<double>::infinity();
        for (double t = 0;;) {
            const double distance = envelope.distance(ball + t * s.spindle);
            least = std::min(least, distance);
            if (t >= top) break;
            t = std::min(t + stride(distance - radius), top);
        }
        nearest = std::min(nearest, least);
        if (way >= length) break;
        way = std::min(way + stride(least - radius), length);
    }
    return radius - nearest;
}

}  // namespace

Result<EnvelopeVerdict> checkByVoxels(const ToolPath& path, const TriangleMesh& envelope,
                                      const EnvelopeOptions& options, Progress& progress) {
    if (Result<void> ok = options.validate(); !ok) return ok.error();
    if (Result<void> ok = path.cutter.validate(); !ok) return ok.error();
    if (path.moves.empty()) return invalidInput("tool path", "no moves", "at least one");
    if (Result<void> solid = requireSolid(envelope, "envelope"); !solid) return solid.error();
    const Result<VoxelEnvelope> voxels = VoxelEnvelope::of(envelope, path.cutter.radius_mm, options.voxel_mm);
    if (!voxels) return voxels.error();

    std::vector<double> beyond(path.moves.size(), std::numeric_limits<double>::infinity());
    constexpr std::size_t kChunk = 1024;
    for (std::size_t done = 0; done < path.moves.size(); done += kChunk) {
        if (progress.isCancelled()) return cancelled("envelope check by voxels");
        progress.report(static_cast<double>(done) / static_cast<double>(path.moves.size()), "envelope check by voxels");
        parallelFor(std::min(kChunk, path.moves.size() - done), 16, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = done + begin; i < done + end; ++i)
                if (moveFlaw(path, i, voxels->open()).empty())
                    beyond[i] = beyondOnTheWay(*voxels, path.moves[i].segment, path.cutter.radius_mm);
        });
    }
    EnvelopeVerdict verdict;
    const double allowed = options.tolerance_mm + kOwnTolerance * options.voxel_mm;
    for (const double b : beyond)
        verdict.inside.push_back(b <= allowed);
    const auto worst = std::max_element(beyond.begin(), beyond.end());
    verdict.worst_mm = *worst;
    verdict.worst_move = static_cast<std::size_t>(worst - beyond.begin());
    return verdict;
}

}  // namespace fluorocut
