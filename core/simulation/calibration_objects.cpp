#include "core/simulation/calibration_objects.h"

#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"
#include "core/simulation/closed_form_projection.h"

namespace fluorocut {
namespace {

constexpr int kSegments = 96;

// A bar along x from (0, 0) to (length, rise): width falls toward its end.
TriangleMesh bar(double length_mm, double width_mm, double end_width_mm, double thickness_mm) {
    LoftSection low, high;
    low.exponent = high.exponent = 6;  // nearly a rectangle, without sharp corners
    low.half_width_mm = {0.5 * thickness_mm, 0.5 * width_mm};
    high.half_width_mm = {0.5 * thickness_mm, 0.5 * end_width_mm};
    high.z_mm = length_mm;
    const TriangleMesh along_z = makeLoft({low, high}, 48);
    // z -> x, x -> -z
    return transformed(along_z, Rigid3::fromRotationVector({0, 0.5 * std::numbers::pi, 0}));
}

// A ring in the plane z = 0 about the origin.
TriangleMesh ring(double radius_mm, double wire_radius_mm) {
    constexpr int kAround = 72, kAcross = 24;
    TriangleMesh mesh;
    const auto at = [](int i, int j) { return static_cast<std::int32_t>((i % kAround) * kAcross + j % kAcross); };
    for (int i = 0; i < kAround; ++i) {
        const double a = 2 * std::numbers::pi * i / kAround;
        for (int j = 0; j < kAcross; ++j) {
            const double b = 2 * std::numbers::pi * j / kAcross;
            const double r = radius_mm + wire_radius_mm * std::cos(b);
            mesh.vertices.emplace_back(r * std::cos(a), r * std::sin(a), wire_radius_mm * std::sin(b));
            mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    }
    return mesh;
}

TriangleMesh tube(const Vector2& half_width_mm, double length_mm, double taper) {
    std::vector<LoftSection> sections(2);
    for (const int end : {-1, 1}) {
        LoftSection& section = sections[end < 0 ? 0 : 1];
        section.z_mm = 0.5 * end * length_mm;
        section.half_width_mm = (1 - end * taper) * half_width_mm;
    }
    return makeLoft(sections, kSegments);
}

// Turns z into `axis`.
Rigid3 along(const Vector3& axis) {
    return {Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), axis), Vector3::Zero()};
}

}  // namespace

Rigid3 placedPlate(const PlatePlacement& placement) {
    const Rigid3 turned = Rigid3::fromRotationVector({0, placement.mirrored ? std::numbers::pi : 0.0, 0});
    return Rigid3::fromTranslation({placement.shift_mm.x(), placement.shift_mm.y(), 0}) *
           Rigid3::fromRotationVector({0, 0, placement.rotation_rad}) * turned;
}

Result<HeldObject> heldPlate(const GroovedPlate& plate, const PlatePlacement& placement) {
    if (const Result<void> good = plate.validate(); !good) return good.error();
    HeldObject object;
    object.name = "plate";
    object.material = plate.material;
    object.holder = HeldBy::imager;
    object.holder_from_object = placedPlate(placement);
    object.path_lengths = [plate](const CArm& carm, const Rigid3& imager_from_plate, const MeshProjectionOptions& how) {
        return platePathLengths(plate, PlateFacing::source, carm, imager_from_plate, how);
    };
    return object;
}

Result<HeldObject> heldBeads(const std::string& name, const BeadLayout& layout, HeldBy holder,
                             const Rigid3& holder_from_layout, Material material) {
    if (const Result<void> good = layout.validate(); !good) return good.error();
    HeldObject object;
    object.name = name;
    object.material = material;
    object.holder = holder;
    object.holder_from_object = holder_from_layout;
    object.path_lengths = [layout](const CArm& carm, const Rigid3& imager_from_layout,
                                   const MeshProjectionOptions& how) {
        return spherePathLengths(layout, carm, imager_from_layout, how);
    };
    return object;
}

double beadHeight(const GroovedPlate& plate, double diameter_mm) {
    return 0.5 * plate.groove_depth_mm + 0.5 * diameter_mm;
}

Result<BeadLayout> beadsOnPlate(double spacing_mm, double diameter_mm, double half_mm, const GroovedPlate& plate) {
    if (auto ok = requireRanges({{"diameter_mm", diameter_mm, 0.5, 20, "mm"},
                                 {"spacing_mm", spacing_mm, diameter_mm, 200, "mm (from a bead's diameter)"},
                                 {"half_mm", half_mm, 0, 25 * spacing_mm, "mm (25 spacings)"}});
        !ok) {
        return ok.error();
    }
    const int reach = static_cast<int>(std::floor(half_mm / spacing_mm + 1e-9));
    BeadLayout layout;
    layout.frame = Frame::plate;
    for (int j = -reach; j <= reach; ++j)
        for (int i = -reach; i <= reach; ++i)
            layout.beads.push_back({fmt::format("{},{}", i, j),
                                    {i * spacing_mm, j * spacing_mm, -beadHeight(plate, diameter_mm)},
                                    diameter_mm});
    return layout;
}

