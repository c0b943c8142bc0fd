#include "core/planning/implant_family.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/base/option_checks.h"
#include "core/base/units.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/mesh_section.h"
#include "core/geometry/primitives.h"

namespace fluorocut {
namespace {

using Ring = std::vector<Vector3>;

// The 12/14 taper and the neck below it.
constexpr double kTaperTop = 6.35, kTaperBase = 7, kTaperLength = 13;  // radii and length, mm
constexpr double kNeckRoot = 7.5;                                      // radius where the neck leaves the shoulder
constexpr double kTaperBeyondHead = 1;  // the taper ends this far beyond the centre of a head with neck length 0
constexpr double kBoreClearance = 0.02, kBoreGap = 1, kLeastBore = 12, kSkirt = 9.5;
constexpr double kPivotGap = 2;  // from the medial corner to the line about which the sections turn

double smooth(double t) {
    return t * t * (3 - 2 * t);
}

// The neck as a line: places are head centre (neck length 0) + s * direction. In the plane of the neck, before its
// anteversion; x and z of `cavity`.
struct Neck {
    double angle;          // of its direction from the stem's axis
    Vector2 direction;     // (x, z)
    Vector2 pivot;         // of the turning sections
    double pivot_to_axis;  // distance from the pivot to the neck's middle line
    double root;           // s where the turned section stands

    Neck(const ImplantFamily& family, const StemSize& size)
        : angle(std::numbers::pi - family.neck_shaft_angle_rad), direction(std::sin(angle), std::cos(angle)) {
        const double medial_edge =
            0.5 * size.proximal_mm.x() + 0.5 * (1 - family.even_taper) * (size.proximal_mm - size.distal_mm).x();
        pivot = {medial_edge + kPivotGap, 0};
        const Vector2 from_pivot = Vector2(size.offset_mm, size.head_height_mm) - pivot;
        pivot_to_axis = from_pivot.dot(Vector2(-std::cos(angle), std::sin(angle)));
        root = -from_pivot.dot(direction);
    }
    double taperEnd() const { return kTaperBeyondHead; }
    double radius(double s) const {
        const double base = taperEnd() - kTaperLength;
        if (s >= base) return kTaperBase + (s - base) / kTaperLength * (kTaperTop - kTaperBase);
        return kNeckRoot + (s - root) / (base - root) * (kTaperBase - kNeckRoot);
    }
};

struct Builder {
    const ImplantFamily& family;
    const StemSize& size;
    Neck neck;
    int around, rings;

    Builder(const ImplantFamily& f, const StemSize& s, int triangles) : family(f), size(s), neck(f, s) {
        const double even = std::sqrt(triangles / 3.0);
        around = std::max({16, 8 * static_cast<int>(std::lround(even / 8)), 12 * family.flutes});
        rings = std::max(40, static_cast<int>(std::lround(0.5 * triangles / around)));
    }

    double middleY() const { return -family.posterior_curve_mm; }

    Ring body(double above) const {
        const double t = above / size.length_mm;
        const Vector2 growth = size.proximal_mm - size.distal_mm;
        const double late = (1 - family.even_taper) * std::pow(t, family.flare_power);
        const double rounding = tipRounding();
        const double shrink = above < rounding ? std::sqrt(1 - std::pow(1 - above / rounding, 2)) : 1;
        const Vector2 half = 0.5 * shrink *
                             Vector2(size.distal_mm.x() + growth.x() * (family.even_taper * t + late),
                                     size.distal_mm.y() + growth.y() * t);
        const double exponent = family.distal_exponent + t * (family.proximal_exponent - family.distal_exponent);
        const double bent = std::max(0.0, 2 * t - 1);
        const Vector2 middle(0.5 * growth.x() * late, middleY() * bent * bent);
        const double flute = shrink * family.flute_depth_mm * fluted(above);
        Ring ring;
        for (int i = 0; i < around; ++i) {
            const double angle = 2 * std::numbers::pi * i / around;
            Vector2 p = superellipsePoint(half, exponent, angle);
            if (flute > 0) p *= 1 - flute * 0.5 * (1 - std::cos(family.flutes * angle)) / p.norm();
            ring.emplace_back(middle.x() + p.x(), middle.y() + p.y(), above - size.length_mm);
        }
        return ring;
    }

