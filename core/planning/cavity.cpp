#include "core/planning/cavity.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/geometry/mesh_distance.h"
#include "core/geometry/mesh_properties.h"
#include "core/image/distance_field.h"
#include "core/image/isosurface.h"
#include "core/image/offset_surface.h"
#include "core/image/voxelize.h"

namespace fluorocut {
namespace {

constexpr double kOutside_mm = 3;            // the field is exact so far out
constexpr double kInTop_mm = 1e-4;           // nearer to the top plane than this is in it
constexpr double kMostUndercut = 0.01;       // of the implant, without a word
constexpr double kMostUnreachable_mm = 0.1;  // without a word

struct Bounds {
    Vector3 low = Vector3::Constant(std::numeric_limits<double>::infinity());
    Vector3 high = -low;

    void add(const Vector3& p) {
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
    }
};

// Of the part of the mesh that lies below the top, not counting what rests on it.
Bounds boundsBelow(const TriangleMesh& mesh, double top_mm) {
    Bounds bounds;
    const double under = top_mm - kInTop_mm;
    for (const Triangle& t : mesh.triangles) {
        for (std::size_t c = 0; c < 3; ++c) {
            const Vector3& a = mesh.vertices[static_cast<std::size_t>(t[c])];
            const Vector3& b = mesh.vertices[static_cast<std::size_t>(t[(c + 1) % 3])];
            if (a.z() < under) bounds.add(a);
            if ((a.z() < under) != (b.z() < under)) bounds.add(a + (under - a.z()) / (b.z() - a.z()) * (b - a));
        }
    }
    return bounds;
}

// A grid with a layer of voxel centres exactly at the top.
struct CavityGrid {
    VolumeGrid grid;
    int top_layer = 0;
};

int layersBelow(double low_mm, double top_mm, double spacing_mm) {
    return static_cast<int>(std::ceil((top_mm - low_mm) / spacing_mm));
}

Result<CavityGrid> makeGrid(const Bounds& below, double top_mm, const CavityOptions& options) {
    const double h = options.spacing_mm;
    const double around = std::max(options.offset_mm, 0.0) + kOutside_mm + h;
    const Vector3 low = below.low.array() - around, high = below.high.array() + around;
    if (!(top_mm - low.z() < 1e5 * h)) {
        return invalidOption("spacing_mm", fmt::format("{:g} mm for a length of {:g} mm", h, top_mm - low.z()),
                             "fewer than 100000 layers", "take a larger spacing");
    }
    CavityGrid result;
    result.top_layer = layersBelow(low.z(), top_mm, h);
    const double bottom = top_mm - result.top_layer * h;
    const double opening = options.cutter_radius_mm + kMostInset_mm;
    Result<VolumeGrid> grid = gridAround({low.x(), low.y(), bottom}, {high.x(), high.y(), top_mm + opening}, h, 0);
    if (!grid) return grid.error();
    result.grid = *grid;
    return result;
}

// The first layers of a volume, in the same place.
Volume lowerPart(const Volume& volume, int layers) {
    VolumeGrid grid = volume.grid();
    grid.size[2] = layers;
    const auto& voxels = volume.voxels();
    return {grid, std::vector<float>(voxels.begin(), voxels.begin() + static_cast<std::ptrdiff_t>(grid.voxelCount()))};
}

// The implant below the top, pulled out upward: the surface is right, and so are distances outside. Where the implant
// ends in the top plane or goes on above it, what lies there is no wall; nor is a collar that rests on the plane.
Result<Volume> sweptImplant(const TriangleMesh& implant, const CavityGrid& place, double top_mm, double outside_mm,
                            Progress& progress) {
    const double h = place.grid.spacing_mm.x();
    VolumeGrid below = place.grid;
    below.size[2] = place.top_layer + 1;
    VolumeGrid just_below = below;  // so that the highest layer is not in the top plane
    just_below.origin_mm.z() -= kInTop_mm;
    Result<Volume> sides = sidesOf(implant, just_below, "the implant");
    if (!sides) return sides;
    TriangleMesh walls{implant.vertices, {}};
    for (const Triangle& t : implant.triangles) {
        const auto reaches_below = [&](std::int32_t v) {
            return implant.vertices[static_cast<std::size_t>(v)].z() < top_mm - kInTop_mm;
        };
        if (std::any_of(t.begin(), t.end(), reaches_below)) walls.triangles.push_back(t);
    }
    const Result<MeshDistance> surface = MeshDistance::build(std::move(walls), "the implant");
    if (!surface) return surface.error();
    Result<Volume> field = distancesTo(*surface, std::move(*sides), 0, FieldBand(3 * h, outside_mm + 3 * h), progress);
    if (!field) return field;
    sweepUp(*field);
    std::vector<float> voxels = std::move(field->voxels());
    const std::size_t layer = voxels.size() / static_cast<std::size_t>(below.size[2]);
    voxels.reserve(place.grid.voxelCount());
    while (voxels.size() < place.grid.voxelCount())
        voxels.push_back(voxels[voxels.size() - layer]);
    return Volume(place.grid, std::move(voxels));
}

struct Added {
    double implant_mm3 = 0;  // below the top
    double undercut_mm3 = 0;
};

// By exact partial volumes: a voxel that the sweep passes is filled as much as any below it.
Result<Added> addedBySweep(const TriangleMesh& implant, const CavityGrid& place) {
    VolumeGrid grid = place.grid;
    grid.size[2] = place.top_layer;
    grid.origin_mm.z() += 0.5 * grid.spacing_mm.z();  // the highest voxels end at the top
    Result<VoxelCoverage> coverage = voxelize(implant, {}, grid, "the implant");
    if (!coverage) return coverage.error();
    Added added;
    added.implant_mm3 = coverage->volume_mm3;
    const Volume& fraction = coverage->fraction;
    const int above = place.top_layer - coverage->offset[2] - fraction.size(2);  // layers over the implant
    double voxels = 0;
    for (int j = 0; j < fraction.size(1); ++j) {
        for (int i = 0; i < fraction.size(0); ++i) {
            float most = 0;
            for (int k = 0; k < fraction.size(2); ++k) {
                most = std::max(most, fraction(i, j, k));
                voxels += most - fraction(i, j, k);
            }
            voxels += above * static_cast<double>(most);
        }
    }
    added.undercut_mm3 = voxels * grid.spacing_mm.prod();
    return added;
}

struct Opened {
    Volume field;
    MeshDistance centers;  // surface of where the ball's centre may be
};

// All balls of the radius with centres at depth `depth_mm` or more; the field counts from their envelope. The wall lies
// `wall_depth_mm` outside the border of `wanted`.
Result<Opened> opened(const Volume& wanted, const MeshDistance& wall, double wall_depth_mm, double depth_mm,
                      double radius_mm, Progress& progress) {
    Result<MeshDistance> centers =
        MeshDistance::build(offsetSurface(wall, wall_depth_mm + depth_mm, wanted, -depth_mm), "the cavity");
    if (!centers) return centers.error();
    Result<Volume> field = distancesTo(*centers, wanted, -depth_mm, FieldBand(0, radius_mm + kOutside_mm), progress);
    if (!field) return field.error();
    for (std::size_t n = 0; n < field->voxels().size(); ++n) {
        float& value = field->voxels()[n];
        const float depth = wanted.voxels()[n];
        value = depth < -depth_mm ? static_cast<float>(depth + (depth_mm - radius_mm))
                                  : static_cast<float>(value - radius_mm);
    }
    return Opened{std::move(*field), std::move(*centers)};
}

// Part of a voxel inside, by its distance.
double coverageAt(double distance_mm, double spacing_mm) {
    return std::clamp(0.5 - distance_mm / spacing_mm, 0.0, 1.0);
}

// What the cutter leaves of `wanted` (less `shift_mm`) below the top.
void measureUnreachable(const Volume& wanted, double shift_mm, const Opened& opened, int top_layer, Cavity& cavity) {
    const double h = wanted.grid().spacing_mm.x();
    const std::size_t layer = wanted.voxels().size() / static_cast<std::size_t>(wanted.size(2));
    double voxels = 0;
    for (std::size_t n = 0; n < layer * static_cast<std::size_t>(top_layer + 1); ++n) {
        const double want = wanted.voxels()[n] + shift_mm, have = opened.field.voxels()[n];
        if (!(have - want > 0.1 * h)) continue;  // walls differ by less in interpolation
        const double weight = n < layer * static_cast<std::size_t>(top_layer) ? 1 : 0.5;  // the top halves its voxels
        voxels += weight * (coverageAt(want, h) - coverageAt(have, h));
    }
    cavity.unreachable_mm3 = voxels * h * h * h;
    cavity.unreachable_mm = 0;
    for (const Vector3& v : isosurface(lowerPart(wanted, top_layer + 1), -shift_mm, GridBorder::open).vertices)
        cavity.unreachable_mm = std::max(cavity.unreachable_mm, sampleField(opened.field, v, 0));
}

void measureMesh(Cavity& cavity, int top_layer) {
    cavity.mesh = isosurface(lowerPart(cavity.field, top_layer + 1), 0);
    const double h = cavity.field.grid().spacing_mm.x();
    for (Vector3& v : cavity.mesh.vertices) {
        if (std::abs(v.z() - cavity.top_mm) < 1e-6 * h) v.z() = cavity.top_mm;
    }
    const MeshProperties properties = meshProperties(cavity.mesh);
    cavity.volume_mm3 = properties.volume_mm3;
    cavity.bottom_mm = properties.min_corner.z();
}

double greatestDepth(const Volume& field) {
    return -*std::min_element(field.voxels().begin(), field.voxels().end());
}

int topLayer(const Cavity& cavity) {
    const VolumeGrid& grid = cavity.field.grid();
    return static_cast<int>(std::lround((cavity.top_mm - grid.origin_mm.z()) / grid.spacing_mm.z()));
}

}  // namespace

Result<void> CavityOptions::validate() const {
    if (auto ok = requireRanges({{"offset_mm", offset_mm, -5, 10, "mm"},
                                 {"cutter_radius_mm", cutter_radius_mm, 0.5, 20, "mm"},
                                 {"spacing_mm", spacing_mm, 0.05, 2, "mm"},
                                 {"top_mm", top_mm.value_or(0), -1e4, 1e4, "mm"}});
        !ok) {
        return ok;
    }
    if (!(spacing_mm <= 0.5 * cutter_radius_mm)) {
        return invalidOption("spacing_mm", fmt::format("{:g}", spacing_mm),
                             fmt::format("at most half the cutter's radius, {:g} mm", 0.5 * cutter_radius_mm));
    }
    return {};
}

Result<Cavity> planCavity(const TriangleMesh& implant, const CavityOptions& options, Progress& progress) {
    if (auto ok = options.validate(); !ok) return ok.error();
    const MeshProperties shape = meshProperties(implant);
    if (auto ok = requireSolid(shape, "the implant"); !ok) return ok.error();
    const double radius = options.cutter_radius_mm, offset = options.offset_mm;
    Cavity cavity;
    cavity.cutter_radius_mm = radius;
    cavity.top_mm = options.top_mm.value_or(shape.max_corner.z());
    if (!(cavity.top_mm > shape.min_corner.z() + options.spacing_mm)) {
        return invalidOption("top_mm", fmt::format("{:g} mm", cavity.top_mm),
                             fmt::format("a resection above the implant's tip at z = {:g} mm", shape.min_corner.z()),
                             "give the z of the resection in the frame of the implant's mesh");
    }
    const Result<CavityGrid> place = makeGrid(boundsBelow(implant, cavity.top_mm), cavity.top_mm, options);
    if (!place) return place.error();

    SubProgress first(progress, 0, 0.3), second(progress, 0.3, 0.6), third(progress, 0.6, 0.9);
    Result<Volume> swept = sweptImplant(implant, *place, cavity.top_mm, std::max(offset, 0.0), first);
    if (!swept) return swept.error();
    const double level = std::max(offset, 0.0), wall_depth = std::max(-offset, 0.0);
    const Result<MeshDistance> wall = MeshDistance::build(isosurface(*swept, level, GridBorder::open), "the implant");
    if (!wall) return wall.error();
    const FieldBand deep(radius + kMostInset_mm + wall_depth, options.spacing_mm);
    Result<Volume> wanted = distancesTo(*wall, *swept, level, deep, second);
    if (!wanted) return wanted.error();
    for (float& value : wanted->voxels())
        value += static_cast<float>(wall_depth);
    cavity.wall = *wall;
    cavity.wall_depth_mm = wall_depth;
    const double room = greatestDepth(*wanted);
    Result<Opened> open =
        noSolution("the cutter", fmt::format("a radius of {:g} mm", radius),
                   fmt::format("at most {:.2f} mm, the largest ball that fits into this cavity", std::max(room, 0.0)),
                   "take a smaller cutter");
    const Error too_large = open.error();
    if (!(room > radius)) return too_large;
    open = opened(*wanted, *wall, wall_depth, radius, radius, third);
    if (!open) return open.error();
    cavity.field = open->field;
    measureMesh(cavity, place->top_layer);
    if (cavity.mesh.triangles.empty()) return too_large;
    progress.report(0.95, "undercuts");

    const Result<Added> added = addedBySweep(implant, *place);
    if (!added) return added.error();
    cavity.undercut_mm3 = added->undercut_mm3;
    measureUnreachable(*wanted, 0, *open, place->top_layer, cavity);
    if (offset >= 0) {  // its own corners are sharper than the field's
        for (const Vector3& v : implant.vertices) {
            if (!(v.z() <= cavity.top_mm) || !(sampleField(cavity.field, v, 0) > 0)) continue;
            cavity.unreachable_mm =
                std::max(cavity.unreachable_mm, open->centers.nearest(v).distance_mm - radius + offset);
        }
    }
    if (!(cavity.undercut_mm3 <= kMostUndercut * added->implant_mm3)) {
        cavity.warnings.push_back(fmt::format(
            "the stem cannot be put in without cutting {:.0f} mm^3 more than its own {:.0f} mm^3: it is wider below "
            "than above (undercut); if the mesh reaches above the resection, state the resection's height",
            cavity.undercut_mm3, added->implant_mm3));
    }
    if (!(cavity.unreachable_mm <= kMostUnreachable_mm)) {
        cavity.warnings.push_back(fmt::format(
            "the cutter of {:g} mm radius leaves up to {:.2f} mm of bone in front of the planned surface ({:.0f} mm^3 "
            "in all), in corners or gaps that it cannot enter",
            radius, cavity.unreachable_mm, cavity.unreachable_mm3));
    }
    progress.report(1, "cavity");
    return cavity;
}

Result<Cavity> insetCavity(const Cavity& final, double inset_mm, Progress& progress) {
    if (final.field.empty() || !final.wall) throw std::logic_error("insetCavity: a cavity that was not planned");
    if (auto ok = requireRange("inset_mm", inset_mm, 0, kMostInset_mm, "mm"); !ok) return ok.error();
    if (inset_mm == 0) return final;
    const double radius = final.cutter_radius_mm;
    Cavity cavity;
    cavity.cutter_radius_mm = radius;
    cavity.top_mm = final.top_mm;
    cavity.wall = final.wall;
    cavity.wall_depth_mm = final.wall_depth_mm + inset_mm;
    const double most = greatestDepth(final.field) - radius;
    const Error too_far =
        noSolution("the stage", fmt::format("an inset of {:.2f} mm that leaves nothing to mill", inset_mm),
                   fmt::format("at most {:.2f} mm for this cavity and cutter", std::max(most, 0.0)),
                   "take a smaller inset or a smaller cutter, or register more exactly");
    if (!(most > inset_mm)) return too_far;
    SubProgress part(progress, 0, 0.9);
    Result<Opened> open = opened(final.field, *final.wall, final.wall_depth_mm, radius + inset_mm, radius, part);
    if (!open) return open.error();
    cavity.field = open->field;
    measureMesh(cavity, topLayer(final));
    if (cavity.mesh.triangles.empty()) return too_far;
    cavity.undercut_mm3 = 0;
    measureUnreachable(final.field, inset_mm, *open, topLayer(final), cavity);
    progress.report(1, "stage");
    return cavity;
}

std::vector<double> stageInsets(int stages, double first_inset_mm, double least_layer_mm) {
    if (stages < 1 || !(first_inset_mm >= 0) || !(least_layer_mm >= 0)) {
        throw std::logic_error("stageInsets: no stage, or a negative inset or layer");
    }
    std::vector<double> insets;
    const double layer = stages > 1 ? std::max(first_inset_mm / (stages - 1), least_layer_mm) : 0;
    for (int left = stages - 1; left >= 0; --left)
        insets.push_back(left * layer);
    return insets;
}

}  // namespace fluorocut
