#include "core/geometry/primitives.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <stdexcept>
#include <utility>

namespace fluorocut {
namespace {

void require(bool condition, const char* what) {
    if (!condition) throw std::logic_error(what);
}

TriangleMesh icosahedron() {
    const double g = std::numbers::phi;
    TriangleMesh mesh;
    mesh.vertices = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                     {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
    mesh.triangles = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                      {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                      {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
    for (Vector3& v : mesh.vertices)
        v.normalize();
    return mesh;
}

}  // namespace

TriangleMesh makeBox(const Vector3& size_mm) {
    require((size_mm.array() > 0).all() && size_mm.allFinite(), "makeBox: a size that is not positive");
    TriangleMesh mesh;
    for (int corner = 0; corner < 8; ++corner) {
        const Vector3 sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
        mesh.vertices.push_back(0.5 * sign.cwiseProduct(size_mm));
    }
    mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                      {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    return mesh;
}

TriangleMesh makeSphere(double radius_mm, int subdivisions) {
    return makeEllipsoid(Vector3::Constant(radius_mm), subdivisions);
}

TriangleMesh makeEllipsoid(const Vector3& radii_mm, int subdivisions) {
    require((radii_mm.array() > 0).all() && radii_mm.allFinite(), "makeEllipsoid: a radius that is not positive");
    require(subdivisions >= 0 && subdivisions <= 9, "makeEllipsoid: subdivisions outside 0 to 9");
    TriangleMesh mesh = icosahedron();
    for (int level = 0; level < subdivisions; ++level) {
        std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> middles;
        const auto middle = [&](std::int32_t a, std::int32_t b) {
            const auto [it, fresh] =
                middles.try_emplace(std::minmax(a, b), static_cast<std::int32_t>(mesh.vertices.size()));
            if (fresh) {
                const Vector3 sum =
                    mesh.vertices[static_cast<std::size_t>(a)] + mesh.vertices[static_cast<std::size_t>(b)];
                mesh.vertices.push_back(sum.normalized());
            }
            return it->second;
        };
        std::vector<Triangle> finer;
        finer.reserve(4 * mesh.triangles.size());
        for (const auto& [a, b, c] : mesh.triangles) {
            const std::int32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
            finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
        }
        mesh.triangles = std::move(finer);
    }
    for (Vector3& v : mesh.vertices)
        v = v.cwiseProduct(radii_mm);
    return mesh;
}

Vector2 superellipsePoint(const Vector2& half_width_mm, double exponent, double angle_rad) {
    const Vector2 unit(std::cos(angle_rad), std::sin(angle_rad));
    const double radius =
        std::pow(std::pow(std::abs(unit.x()), exponent) + std::pow(std::abs(unit.y()), exponent), -1 / exponent);
    return radius * unit.cwiseProduct(half_width_mm);
}

TriangleMesh makeSkin(const std::vector<std::vector<Vector3>>& rings) {
    require(rings.size() >= 2, "makeSkin: fewer than 2 rings");
    std::int32_t around = 0;
    for (const auto& ring : rings)
        around = std::max(around, static_cast<std::int32_t>(ring.size()));
    require(around >= 3, "makeSkin: rings of fewer than 3 points");
    TriangleMesh mesh;
    std::vector<std::int32_t> first;
    for (std::size_t r = 0; r < rings.size(); ++r) {
        const bool end = r == 0 || r + 1 == rings.size();
        require(static_cast<std::int32_t>(rings[r].size()) == around || (end && rings[r].size() == 1),
                "makeSkin: rings of different size");
        first.push_back(static_cast<std::int32_t>(mesh.vertices.size()));
        mesh.vertices.insert(mesh.vertices.end(), rings[r].begin(), rings[r].end());
    }
    const auto isPoint = [&](std::size_t r) { return rings[r].size() == 1; };
    require(rings.size() > 2 || !(isPoint(0) && isPoint(1)), "makeSkin: nothing but points");
    for (std::int32_t i = 0; i < around; ++i) {
        const std::int32_t j = (i + 1) % around;
        for (std::size_t r = 0; r + 1 < rings.size(); ++r) {
            const std::int32_t low = first[r], high = first[r + 1];
            if (!isPoint(r)) mesh.triangles.push_back({low + i, low + j, high + (isPoint(r + 1) ? 0 : j)});
            if (!isPoint(r + 1)) mesh.triangles.push_back({low + (isPoint(r) ? 0 : i), high + j, high + i});
        }
    }
    for (const bool top : {false, true}) {
        const std::size_t r = top ? rings.size() - 1 : 0;
        if (isPoint(r)) continue;
        Vector3 sum = Vector3::Zero();  // about one of them: flat rings get flat caps to the last bit
        for (const Vector3& p : rings[r])
            sum += p - rings[r][0];
        const auto hub = static_cast<std::int32_t>(mesh.vertices.size());
        mesh.vertices.push_back(rings[r][0] + sum / around);
        for (std::int32_t i = 0; i < around; ++i) {
            const std::int32_t j = (i + 1) % around;
            mesh.triangles.push_back({hub, first[r] + (top ? i : j), first[r] + (top ? j : i)});
        }
    }
    return mesh;
}

TriangleMesh makeLoft(const std::vector<LoftSection>& sections, int segments) {
    require(segments >= 3 && sections.size() >= 2, "makeLoft: fewer than 3 segments or 2 sections");
    std::vector<std::vector<Vector3>> rings;
    for (std::size_t s = 0; s < sections.size(); ++s) {
        const LoftSection& section = sections[s];
        const bool point = section.half_width_mm == Vector2::Zero();
        require(s == 0 || section.z_mm > sections[s - 1].z_mm, "makeLoft: z does not increase");
        require(point || ((section.half_width_mm.array() > 0).all() && section.exponent > 0),
                "makeLoft: a section without width");
        require(!point || ((s == 0 || s + 1 == sections.size()) && !(s == 1 && rings[0].size() == 1)),
                "makeLoft: a point that is not an end, or nothing but points");
        const Vector3 center(section.center_mm.x(), section.center_mm.y(), section.z_mm);
        std::vector<Vector3>& ring = rings.emplace_back();
        if (point) {
            ring.push_back(center);
            continue;
        }
        for (int i = 0; i < segments; ++i) {
            const Vector2 xy =
                superellipsePoint(section.half_width_mm, section.exponent, 2 * std::numbers::pi * i / segments);
            ring.emplace_back(center.x() + xy.x(), center.y() + xy.y(), center.z());
        }
    }
    return makeSkin(rings);
}

TriangleMesh makeTube(const std::vector<TubePoint>& line, double radius_mm, int segments, bool closed) {
    require(segments >= 3 && line.size() >= (closed ? 3U : 2U), "makeTube: too few segments or places");
    require(radius_mm > 0 && std::isfinite(radius_mm), "makeTube: a radius that is not positive");
    const double step = 2 * std::numbers::pi / segments;
    const double reach = radius_mm * std::sqrt(step / std::sin(step));
    TriangleMesh mesh;
    for (const TubePoint& place : line) {
        const Vector3 along = place.tangent.normalized();
        const Vector3 across = along.cross(place.up);
        require(across.norm() > 1e-6 * place.up.norm(), "makeTube: up lies along the tangent");  // false for NaN
        const Vector3 side = across.normalized();
        const Vector3 up = side.cross(along);
        for (int i = 0; i < segments; ++i)  // counter-clockwise seen against the tangent
            mesh.vertices.push_back(place.center_mm + reach * (std::cos(i * step) * side + std::sin(i * step) * -up));
    }
    const std::int32_t around = segments;
    const std::int32_t rings = static_cast<std::int32_t>(line.size());
    for (std::int32_t r = 0; r < (closed ? rings : rings - 1); ++r) {
        const std::int32_t low = r * around, high = (r + 1) % rings * around;
        for (std::int32_t i = 0; i < around; ++i) {
            const std::int32_t j = (i + 1) % around;
            mesh.triangles.push_back({low + i, low + j, high + j});
            mesh.triangles.push_back({low + i, high + j, high + i});
        }
    }
    for (const bool end : {false, true}) {
        if (closed) break;
        const std::int32_t first = end ? (rings - 1) * around : 0;
        const std::int32_t hub = static_cast<std::int32_t>(mesh.vertices.size());
        mesh.vertices.push_back(end ? line.back().center_mm : line.front().center_mm);
        for (std::int32_t i = 0; i < around; ++i) {
            const std::int32_t j = (i + 1) % around;
            mesh.triangles.push_back({hub, first + (end ? i : j), first + (end ? j : i)});
        }
    }
    return mesh;
}

TriangleMesh makeCylinder(double radius_mm, double length_mm, int segments) {
    return makeFrustum(radius_mm, radius_mm, length_mm, segments);
}

TriangleMesh makeFrustum(double radius_low_mm, double radius_high_mm, double length_mm, int segments) {
    LoftSection low, high;
    low.z_mm = -length_mm / 2;
    low.half_width_mm.setConstant(radius_low_mm);
    high.z_mm = length_mm / 2;
    high.half_width_mm.setConstant(radius_high_mm);
    return makeLoft({low, high}, segments);
}

TriangleMesh makeStem(const StemShape& shape) {
    const double rounding = 0.75 * shape.tip_width_mm.maxCoeff();  // length of the rounded tip
    require(shape.length_mm > 2 * rounding && (shape.tip_width_mm.array() > 0).all() &&
                (shape.top_width_mm.array() >= shape.tip_width_mm.array()).all() && shape.sections >= 4,
            "makeStem: a stem that is too short, too coarse or wider at its tip");
    // A quarter of the sections round the tip; they are dense there because the angle, not the height, is stepped.
    const int round_sections = shape.sections / 4;
    std::vector<LoftSection> sections;
    for (int s = 0; s < shape.sections; ++s) {
        const bool tip = s < round_sections;
        const double quarter = 0.5 * std::numbers::pi * s / round_sections;
        const double above = tip ? rounding * (1 - std::cos(quarter))
                                 : rounding + (shape.length_mm - rounding) * (s - round_sections) /
                                                  (shape.sections - 1 - round_sections);
        const double t = above / shape.length_mm;
        const double shrink = tip ? std::sin(quarter) : 1;
        // y tapers evenly; x evenly too, but for half of its growth, which the medial flank gains toward the top (t^4).
        const Vector2 growth = shape.top_width_mm - shape.tip_width_mm;
        const Vector2 width = shape.tip_width_mm + Vector2(0.5 * growth.x() * (t + std::pow(t, 4)), growth.y() * t);
        LoftSection section;
        section.z_mm = above - shape.length_mm;
        section.center_mm = {0.25 * growth.x() * std::pow(t, 4), 0};
        section.half_width_mm = 0.5 * shrink * width;
        section.exponent = shape.exponent;
        sections.push_back(section);
    }
    sections.back().z_mm = 0;
    return makeLoft(sections, shape.segments);
}

}  // namespace fluorocut
