#include "core/planning/implant_import.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "core/geometry/mesh_properties.h"
#include "core/geometry/mesh_section.h"
#include "core/geometry/mesh_tools.h"

namespace fluorocut {
namespace {

constexpr double kShortest_mm = 60, kLongest_mm = 450;

// Second moments of a solid about its centroid, divided by its volume.
Matrix3 secondMoments(const TriangleMesh& mesh, const MeshProperties& properties) {
    Matrix3 sum = Matrix3::Zero();
    for (const Triangle& t : mesh.triangles) {
        std::array<Vector3, 3> p;
        for (std::size_t c = 0; c < 3; ++c)
            p[c] = mesh.vertices[static_cast<std::size_t>(t[c])] - properties.centroid;
        const double volume = p[0].dot(p[1].cross(p[2])) / 6;
        const Vector3 all = p[0] + p[1] + p[2];
        sum += volume / 20 *
               (p[0] * p[0].transpose() + p[1] * p[1].transpose() + p[2] * p[2].transpose() + all * all.transpose());
    }
    return sum / properties.volume_mm3;
}

struct Section {
    double area = 0;
    Vector3 middle = Vector3::Zero();
    double farthest = 0;  // along a direction, from the origin
};

Section sectionAt(const HalfEdgeMesh& mesh, const Vector3& point, const Vector3& axis,
                  const Vector3& direction = Vector3::Zero()) {
    Section section;
    section.farthest = -std::numeric_limits<double>::infinity();
    for (const auto& polygon : sectionPolygons(mesh, {point, axis})) {
        for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
            const double area = 0.5 * axis.dot((polygon[i] - polygon[0]).cross(polygon[i + 1] - polygon[0]));
            section.area += area;
            section.middle += area / 3 * (polygon[0] + polygon[i] + polygon[i + 1]);
        }
        for (const Vector3& p : polygon)
            section.farthest = std::max(section.farthest, direction.dot(p));
    }
    if (section.area > 0) section.middle /= section.area;
    return section;
}

// Extent of the vertices along a direction.
std::pair<double, double> extent(const TriangleMesh& mesh, const Vector3& direction) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const Vector3& v : mesh.vertices) {
        low = std::min(low, direction.dot(v));
        high = std::max(high, direction.dot(v));
    }
    return {low, high};
}

// The sections' middles between two fractions of the extent above the tip, joined by the straight line that fits best.
struct Line {
    Vector3 point, direction;
};
Line lineThroughMiddles(const HalfEdgeMesh& mesh, const Vector3& axis, double from, double to) {
    const auto [low, high] = extent(mesh.mesh(), axis);
    std::vector<Vector3> middles;
    Vector3 mean = Vector3::Zero();
    constexpr int kStations = 24;
    for (int i = 0; i < kStations; ++i) {
        const double level = low + (high - low) * (from + (to - from) * (i + 0.5) / kStations);
        const Section section = sectionAt(mesh, level * axis, axis);
        if (!(section.area > 0)) continue;
        middles.push_back(section.middle);
        mean += section.middle;
    }
    if (middles.size() < 3) return {meshProperties(mesh.mesh()).centroid, axis};
    mean /= static_cast<double>(middles.size());
    Matrix3 scatter = Matrix3::Zero();
    for (const Vector3& m : middles)
        scatter += (m - mean) * (m - mean).transpose();
    const Vector3 direction = Eigen::SelfAdjointEigenSolver<Matrix3>(scatter).eigenvectors().col(2);
    return {mean, direction.dot(axis) < 0 ? Vector3(-direction) : direction};
}

// What was taken for granted, in words.
struct Remarks {
    ImplantImport& result;
    void sure(std::string sentence) { result.guessed.push_back(std::move(sentence)); }
    void unsure(std::string sentence) {
        result.uncertain.push_back(sentence);
        result.guessed.push_back(std::move(sentence));
    }
    void say(bool is_sure, std::string sentence) {
        sentence += is_sure ? " (sure)" : " (UNSURE: look at it, or give it)";
        is_sure ? sure(std::move(sentence)) : unsure(std::move(sentence));
    }
};