    double tipRounding() const { return 0.75 * size.distal_mm.maxCoeff(); }

    // 1 inside the fluted part, falling to 0 over 8 mm at its ends.
    double fluted(double above) const {
        if (family.flutes == 0) return 0;
        const double low = family.flute_levels.x() * size.length_mm, high = family.flute_levels.y() * size.length_mm;
        return smooth(std::clamp((above - low) / 8, 0.0, 1.0)) * smooth(std::clamp((high - above) / 8, 0.0, 1.0));
    }

    // A section that the plane through the pivot holds, `part` of the way from the resection to the neck.
    Ring shoulder(double part) const {
        const double angle = part * neck.angle, blend = smooth(part);
        const double near_edge = kPivotGap + blend * (neck.pivot_to_axis - kNeckRoot - kPivotGap);
        const double far_body = size.proximal_mm.x() + kPivotGap;
        const double far_edge = far_body + blend * (neck.pivot_to_axis + kNeckRoot - far_body);
        const Vector2 half(0.5 * (far_edge - near_edge),
                           0.5 * size.proximal_mm.y() + blend * (kNeckRoot - 0.5 * size.proximal_mm.y()));
        const double exponent = family.proximal_exponent + blend * (2 - family.proximal_exponent);
        const double from_pivot = 0.5 * (near_edge + far_edge);
        const Vector2 middle = neck.pivot + from_pivot * Vector2(-std::cos(angle), std::sin(angle));
        return placed(half, exponent, middle, angle, part * family.anteversion_rad);
    }

    Ring neckRing(double s) const {
        const Vector2 head(size.offset_mm, size.head_height_mm);
        return placed(Vector2::Constant(neck.radius(s)), 2, head + s * neck.direction, neck.angle,
                      family.anteversion_rad);
    }

    // In the plane of the neck (x, z) and across it (y), turned by `version` about the vertical through the body.
    Ring placed(const Vector2& half, double exponent, const Vector2& middle, double angle, double version) const {
        Ring ring;
        for (int i = 0; i < around; ++i) {
            const Vector2 p = superellipsePoint(half, exponent, 2 * std::numbers::pi * i / around);
            ring.push_back(
                turned({middle.x() + p.x() * std::cos(angle), p.y(), middle.y() - p.x() * std::sin(angle)}, version));
        }
        return ring;
    }

    Vector3 turned(const Vector3& p, double version) const {
        const double c = std::cos(version), s = std::sin(version);
        return {c * p.x() - s * p.y(), middleY() + s * p.x() + c * p.y(), p.z()};
    }

    TriangleMesh stem() const {
        const int tip = rings / 8, shoulder_rings = rings / 6, neck_rings = rings / 8;
        const int shaft = rings - tip - shoulder_rings - neck_rings;
        std::vector<Ring> skin{{Vector3(0, 0, -size.length_mm)}};
        for (int i = 1; i <= tip; ++i)  // even steps of angle round the tip
            skin.push_back(body(tipRounding() * (1 - std::cos(0.5 * std::numbers::pi * i / tip))));
        for (int i = 1; i <= shaft; ++i)
            skin.push_back(body(tipRounding() + (size.length_mm - tipRounding()) * i / shaft));
        for (int i = 1; i <= shoulder_rings; ++i)
            skin.push_back(shoulder(static_cast<double>(i) / shoulder_rings));
        // The taper's base gets a ring of its own.
        const double base = neck.taperEnd() - kTaperLength;
        const int below = std::max(2, neck_rings / 2), above = std::max(2, neck_rings - below);
        for (int i = 1; i <= below; ++i)
            skin.push_back(neckRing(neck.root + (base - neck.root) * i / below));
        for (int i = 1; i <= above; ++i)
            skin.push_back(neckRing(base + kTaperLength * i / above));
        return makeSkin(skin);
    }

