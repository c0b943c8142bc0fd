#include "core/planning/femur_shaft.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/option_checks.h"
#include "core/planning/bone_section.h"
#include "core/planning/line_fit.h"

namespace fluorocut {
namespace {

constexpr double kStepMm = 2;
constexpr double kReachMm = 80;  // about the shaft, so that the head is in it
constexpr double kLeastShaftMm = 40;
constexpr double kNeighbourMm = 8;  // from one level's marrow to the next one's

struct Tracked {
    Vector3 marrow;
    double area = 0;
    BoneSection section;
    SectionPlane plane;
};

struct Extent {
    Vector3 low, high;
};

Extent extentOf(const VolumeGrid& grid) {
    Extent box{Vector3::Constant(std::numeric_limits<double>::infinity()), {}};
    box.high = -box.low;
    for (int corner = 0; corner < 8; ++corner) {
        Vector3 index;
        for (int axis = 0; axis < 3; ++axis)
            index[axis] = (corner >> axis) & 1 ? grid.size[static_cast<std::size_t>(axis)] - 1 : 0;
        const Vector3 p = grid.pointFromIndex(index);
        box.low = box.low.cwiseMin(p);
        box.high = box.high.cwiseMax(p);
    }
    return box;
}

// A femur's shaft is 18 to 45 mm wide and its section fills most of the box around it.
bool looksLikeShaft(const BoneSection& section) {
    return !section.at_border && section.width_mm > 18 && section.width_mm < 45 &&
           section.area_mm2 > 0.55 * section.width_mm * section.width_mm;
}

std::optional<Tracked> sectionAt(const Volume& ct, const Vector3& near, const Vector3& u, const Vector3& v,
                                 double reach, double near_mm) {
    const double pixel = std::clamp(ct.grid().spacing_mm.minCoeff(), 0.5, 2.0);
    const SectionPlane plane{near, u, v};
    auto section = boneSection(ct, plane, reach, pixel, Vector2::Zero(), near_mm);
    if (!section) return std::nullopt;
    const Vector3 marrow = plane.at(section->marrow_mm);
    const double area = section->area_mm2;
    return Tracked{marrow, area, std::move(*section), plane};
}

// The first section, from below, that may be the shaft of the femur asked for.
std::optional<Tracked> lowestShaft(const Volume& ct, const Extent& box, std::optional<Side> side) {
    const Vector3 middle = 0.5 * (box.low + box.high), size = box.high - box.low;
    const double reach = 0.5 * std::max(size.x(), size.y()) + 5;
    std::vector<double> places{middle.x()};
    if (size.x() > 250) places = {middle.x() + 0.2 * size.x(), middle.x() - 0.2 * size.x()};  // both hips
    if (side == Side::left) places = {places.front()};
    if (side == Side::right) places = {places.back()};
    for (double z = box.low.z() + 2; z < box.high.z() - kLeastShaftMm; z += 4)
        for (const double x : places) {
            auto found = sectionAt(ct, {x, middle.y(), z}, Vector3::UnitX(), Vector3::UnitY(), reach, reach);
            if (found && looksLikeShaft(found->section)) return found;
        }
    return std::nullopt;
}

// The middle of the bone that lies more than 30 mm from the axis: head and neck. Nothing of it: none.
std::optional<Vector3> headward(const std::vector<Tracked>& levels, const AxisLine& axis) {
    const Vector3 w = axis.direction();
    Vector3 sum = Vector3::Zero();
    int count = 0;
    for (const Tracked& level : levels)
        for (int y = 0; y < level.section.solid.height(); ++y)
            for (int x = 0; x < level.section.solid.width(); ++x) {
                if (!level.section.solid(x, y)) continue;
                const Vector3 away = level.plane.at(level.section.place(x, y)) - axis.distal;
                const Vector3 across = away - away.dot(w) * w;
                if (across.norm() < 30) continue;
                sum += across;
                ++count;
            }
    if (count < 100) return std::nullopt;
    return Vector3(sum / count);
}

// From the axis to where the bone ends in a direction, at a level.
double edgeToward(const Tracked& level, const AxisLine& axis, const Vector3& direction) {
    const Vector3 w = axis.direction(), normal = level.plane.u.cross(level.plane.v);
    const Vector3 on_axis = axis.distal + normal.dot(level.plane.origin - axis.distal) / normal.dot(w) * w;
    double last = 0;
    for (double r = 0; r < kReachMm && r - last < 3; r += 0.5) {
        const Vector3 p = on_axis + r * direction - level.plane.origin;
        if (level.section.covers({p.dot(level.plane.u), p.dot(level.plane.v)})) last = r;
    }
    return last;
}

}  // namespace

Result<void> FemurShaftOptions::validate() const {
    if (axis)
        if (const double length = (axis->proximal - axis->distal).norm(); !(length >= 10 && length <= 600))
            return invalidOption("axis", fmt::format("two points {:.3g} mm apart", length), "10 to 600 mm");
    return requireRange("neck_ratio", neck_ratio, 1.05, 4, "");
}

Result<FemurShaft> findFemurShaft(const Volume& ct, const FemurShaftOptions& options, Progress& progress) {
    constexpr const char* kStep = "finding the shaft";
    if (auto good = options.validate(); !good) return good.error();
    const Extent box = extentOf(ct.grid());
    Vector3 u = Vector3::UnitX(), v = Vector3::UnitY(), w = Vector3::UnitZ();
    std::optional<Tracked> first;
    if (options.axis) {
        w = options.axis->direction();
        const Vector3 across = std::abs(w.x()) < 0.9 ? Vector3::UnitX() : Vector3::UnitY();
        u = (across - across.dot(w) * w).normalized();
        v = w.cross(u);
        first = sectionAt(ct, options.axis->distal, u, v, kReachMm, 15);
    } else {
        first = lowestShaft(ct, box, options.side);
    }
    if (!first)
        return noSolution(
            "CT", "no closed ring of cortex 18 to 45 mm wide",
            options.axis ? "one about the axis's distal point" : "the femur's shaft in its lower sections",
            "give an axis inside the canal (--axis-mm)");

    std::vector<Tracked> levels;
    Vector3 at = first->marrow;
    while ((at.array() >= box.low.array()).all() && (at.array() <= box.high.array()).all()) {
        if (progress.isCancelled()) return cancelled(kStep);
        progress.report(std::clamp((at - box.low).z() / (box.high - box.low).z(), 0.0, 1.0), kStep);
        auto next = sectionAt(ct, at, u, v, kReachMm, kNeighbourMm);
        if (!next || next->section.at_border) break;
        at = next->marrow + kStepMm * w;
        levels.push_back(std::move(*next));
    }
    std::vector<double> areas;
    for (const Tracked& level : levels)
        areas.push_back(level.area);
    areas.resize((areas.size() + 1) / 2);
    const double shaft_area = median(areas);

    FemurShaft shaft;
    std::size_t last = 0;
    for (std::size_t l = 0; l < levels.size() && levels[l].area < 1.15 * shaft_area; ++l) {
        last = l;
        if (levels[l].area > 0.85 * shaft_area) shaft.centers.push_back(levels[l].marrow);
    }
    if (!options.axis && static_cast<double>(shaft.centers.size()) * kStepMm < kLeastShaftMm)
        return noSolution("CT", fmt::format("{:.0f} mm of shaft", static_cast<double>(shaft.centers.size()) * kStepMm),
                          fmt::format("at least {:g} mm of it below the lesser trochanter", kLeastShaftMm),
                          "give an axis inside the canal (--axis-mm)");
    if (options.axis) {
        shaft.axis = *options.axis;
    } else {
        const LineFit line = fitLine(shaft.centers);
        const Vector3 direction = line.direction.z() < 0 ? Vector3(-line.direction) : line.direction;
        const auto onLine = [&](const Vector3& p) {
            return Vector3(line.point + direction.dot(p - line.point) * direction);
        };
        shaft.axis = {onLine(levels.front().marrow), onLine(levels[last].marrow)};
        shaft.rms_mm = line.rms_mm;
    }
    const Vector3 axis = shaft.axis.direction();
    const auto head = headward(levels, shaft.axis);
    // Without a head the side says where it was.
    if (!head && (!options.side || !options.axis))
        return noSolution("CT", "no head of the femur: nothing farther than 30 mm from the shaft's axis",
                          "a femur with its neck, or its side and an axis", "give --side and --axis-mm");
    const Vector3 toward = head ? *head : *options.side == Side::left ? Vector3(-u) : u;
    shaft.medial = (toward - toward.dot(axis) * axis).normalized();
    shaft.side = shaft.medial.x() < 0 ? Side::left : Side::right;
    if (options.side && *options.side != shaft.side)
        return invalidInput("CT",
                            fmt::format("a {} femur (its head lies toward {}x)", name(shaft.side),
                                        shaft.side == Side::left ? "-" : "+"),
                            fmt::format("a {} one", name(*options.side)), "check --side");
    if (options.axis) return shaft;

    std::vector<double> edges;
    for (std::size_t l = 0; l <= last; ++l)
        edges.push_back(edgeToward(levels[l], shaft.axis, shaft.medial));
    const double shaft_edge = median(edges);
    for (std::size_t l = last + 1 - std::min<std::size_t>(last, 10); l < levels.size(); ++l) {
        if (edgeToward(levels[l], shaft.axis, shaft.medial) < options.neck_ratio * shaft_edge) continue;
        const double along = axis.dot(levels[l].plane.origin - shaft.axis.distal);
        shaft.axis.proximal = shaft.axis.distal + along * axis;
        return shaft;
    }
    return noSolution("CT", "no neck above the shaft", "a femur with its neck",
                      "give an axis whose proximal point is the resection's level (--axis-mm)");
}

}  // namespace fluorocut