Result<double> unitOf(double extent, const ImportOptions& options, const std::string& where, Remarks& remarks) {
    if (options.mm_per_unit) {
        const double mm = *options.mm_per_unit;
        if (!(mm > 0 && mm <= 1e4)) return invalidOption("unit", fmt::format("{:g} mm", mm), "0 to 10000 mm");
        if (!(mm * extent >= kShortest_mm && mm * extent <= kLongest_mm))
            return invalidInput(where, fmt::format("a longest extent of {:.4g} mm in the given unit", mm * extent),
                                fmt::format("{:g} to {:g} mm, as a stem has", kShortest_mm, kLongest_mm),
                                "check the unit");
        return mm;
    }
    // 25.4 fits whatever 10 fits from 2.4 to 17.7: centimetres and inches cannot be told apart by size.
    for (const auto& [mm, name, sure] :
         {std::tuple(1.0, "mm", true), std::tuple(1000.0, "m", true), std::tuple(10.0, "cm", false)}) {
        if (!(mm * extent >= kShortest_mm && mm * extent <= kLongest_mm)) continue;
        remarks.say(sure, fmt::format("unit: {}, since the longest extent is {:.4g}", name, extent));
        return mm;
    }
    return invalidInput(where, fmt::format("a longest extent of {:.4g}", extent),
                        fmt::format("a stem of {:g} to {:g} mm in mm, cm or m", kShortest_mm, kLongest_mm),
                        "give the unit");
}

}  // namespace