    // Along the neck's direction; its centre at s = neck_mm.
    TriangleMesh head(double radius, double neck_mm) const {
        const double bore_end = neck.taperEnd() + kBoreGap;
        const double skirt_at = neck_mm - std::sqrt(radius * radius - kSkirt * kSkirt);
        const double opening = std::min(skirt_at, neck.taperEnd() - kLeastBore);
        const auto bore = [&](double s) { return neck.radius(std::min(s, neck.taperEnd())) + kBoreClearance; };
        std::vector<std::pair<double, double>> profile;  // s, radius: from the bore's end round to the pole
        profile.emplace_back(bore_end, 0);
        for (const double s : {bore_end, neck.taperEnd(), opening})
            profile.emplace_back(s, bore(s));
        if (opening < skirt_at) profile.emplace_back(opening, kSkirt);
        const double start = std::acos((neck_mm - skirt_at) / radius);  // from the lower pole
        const int steps = std::max(8, rings / 2);
        for (int i = 0; i < steps; ++i) {
            const double a = start + (std::numbers::pi - start) * i / steps;
            profile.emplace_back(neck_mm - radius * std::cos(a), radius * std::sin(a));
        }
        profile.emplace_back(neck_mm + radius, 0);
        std::vector<Ring> skin;
        const Vector2 origin(size.offset_mm, size.head_height_mm);
        for (const auto& [s, r] : profile) {
            const Vector2 middle = origin + s * neck.direction;
            if (r == 0) {
                skin.push_back({turned({middle.x(), 0, middle.y()}, family.anteversion_rad)});
            } else {
                skin.push_back(placed(Vector2::Constant(r), 2, middle, neck.angle, family.anteversion_rad));
            }
        }
        return makeSkin(skin);
    }
};

std::string listed(const std::vector<double>& values) {
    return fmt::format("{:g}", fmt::join(values, ", "));
}

bool has(const std::vector<double>& values, double value) {
    return std::any_of(values.begin(), values.end(), [&](double v) { return std::abs(v - value) < 1e-9; });
}

}  // namespace

Result<void> ImplantFamily::validate() const {
    const double degree = radiansFromDegrees(1);
    if (auto good = requireRanges({{"even_taper", even_taper, 0, 1, ""},
                                   {"flare_power", flare_power, 1, 20, ""},
                                   {"distal_exponent", distal_exponent, 1.5, 10, ""},
                                   {"proximal_exponent", proximal_exponent, 1.5, 10, ""},
                                   {"posterior_curve_mm", posterior_curve_mm, -20, 20, "mm"},
                                   {"flutes", static_cast<double>(flutes), 0, 24, ""},
                                   {"flute_depth_mm", flute_depth_mm, 0, 3, "mm"},
                                   {"flute_levels[0]", flute_levels.x(), 0, 1, "of the length"},
                                   {"flute_levels[1]", flute_levels.y(), flute_levels.x(), 1, "of the length"},
                                   {"neck_shaft_angle_deg", neck_shaft_angle_rad / degree, 110, 150, "degrees"},
                                   {"anteversion_deg", anteversion_rad / degree, -45, 45, "degrees"}});
        !good)
        return good;
    if (sizes.empty()) return invalidOption("sizes", "none", "at least one size");
    if (necks_mm.empty()) return invalidOption("necks_mm", "none", "at least one neck length");
    if (heads_mm.empty()) return invalidOption("heads_mm", "none", "at least one head");
    for (const double neck : necks_mm)
        if (auto good = requireRange("necks_mm", neck, -10, 20, "mm"); !good) return good;
    for (const double head : heads_mm)
        if (auto good = requireRange("heads_mm", head, 22, 60, "mm"); !good) return good;
    std::set<std::string> names;
    for (const StemSize& size : sizes) {
        const std::string of = "sizes, \"" + size.name + "\", ";
        if (size.name.empty() || !names.insert(size.name).second)
            return invalidOption("sizes", "the name \"" + size.name + "\" twice or empty", "a name of its own each");
        const double distal = size.distal_mm.maxCoeff();
        for (const auto& [field, value, low, high] :
             {std::tuple("length_mm", size.length_mm, 3 * distal, 500.0),
              std::tuple("distal_mm[0]", size.distal_mm.x(), 4.0, 40.0),
              std::tuple("distal_mm[1]", size.distal_mm.y(), 4.0, 40.0),
              std::tuple("proximal_mm[0]", size.proximal_mm.x(), size.distal_mm.x(), 60.0),
              std::tuple("proximal_mm[1]", size.proximal_mm.y(), size.distal_mm.y(), 60.0),
              std::tuple("offset_mm", size.offset_mm, 15.0, 80.0),
              std::tuple("head_height_mm", size.head_height_mm, 5.0, 80.0)}) {
            if (auto good = requireRange((of + field).c_str(), value, low, high, "mm"); !good) return good;
        }
        if (!(flute_depth_mm < 0.3 * size.distal_mm.minCoeff()))
            return invalidOption(of + "flute_depth_mm", fmt::format("{:g} mm", flute_depth_mm),
                                 "less than 30 % of the distal diameter");
        const Neck neck(*this, size);
        if (!(neck.pivot_to_axis - kNeckRoot >= 0.5 && neck.pivot_to_axis + kNeckRoot <= size.proximal_mm.x() + 10))
            return invalidOption(
                of + "head_height_mm",
                fmt::format("{:g} mm with an offset of {:g} mm", size.head_height_mm, size.offset_mm),
                fmt::format(
                    "a neck whose middle line passes {:.1f} to {:.1f} mm beside the medial corner (here {:.1f})",
                    kNeckRoot + 0.5, size.proximal_mm.x() + 10 - kNeckRoot, neck.pivot_to_axis),
                "change height or offset");
        if (!(neck.taperEnd() - kTaperLength - neck.root >= 1))
            return invalidOption(of + "offset_mm", fmt::format("{:g} mm", size.offset_mm),
                                 "a neck longer than its 13 mm taper", "raise offset or head height");
    }
    return {};
}

Result<Implant> makeImplant(const ImplantFamily& family, const ImplantChoice& choice) {
    if (auto good = family.validate(); !good) return good.error();
    std::vector<std::string> names;
    for (const StemSize& size : family.sizes)
        names.push_back(size.name);
    const auto found = choice.size.empty() ? names.begin() + static_cast<std::ptrdiff_t>(names.size() / 2)
                                           : std::find(names.begin(), names.end(), choice.size);
    if (found == names.end())
        return invalidOption("size", choice.size, fmt::format("one of {}", fmt::join(names, ", ")));
    if (!has(family.heads_mm, choice.head_mm))
        return invalidOption("head", fmt::format("{:g} mm", choice.head_mm),
                             "one of " + listed(family.heads_mm) + " mm");
    if (!has(family.necks_mm, choice.neck_mm))
        return invalidOption("neck", fmt::format("{:g} mm", choice.neck_mm),
                             "one of " + listed(family.necks_mm) + " mm");
    if (auto good = requireRange("triangles", choice.triangles, 500, 400000, ""); !good) return good.error();

    const StemSize& size = family.sizes[static_cast<std::size_t>(found - names.begin())];
    const Builder builder(family, size, choice.triangles);
    Implant implant;
    implant.family = family.name;
    implant.size = size.name;
    implant.parts.push_back({"stem", family.stem_material, builder.stem()});
    implant.head_radius_mm = 0.5 * choice.head_mm;
    implant.parts.push_back({"head", family.head_material, builder.head(implant.head_radius_mm, choice.neck_mm)});
    const Vector2 head = Vector2(size.offset_mm, size.head_height_mm) + choice.neck_mm * builder.neck.direction;
    implant.head_center = builder.turned({head.x(), 0, head.y()}, family.anteversion_rad);
    implant.stem_length_mm = size.length_mm;
    const auto half_edges = HalfEdgeMesh::build(implant.parts[0].mesh, family.name);
    if (!half_edges) throw std::logic_error("makeImplant: " + half_edges.error().message());
    Result<TriangleMesh> in_bone = partBelow(*half_edges, {});
    if (!in_bone) return in_bone.error();
    implant.in_bone = std::move(*in_bone);
    return choice.side == Side::right ? mirrored(std::move(implant)) : implant;
}

}  // namespace fluorocut
