#include "core/planning/stem_fill.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/geometry/half_edge_mesh.h"
#include "core/geometry/mesh_section.h"
#include "core/image/distance_field.h"
#include "core/planning/templating_search.h"

namespace fluorocut {
namespace {

constexpr std::size_t kPoints = 6000;
constexpr double kLeastCutMm = 0.02;  // less is the field's own error

struct Section {
    double area = 0;
    Vector2 width = Vector2::Zero();
};

// The largest polygon of a section, in the plane of x and y.
std::optional<Section> sectionOf(const HalfEdgeMesh& mesh, const Plane& plane, const Vector3& x, const Vector3& y) {
    std::optional<Section> largest;
    for (const std::vector<Vector3>& polygon : sectionPolygons(mesh, plane)) {
        Section section;
        Vector2 low = Vector2::Constant(std::numeric_limits<double>::infinity()), high = -low;
        for (std::size_t i = 0; i < polygon.size(); ++i) {
            const auto flat = [&](const Vector3& p) { return Vector2(x.dot(p - plane.point), y.dot(p - plane.point)); };
            const Vector2 a = flat(polygon[i]), b = flat(polygon[(i + 1) % polygon.size()]);
            section.area += 0.5 * (a.x() * b.y() - a.y() * b.x());
            low = low.cwiseMin(a);
            high = high.cwiseMax(a);
        }
        section.area = std::abs(section.area);
        section.width = high - low;
        if (!largest || section.area > largest->area) largest = section;
    }
    return largest;
}

}  // namespace

Result<std::vector<FillLevel>> stemFill(const Implant& implant, const Rigid3& femur_from_cavity, const BoneWalls& walls,
                                        double step_mm) {
    const auto stem = HalfEdgeMesh::build(implant.in_bone, "stem");
    if (!stem) return stem.error();
    const auto canal = HalfEdgeMesh::build(walls.canal, "canal");
    if (!canal) return canal.error();
    const Vector3 x = femur_from_cavity.rotate(Vector3::UnitX()), y = femur_from_cavity.rotate(Vector3::UnitY());
    const Vector3 z = femur_from_cavity.rotate(Vector3::UnitZ());
    std::vector<FillLevel> levels;
    for (double below = std::min(1.0, step_mm); below < implant.stem_length_mm - 1; below += step_mm) {
        const Vector3 at(0, 0, implant.resection_z_mm - below);
        const auto of_stem = sectionOf(*stem, {at, Vector3::UnitZ()}, Vector3::UnitX(), Vector3::UnitY());
        const auto of_canal = sectionOf(*canal, {femur_from_cavity * at, z}, x, y);
        if (!of_stem || !of_canal) continue;
        FillLevel level;
        level.below_mm = below;
        level.stem_mm = of_stem->width;
        level.canal_mm = of_canal->width;
        level.area = of_stem->area / of_canal->area;
        levels.push_back(level);
    }
    return levels;
}

LeastWall leastWall(const Implant& implant, const Rigid3& femur_from_cavity, const BoneWalls& walls, bool only_cut) {
    LeastWall least;
    for (const Vector3& p : stemSurface(implant, kPoints)) {
        const Vector3 place = femur_from_cavity * p;
        const double c = sampleField(walls.canal_field, place, kWallBandMm);
        const double o = sampleField(walls.outer_field, place, kWallBandMm);
        const bool cut = c > kLeastCutMm;
        // Deep in the canal both distances are at their limit and say nothing; another place is nearer to the wall.
        if ((only_cut && !cut) || c <= -kWallBandMm || o <= -kOuterDepthMm) continue;
        const double thickness = std::min(c, 0.0) - o;
        if (!(least.thickness_mm <= thickness)) {
            least.thickness_mm = thickness;
            least.place = place;
            least.below_mm = implant.resection_z_mm - p.z();
            least.side = sideOf(p, implant.side);
            least.cut = cut;
        }
    }
    return least;
}

}  // namespace fluorocut
