#include "tests/core/cutting/cavities.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace fluorocut {

CavityShape cylinderCavity(double radius, double depth, double rounding) {
    const auto distance = [=](const Vector3& p) {
        const Vector2 beyond(p.head<2>().norm() - (radius - rounding), -(depth - rounding) - p.z());
        return (beyond.maxCoeff() <= 0 ? beyond.maxCoeff() : beyond.cwiseMax(0).norm()) - rounding;
    };
    return {distance, Vector3(-radius, -radius, -depth), Vector3(radius, radius, 0),
            [](double) { return Vector2(0, 0); }, std::min(0.0, 3 - depth)};
}

CavityShape coneCavity(double tip, double top, double depth) {
    // The wall touches both balls: it leans by asin((top - tip) / h) over the h between their centres.
    const double h = depth - tip, sine = (top - tip) / h, cosine = std::sqrt(1 - sine * sine);
    const auto distance = [=](const Vector3& p) {
        const double rho = p.head<2>().norm(), z = p.z() + h;  // above the lower ball's centre
        // Along the wall, from where it touches the ball.
        const double along = z * cosine + rho * sine;
        return along < 0 ? std::hypot(rho, z) - tip : rho * cosine - z * sine - tip;
    };
    const double widest = top / cosine;
    return {distance, Vector3(-widest, -widest, -depth), Vector3(widest, widest, 0),
            [](double) { return Vector2(0, 0); }, -h};
}

CavityShape squaredCavity(const Vector2& floor, const Vector2& top, double depth, double rounding) {
    // Planes n.p <= c; the solid is their intersection moved in by the rounding and grown by it again.
    std::array<Vector3, 5> normal;
    std::array<double, 5> limit;
    for (int axis = 0; axis < 2; ++axis) {
        const double lean = (top[axis] - floor[axis]) / depth;
        for (int side = 0; side < 2; ++side) {
            Vector3 n(0, 0, -lean);
            n[axis] = side ? 1 : -1;
            const std::size_t k = static_cast<std::size_t>(2 * axis + side);
            limit[k] = top[axis] / n.norm() - rounding;
            normal[k] = n.normalized();
        }
    }
    normal[4] = -Vector3::UnitZ();
    limit[4] = depth - rounding;
    const auto distance = [=](const Vector3& p) {
        double inside = -1e9;
        for (std::size_t k = 0; k < 5; ++k)
            inside = std::max(inside, normal[k].dot(p) - limit[k]);
        if (inside <= 0) return inside - rounding;
        // The nearest point of the intersection of half spaces (Dykstra).
        Vector3 x = p;
        std::array<Vector3, 5> correction;
        correction.fill(Vector3::Zero());
        for (int round = 0; round < 100; ++round) {
            const Vector3 before = x;
            for (std::size_t k = 0; k < 5; ++k) {
                const Vector3 y = x + correction[k];
                x = y - std::max(normal[k].dot(y) - limit[k], 0.0) * normal[k];
                correction[k] = y - x;
            }
            if ((x - before).norm() < 1e-7) break;
        }
        return (p - x).norm() - rounding;
    };
    const double wide = std::max(top.x(), floor.x()), deep = std::max(top.y(), floor.y());
    return {distance, Vector3(-wide, -deep, -depth), Vector3(wide, deep, 0), [](double) { return Vector2(0, 0); },
            rounding - depth};
}

CavityShape bowedCavity(double radius, double depth, double bow_radius) {
    const double angle = std::asin((depth - radius) / bow_radius);
    const auto distance = [=](const Vector3& p) {
        // The arc's circle: in the plane y = 0, round (bow_radius, 0, 0).
        const Vector2 in_plane(bow_radius - p.x(), -p.z());
        const double at = std::atan2(in_plane.y(), in_plane.x());
        if (at < 0) return std::hypot(p.x(), p.y()) - radius;  // straight on above the top
        if (at <= angle) return std::hypot(in_plane.norm() - bow_radius, p.y()) - radius;
        const Vector3 end(bow_radius * (1 - std::cos(angle)), 0, -bow_radius * std::sin(angle));
        return (p - end).norm() - radius;
    };
    return {distance, Vector3(-radius, -radius, -depth),
            Vector3(radius + bow_radius * (1 - std::cos(angle)), radius, 0),
            [=](double z) {
                const double at = std::asin(std::clamp(-z / bow_radius, 0.0, std::sin(angle)));
                return Vector2(bow_radius * (1 - std::cos(at)), 0);
            },
            -bow_radius * std::sin(angle)};
}

CavityShape ringCavity(double inner, double outer, double depth) {
    CavityShape ring = cylinderCavity(outer, depth);
    const auto full = ring.distance;
    ring.distance = [=](const Vector3& p) { return std::max(full(p), inner - p.head<2>().norm()); };
    return ring;
}