Result<ImplantImport> importImplant(TriangleMesh mesh, const ImportOptions& options, const std::string& where) {
    ImplantImport result;
    Remarks remarks{result};
    MeshProperties properties = meshProperties(mesh);
    if (properties.watertight() && properties.volume_mm3 < 0) {
        mesh = flipped(std::move(mesh));
        remarks.sure("facets: turned outward, the mesh was inside out (sure)");
        properties = meshProperties(mesh);
    }
    if (Result<void> solid = requireSolid(properties, where); !solid) {
        Error error = solid.error();
        error.code = ErrorCode::invalidInput;
        return error;
    }
    // The longest extent along the principal axis, so that a mesh that lies askew is not taken for a longer one.
    const Eigen::SelfAdjointEigenSolver<Matrix3> principal(secondMoments(mesh, properties));
    Vector3 axis = principal.eigenvectors().col(2);
    const auto [first_low, first_high] = extent(mesh, axis);
    const Result<double> mm = unitOf(first_high - first_low, options, where, remarks);
    if (!mm) return mm.error();
    for (Vector3& v : mesh.vertices)
        v *= *mm;
    Result<HalfEdgeMesh> built = HalfEdgeMesh::build(std::move(mesh), where);
    if (!built) return built.error();
    const HalfEdgeMesh& half_edges = *built;

    Vector3 on_axis;
    if (options.proximal) {
        if (!(options.proximal->norm() > 0 && options.proximal->allFinite()))
            return invalidOption("axis", "no direction", "three numbers, not all zero");
        axis = options.proximal->normalized();
        on_axis = lineThroughMiddles(half_edges, axis, 0.1, 0.4).point;
    } else {
        const double longer = std::sqrt(principal.eigenvalues()[2] / principal.eigenvalues()[1]);
        if (!(longer > 1.5))
            return invalidInput(where, fmt::format("a shape only {:.2g} times as long as wide", longer),
                                "a stem, at least 1.5 times", "give the axis");
        const auto [low, high] = extent(half_edges.mesh(), axis);
        const auto meanArea = [&, low = low, high = high](double from, double to) {
            double sum = 0;
            for (int i = 0; i < 10; ++i)
                sum += sectionAt(half_edges, (low + (high - low) * (from + (to - from) * (i + 0.5) / 10)) * axis, axis)
                           .area;
            return sum / 10;
        };
        const double one = meanArea(0.25, 0.5), other = meanArea(0.5, 0.75);
        if (one > other) axis = -axis;
        const double ratio = std::max(one, other) / std::min(one, other);
        for (int i = 0; i < 4; ++i) {
            const Line line = lineThroughMiddles(half_edges, axis, 0.1, 0.4);
            axis = line.direction;
            on_axis = line.point;
        }
        remarks.say(longer > 2.5,
                    fmt::format("axis: the line through the middles of the distal sections; the shape is {:.1f} times "
                                "as long as wide",
                                longer));
        remarks.say(ratio > 1.1, fmt::format("distal end: the thinner one; mean sections {:.0f} and {:.0f} mm2 in the "
                                             "second and third quarter from it",
                                             std::min(one, other), std::max(one, other)));
    }

    const auto [bottom, top] = extent(half_edges.mesh(), axis);
    const double length = top - bottom;
    const auto axisAt = [&](double level) { return Vector3(on_axis + (level - axis.dot(on_axis)) * axis); };
    Vector3 medial;
    if (options.medial) {
        medial = *options.medial - axis.dot(*options.medial) * axis;
        if (!(medial.norm() > 1e-3 * options.medial->norm()))
            return invalidOption("medial", "a direction along the axis", "one that points to the head's side");
    } else {
        medial.setZero();
        for (int i = 0; i < 10; ++i) {
            const double level = top - 0.25 * length * (i + 0.5) / 10;
            const Section section = sectionAt(half_edges, level * axis, axis);
            if (section.area > 0) medial += 0.1 * (section.middle - axisAt(level));
        }
        medial -= axis.dot(medial) * axis;
        const double leans = medial.norm();
        if (!(leans > 1e-6)) medial = axis.unitOrthogonal();
        remarks.say(leans > 2, fmt::format("medial: where the upper quarter leans, {:.1f} mm off the axis", leans));
    }
    medial.normalize();

    Vector3 reference;
    if (options.reference) {
        reference = *mm * *options.reference;
    } else {
        // From below: the first level where the medial border runs out by more than 1 in 1.5 over 2 mm.
        std::optional<double> corner;
        constexpr double kStep_mm = 0.5;
        constexpr std::size_t kOver = 4;
        std::vector<double> border;
        for (double level = bottom + 0.4 * length; level < top && !corner; level += kStep_mm) {
            border.push_back(sectionAt(half_edges, level * axis, axis, medial).farthest);
            if (border.size() > kOver && border.back() - border[border.size() - 1 - kOver] > kOver * kStep_mm / 1.5)
                corner = level - kOver * kStep_mm;
        }
        reference = axisAt(corner.value_or(top));
        remarks.say(false, corner ? fmt::format("reference point: on the axis where the neck leaves the medial border, "
                                                "{:.1f} mm above the tip; good to some 3 mm",
                                                *corner - bottom)
                                  : fmt::format("reference point: on the axis at the top, {:.1f} mm above the tip; no "
                                                "neck was found",
                                                length));
    }
    const Side side = options.side.value_or(Side::left);
    if (!options.side) remarks.say(false, "side: taken as left, which the shape does not tell");

    Matrix3 cavity_from_mesh;
    cavity_from_mesh.row(0) = medial;
    cavity_from_mesh.row(1) = axis.cross(medial);
    cavity_from_mesh.row(2) = axis;
    result.description.name = options.name;
    result.description.mm_per_unit = *mm;
    result.description.material = options.material;
    result.description.side = side;
    result.description.cavity_from_mesh = Rigid3(cavity_from_mesh, -(cavity_from_mesh * reference));
    Result<Implant> implant =
        implantOfMesh(transformed(half_edges.mesh(), result.description.cavity_from_mesh), result.description);
    if (!implant) return implant.error();
    result.implant = std::move(*implant);
    return result;
}

}  // namespace fluorocut