Result<void> LimbOptions::validate() const {
    const double half = half_width_mm.minCoeff();
    if (!middle_in_room.allFinite()) return invalidOption("middle_in_room", "NaN", "three numbers");
    if (!(axis_in_room.norm() > 1e-6 && axis_in_room.allFinite()))
        return invalidOption("axis_in_room", "no direction", "a vector with a length");
    return requireRanges({{"half_width_mm[0]", half_width_mm[0], 1, 500, "mm"},
                          {"half_width_mm[1]", half_width_mm[1], 1, 500, "mm"},
                          {"length_mm", length_mm, 1, 2000, "mm"},
                          {"taper", taper, 0, 0.5, ""},
                          {"bone_radius_mm", bone_radius_mm, 0, 0.5 * (1 - taper) * half, "mm (half the limb's end)"},
                          {"marrow_radius_mm", marrow_radius_mm, 0, 100, "mm"},
                          {"bone_offset_mm", bone_offset_mm, 0, 0.4 * (1 - taper) * half, "mm"}});
}

Result<std::vector<HeldObject>> heldLimb(const LimbOptions& options) {
    if (const Result<void> good = options.validate(); !good) return good.error();
    const Rigid3 room_from_limb = Rigid3::fromTranslation(options.middle_in_room) * along(options.axis_in_room);
    std::vector<HeldObject> objects(1);
    objects[0].name = "limb";
    objects[0].material = Material::softTissue;
    objects[0].mesh = tube(options.half_width_mm, options.length_mm, options.taper);
    objects[0].holder_from_object = room_from_limb;
    if (options.bone_radius_mm == 0) return objects;
    const Rigid3 room_from_bone = room_from_limb * Rigid3::fromTranslation({options.bone_offset_mm, 0, 0});
    const auto addInside = [&](const char* name, Material material, Material displaces, double radius_mm) {
        HeldObject inside;
        inside.name = name;
        inside.material = material;
        inside.displaces = displaces;
        inside.mesh = makeCylinder(radius_mm, options.length_mm, kSegments);
        inside.holder_from_object = room_from_bone;
        objects.push_back(std::move(inside));
    };
    addInside("bone", Material::corticalBone, Material::softTissue, options.bone_radius_mm);
    if (options.marrow_radius_mm > 0 && options.marrow_radius_mm < options.bone_radius_mm)
        addInside("marrow", Material::fat, Material::corticalBone, options.marrow_radius_mm);
    return objects;
}

std::vector<HeldObject> clamp(const std::string& name, HeldBy holder, const Rigid3& holder_from_clamp) {
    constexpr double kBladeMm = 50, kHandleMm = 75, kThicknessMm = 3, kRingMm = 11, kWireMm = 1.5;
    std::vector<HeldObject> halves;
    for (const int side : {-1, 1}) {
        // The halves lie one above the other, turned by 6 degrees each.
        const Rigid3 turn = Rigid3::fromTranslation({0, 0, side * (0.5 * kThicknessMm + 0.2)}) *
                            Rigid3::fromRotationVector({0, 0, side * 6 * std::numbers::pi / 180});
        TriangleMesh mesh = transformed(bar(kBladeMm, 7, 2.5, kThicknessMm), turn);
        const Rigid3 backward = Rigid3::fromTranslation({-0.001, 0, 0}) *
                                Rigid3::fromRotationVector({0, 0, std::numbers::pi});  // clear of the blade
        mesh = merged(std::move(mesh), transformed(bar(kHandleMm, 7, 4, kThicknessMm), turn * backward));
        const Vector3 ring_center(-kHandleMm - kRingMm - kWireMm, -side * 6.0, 0);
        mesh =
            merged(std::move(mesh), transformed(ring(kRingMm, kWireMm), turn * Rigid3::fromTranslation(ring_center)));
        HeldObject half;
        half.name = name + (side < 0 ? " lower half" : " upper half");
        half.mesh = std::move(mesh);
        half.material = Material::steel;
        half.holder = holder;
        half.holder_from_object = holder_from_clamp;
        halves.push_back(std::move(half));
    }
    return halves;
}

HeldObject screw(const std::string& name, double length_mm, HeldBy holder, const Rigid3& holder_from_screw) {
    // From the head's top (z = -length) to the tip.
    std::vector<LoftSection> sections;
    const auto section = [&](double from_tip_mm, double radius_mm) {
        LoftSection next;
        next.z_mm = -from_tip_mm;
        next.half_width_mm.setConstant(radius_mm);
        sections.push_back(next);
    };
    section(length_mm, 3);
    section(length_mm - 2, 4);
    section(length_mm - 4.5, 2.25);
    section(4, 2.25);
    section(0, 0);
    HeldObject object;
    object.name = name;
    object.mesh = makeLoft(sections, kSegments);
    object.material = Material::steel;
    object.holder = holder;
    object.holder_from_object = holder_from_screw;
    return object;
}

}  // namespace fluorocut