TriangleMesh ringMesh(double inner, double outer, double depth, int segments) {
    TriangleMesh mesh;
    for (int s = 0; s < segments; ++s) {
        const double around = 2 * std::numbers::pi * s / segments, c = std::cos(around), d = std::sin(around);
        mesh.vertices.insert(mesh.vertices.end(),
                             {Vector3(inner * c, inner * d, 0), Vector3(inner * c, inner * d, -depth),
                              Vector3(outer * c, outer * d, -depth), Vector3(outer * c, outer * d, 0)});
        for (int side = 0; side < 4; ++side) {
            const int a = 4 * s + side, b = 4 * s + (side + 1) % 4, turn = 4 * segments;
            mesh.triangles.push_back({a, (b + 4) % turn, b});
            mesh.triangles.push_back({a, (a + 4) % turn, (b + 4) % turn});
        }
    }
    return mesh;
}

CavityShape moved(const CavityShape& shape, const Vector2& shift) {
    CavityShape result = shape;
    const Vector3 by(shift.x(), shift.y(), 0);
    result.distance = [=](const Vector3& p) { return shape.distance(p - by); };
    result.axis = [=](double z) { return Vector2(shape.axis(z) + shift); };
    result.low += by;
    result.high += by;
    return result;
}

TriangleMesh meshOf(const CavityShape& shape, int sections, int segments) {
    // Where a ray from inside leaves the shape.
    const auto leave = [&](const Vector3& from, const Vector3& way) {
        double in = 0, out = 4 * (shape.high - shape.low).norm();
        while (out - in > 1e-9)
            (shape.distance(from + 0.5 * (in + out) * way) < 0 ? in : out) = 0.5 * (in + out);
        return Vector3(from + in * way);
    };
    TriangleMesh mesh;
    const Vector2 low = shape.axis(shape.middle);
    const Vector3 bottom(low.x(), low.y(), shape.middle);
    mesh.vertices.push_back(leave(bottom, -Vector3::UnitZ()));
    const int rings = 2 * sections;  // as many round the bottom as up the wall
    for (int ring = 1; ring <= rings; ++ring) {
        for (int s = 0; s < segments; ++s) {
            const double around = 2 * std::numbers::pi * s / segments;
            const Vector3 out(std::cos(around), std::sin(around), 0);
            if (ring <= sections) {
                const double polar = 0.5 * std::numbers::pi * ring / sections;
                mesh.vertices.push_back(leave(bottom, std::sin(polar) * out - std::cos(polar) * Vector3::UnitZ()));
            } else {
                const double z = shape.middle * (rings - ring) / sections;
                const Vector2 at = shape.axis(z);
                mesh.vertices.push_back(leave({at.x(), at.y(), z}, out));
                mesh.vertices.back().z() = z;
            }
        }
    }
    const Vector2 top = shape.axis(0);
    mesh.vertices.emplace_back(top.x(), top.y(), 0);
    const auto vertex = [&](int ring, int s) { return 1 + (ring - 1) * segments + s % segments; };
    for (int s = 0; s < segments; ++s) {
        mesh.triangles.push_back({0, vertex(1, s + 1), vertex(1, s)});
        for (int ring = 1; ring < rings; ++ring) {
            mesh.triangles.push_back({vertex(ring, s), vertex(ring, s + 1), vertex(ring + 1, s + 1)});
            mesh.triangles.push_back({vertex(ring, s), vertex(ring + 1, s + 1), vertex(ring + 1, s)});
        }
        mesh.triangles.push_back({vertex(rings, s), vertex(rings, s + 1), 1 + rings * segments});
    }
    return mesh;
}

double mostBeyond(const ToolPath& path, const CavityShape& shape, double open_mm, double step_mm) {
    double worst = -1e9;
    for (const ToolMove& move : path.moves) {
        const ToolSegment& s = move.segment;
        const int steps = std::clamp(static_cast<int>((s.to_mm - s.from_mm).norm() / step_mm), 1, 100);
        for (int i = 0; i <= steps; ++i) {
            const Vector3 ball = s.from_mm + (s.to_mm - s.from_mm) * i / steps;
            worst = std::max(worst, ball.z() - open_mm);
            for (double t = 0; t <= path.cutter.length_mm; t += 2.5 * step_mm) {
                Vector3 p = ball + t * s.spindle;
                if (p.z() > open_mm) break;
                p.z() = std::min(p.z(), 0.0);
                worst = std::max(worst, shape.distance(p) + path.cutter.radius_mm);
            }
        }
    }
    return worst;
}

Volume fieldOf(const CavityShape& shape, double spacing) {
    VolumeGrid grid;
    const Vector3 margin(1.5, 1.5, 1.5);
    const Vector3 size = shape.high - shape.low + 2 * margin;
    for (int axis = 0; axis < 3; ++axis)
        grid.size[static_cast<std::size_t>(axis)] = static_cast<int>(std::ceil(size[axis] / spacing)) + 2;
    grid.spacing_mm = Vector3::Constant(spacing);
    grid.origin_mm = shape.low - margin;
    Volume field(grid);
    for (int k = 0; k < field.size(2); ++k)
        for (int j = 0; j < field.size(1); ++j)
            for (int i = 0; i < field.size(0); ++i)
                field(i, j, k) = static_cast<float>(shape.distance(grid.pointFromIndex(Vector3(i, j, k))));
    return field;
}

}  // namespace fluorocut
