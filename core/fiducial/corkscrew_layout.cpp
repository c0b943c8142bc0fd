#include "core/fiducial/corkscrew_layout.h"

#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/base/option_checks.h"
#include "core/io/atomic_file.h"
#include "core/io/json_file.h"

namespace fluorocut {
namespace {

constexpr std::string_view kSchema = "fluorocut/corkscrew/1";

double turnedBy(const CorkscrewHelix& helix, double t) {
    const double sign = helix.handedness == Handedness::right ? 1 : -1;
    return sign * 2 * std::numbers::pi * helix.turns * t;
}

Result<void> requireRising(const char* field, const std::array<double, 2>& range) {
    if (range[0] < range[1] && std::abs(range[0]) <= 1000 && std::abs(range[1]) <= 1000) return {};
    return invalidOption(field, fmt::format("[{}, {}]", range[0], range[1]),
                         "two numbers in rising order, -1000 to 1000 mm");
}

// A wire lies in the rod and clear of the shaft.
Result<void> requireWire(const CorkscrewLayout& layout, const std::string& field, double radius_mm, double wire_mm,
                         double x_low_mm, double x_high_mm) {
    const double least = layout.shaft_radius_mm + wire_mm;
    if (const auto ok = requireRange((field + "wire_radius_mm").c_str(), wire_mm, 0.05, 5, "mm"); !ok) return ok;
    if (const auto ok = requireRange((field + "radius_mm").c_str(), radius_mm, least, layout.rod_radius_mm,
                                     "mm (between shaft and rod)");
        !ok) {
        return ok;
    }
    if (x_low_mm - wire_mm >= layout.rod_x_mm[0] && x_high_mm + wire_mm <= layout.rod_x_mm[1]) return {};
    return invalidOption(field + "x", fmt::format("{} to {} mm", x_low_mm - wire_mm, x_high_mm + wire_mm),
                         fmt::format("within the rod, {} to {} mm", layout.rod_x_mm[0], layout.rod_x_mm[1]));
}

Result<void> checkRings(const CorkscrewLayout& layout) {
    if (layout.rings.size() < 2 || layout.rings.size() > 20)
        return invalidOption("rings", std::to_string(layout.rings.size()), "2 to 20");
    const CorkscrewHelix& helix = layout.helix;
    for (std::size_t i = 0; i < layout.rings.size(); ++i) {
        const CorkscrewRing& ring = layout.rings[i];
        const std::string field = fmt::format("rings[{}].", i);
        if (const auto ok = requireWire(layout, field, ring.radius_mm, ring.wire_radius_mm, ring.x_mm, ring.x_mm);
            !ok) {
            return ok;
        }
        if (i > 0) {
            const CorkscrewRing& before = layout.rings[i - 1];
            if (!(ring.x_mm - before.x_mm >= ring.wire_radius_mm + before.wire_radius_mm)) {
                return invalidOption(field + "x_mm", fmt::format("{}", ring.x_mm),
                                     fmt::format("beyond the ring before it, at {} mm", before.x_mm));
            }
        }
        const double clear_mm = ring.wire_radius_mm + helix.wire_radius_mm;
        if (ring.x_mm > helix.x_start_mm - clear_mm && ring.x_mm < helix.x_end_mm + clear_mm) {
            return invalidOption(field + "x_mm", fmt::format("{}", ring.x_mm),
                                 fmt::format("clear of the helix, {} to {} mm", helix.x_start_mm, helix.x_end_mm));
        }
    }
    return {};
}

Result<void> checkBeads(const CorkscrewLayout& layout) {
    for (std::size_t i = 0; i < layout.beads.size(); ++i) {
        const CorkscrewBead& bead = layout.beads[i];
        const std::string field = fmt::format("beads[{}].", i);
        if (const auto ok = requireRange((field + "radius_mm").c_str(), bead.radius_mm, 0.1, 10, "mm"); !ok) return ok;
        const double aside_mm = bead.center_mm.tail<2>().norm();
        if (!(aside_mm - bead.radius_mm >= layout.shaft_radius_mm &&
              aside_mm + bead.radius_mm <= layout.rod_radius_mm)) {
            return invalidOption(field + "center_mm", fmt::format("{:.4g} mm from the axis", aside_mm),
                                 "a bead between shaft and rod's surface");
        }
        if (!(bead.center_mm.x() - bead.radius_mm >= layout.rod_x_mm[0] &&
              bead.center_mm.x() + bead.radius_mm <= layout.rod_x_mm[1])) {
            return invalidOption(field + "center_mm", fmt::format("x = {} mm", bead.center_mm.x()),
                                 "a bead within the rod's length");
        }
    }
    return {};
}

Material readMaterial(JsonObject& object, std::string_view field) {
    const std::string text = object.text(field);
    if (const std::optional<Material> known = materialFromName(text)) return *known;
    if (!object.failed()) object.fail(field, "\"" + text + "\"", "the name of a material, as \"steel\"");
    return Material::air;
}

std::array<double, 2> pairOf(const Vector2& v) {
    return {v.x(), v.y()};
}

}  // namespace

Vector3 CorkscrewRing::point(double angle_rad) const {
    return {x_mm, radius_mm * std::cos(angle_rad), radius_mm * std::sin(angle_rad)};
}

Vector3 CorkscrewRing::tangent(double angle_rad) const {
    return {0, -std::sin(angle_rad), std::cos(angle_rad)};
}

Vector3 CorkscrewHelix::point(double t) const {
    const double angle = phase_rad + turnedBy(*this, t);
    return {x_start_mm + t * (x_end_mm - x_start_mm), radius_mm * std::cos(angle), radius_mm * std::sin(angle)};
}

Vector3 CorkscrewHelix::tangent(double t) const {
    const double angle = phase_rad + turnedBy(*this, t);
    const double around = radius_mm * turnedBy(*this, 1);
    return Vector3(x_end_mm - x_start_mm, -around * std::sin(angle), around * std::cos(angle)) / length_mm();
}

double CorkscrewHelix::length_mm() const {
    return std::hypot(x_end_mm - x_start_mm, radius_mm * turnedBy(*this, 1));
}

Result<void> CorkscrewLayout::validate() const {
    if (const auto ok = requireRanges({{"rod_radius_mm", rod_radius_mm, 1, 100, "mm"},
                                       {"shaft_radius_mm", shaft_radius_mm, 0.1, 0.9 * rod_radius_mm, "mm"},
                                       {"helix.turns", helix.turns, 0.25, 20, "turns"},
                                       {"helix.phase_rad", helix.phase_rad, -100, 100, "rad"}});
        !ok) {
        return ok;
    }
    if (const auto ok = requireRising("rod_x_mm", rod_x_mm); !ok) return ok;
    if (const auto ok = requireRising("shaft_x_mm", shaft_x_mm); !ok) return ok;
    if (const auto ok = requireRising("helix.x_start_mm, x_end_mm", {helix.x_start_mm, helix.x_end_mm}); !ok) return ok;
    if (const auto ok =
            requireWire(*this, "helix.", helix.radius_mm, helix.wire_radius_mm, helix.x_start_mm, helix.x_end_mm);
        !ok) {
        return ok;
    }
    if (const auto ok = checkRings(*this); !ok) return ok;
    return checkBeads(*this);
}

Result<CorkscrewLayout> readCorkscrew(const std::filesystem::path& path) {
    Result<JsonObject> file = readJson(path, kSchema);
    if (!file) return file.error();
    CorkscrewLayout layout;
    layout.rod_radius_mm = file->number("rod_radius_mm");
    layout.rod_x_mm = pairOf(file->vector<2>("rod_x_mm"));
    layout.shaft_radius_mm = file->number("shaft_radius_mm");
    layout.shaft_x_mm = pairOf(file->vector<2>("shaft_x_mm"));
    for (JsonObject ring : file->objects("rings"))
        layout.rings.push_back({ring.number("x_mm"), ring.number("radius_mm"), ring.number("wire_radius_mm")});
    JsonObject helix = file->object("helix");
    layout.helix.x_start_mm = helix.number("x_start_mm");
    layout.helix.x_end_mm = helix.number("x_end_mm");
    layout.helix.turns = helix.number("turns");
    layout.helix.radius_mm = helix.number("radius_mm");
    layout.helix.phase_rad = helix.number("phase_rad");
    layout.helix.handedness = helix.choice("handedness", {"right", "left"}) == 0 ? Handedness::right : Handedness::left;
    layout.helix.wire_radius_mm = helix.number("wire_radius_mm");
    if (!file->isNull("beads")) {
        for (JsonObject bead : file->objects("beads"))
            layout.beads.push_back({bead.vector<3>("center_mm"), bead.number("radius_mm")});
    }
    JsonObject materials = file->object("materials");
    layout.rod = readMaterial(materials, "rod");
    layout.shaft = readMaterial(materials, "shaft");
    layout.wire = readMaterial(materials, "wire");
    if (const Result<void> read = file->finish(); !read) return read.error();
    if (const Result<void> good = layout.validate(); !good) {
        return invalidInput(path.string() + ", field " + good.error().where, good.error().found, good.error().expected);
    }
    return layout;
}

Result<void> writeCorkscrew(const std::filesystem::path& path, const CorkscrewLayout& layout) {
    if (const Result<void> good = layout.validate(); !good) return good.error();
    using Json = nlohmann::ordered_json;
    Json rings = Json::array(), beads = Json::array();
    for (const CorkscrewRing& ring : layout.rings) {
        rings.push_back({{"x_mm", ring.x_mm}, {"radius_mm", ring.radius_mm}, {"wire_radius_mm", ring.wire_radius_mm}});
    }
    for (const CorkscrewBead& bead : layout.beads) {
        beads.push_back({{"center_mm", {bead.center_mm.x(), bead.center_mm.y(), bead.center_mm.z()}},
                         {"radius_mm", bead.radius_mm}});
    }
    const CorkscrewHelix& helix = layout.helix;
    const Json json = {
        {"schema", kSchema},
        {"rod_radius_mm", layout.rod_radius_mm},
        {"rod_x_mm", layout.rod_x_mm},
        {"shaft_radius_mm", layout.shaft_radius_mm},
        {"shaft_x_mm", layout.shaft_x_mm},
        {"rings", rings},
        {"helix",
         {{"x_start_mm", helix.x_start_mm},
          {"x_end_mm", helix.x_end_mm},
          {"turns", helix.turns},
          {"radius_mm", helix.radius_mm},
          {"phase_rad", helix.phase_rad},
          {"handedness", helix.handedness == Handedness::right ? "right" : "left"},
          {"wire_radius_mm", helix.wire_radius_mm}}},
        {"beads", beads},
        {"materials", {{"rod", name(layout.rod)}, {"shaft", name(layout.shaft)}, {"wire", name(layout.wire)}}}};
    return writeWhole(path, json.dump(2) + "\n");
}

}  // namespace fluorocut
