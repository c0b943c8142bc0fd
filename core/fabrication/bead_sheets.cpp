#include "core/fabrication/bead_sheets.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "core/geometry/polygon.h"

namespace fluorocut {
namespace {

constexpr std::size_t kMostPlanes = 8, kMostBeads = 400;
constexpr double kSamePlaneMm = 1e-3;
constexpr double kThinnestMm = 8, kUnderHoleMm = 1.5;  // of a sheet, and of what is left under a hole
constexpr double kMarginMm = 20, kPostInsetMm = 8, kWallMm = 1;
constexpr int kSegments = 48;
constexpr double kRowMm = 5.5;

// Columns of text under headings, filled from the top, as many side by side as it takes.
struct Table {
    std::vector<std::string> headings;
    std::vector<double> widths;
    std::vector<std::vector<std::string>> rows;

    double width() const {
        double sum = 0;
        for (const double w : widths)
            sum += w;
        return sum;
    }
    std::size_t rowsIn(double height) const { return static_cast<std::size_t>(std::max(height / kRowMm - 1, 1.0)); }
    double widthIn(double height) const {
        const std::size_t blocks = (rows.size() + rowsIn(height) - 1) / rowsIn(height);
        return static_cast<double>(std::max<std::size_t>(blocks, 1)) * (width() + 6);
    }
    void draw(Drawing& drawing, const Vector2& top_left, double height) const {
        const std::size_t fit = rowsIn(height);
        for (std::size_t first = 0; first < std::max<std::size_t>(rows.size(), 1); first += fit) {
            const double left = top_left.x() + static_cast<double>(first / fit) * (width() + 6);
            const std::size_t count = std::min(fit, rows.size() - first);
            for (std::size_t r = 0; r <= count; ++r) {
                const double base = top_left.y() - static_cast<double>(r + 1) * kRowMm;
                drawing.line({left, base}, {left + width(), base}, r == 0 ? Pen::outline : Pen::thin);
                double x = left;
                for (std::size_t c = 0; c < widths.size(); ++c) {
                    const std::string& words = r == 0 ? headings[c] : rows[first + r - 1][c];
                    drawing.text({x + widths[c] - 2, base + 1.6}, words, Align::right, 2.8);
                    x += widths[c];
                }
            }
        }
    }
};

// As much of a text as fits into a column.
std::string fitted(const std::string& text, double width) {
    std::string shown = text;
    while (!shown.empty() && Drawing::textWidth(shown, 2.8) > width - 4) {
        do {
            shown.pop_back();
        } while (!shown.empty() && (shown.back() & 0xC0) == 0x80);
    }
    return shown;
}

std::string inMicrons(double mm) {
    return fmt::format("{:.3f}", mm);
}

}  // namespace

Result<std::vector<BeadSheet>> beadSheets(const BeadLayout& layout) {
    if (const Result<void> good = layout.validate(); !good) return good.error();
    std::vector<Bead> sorted = layout.beads;
    std::stable_sort(sorted.begin(), sorted.end(),
                     [](const Bead& a, const Bead& b) { return a.center_mm.z() < b.center_mm.z(); });
    double largest = 0;
    Vector2 low = sorted[0].center_mm.head<2>(), high = low;
    for (const Bead& bead : sorted) {
        largest = std::max(largest, bead.diameter_mm);
        low = low.cwiseMin(bead.center_mm.head<2>());
        high = high.cwiseMax(bead.center_mm.head<2>());
    }
    const double margin = kMarginMm + largest;
    const double thickness = std::max(kThinnestMm, std::ceil(largest + 2 * kUnderHoleMm));
    std::vector<BeadSheet> sheets;
    for (const Bead& bead : sorted) {
        if (sheets.empty() || bead.center_mm.z() - sheets.back().plane_mm > kSamePlaneMm) {
            if (sheets.size() == kMostPlanes) {
                return invalidInput("beads", fmt::format("beads in more than {} planes of z", kMostPlanes),
                                    "beads in a few planes parallel to the frame's xy plane");
            }
            if (!sheets.empty() && bead.center_mm.z() - sheets.back().plane_mm < thickness + kWallMm) {
                return invalidInput(
                    "beads", fmt::format("planes at z = {:g} and {:g} mm", sheets.back().plane_mm, bead.center_mm.z()),
                    fmt::format("planes at least {:g} mm apart, for sheets of {:g} mm", thickness + kWallMm,
                                thickness));
            }
            BeadSheet sheet;
            sheet.plane_mm = bead.center_mm.z();
            sheet.thickness_mm = thickness;
            sheet.low = low - Vector2::Constant(margin);
            sheet.high = high + Vector2::Constant(margin);
            const Vector2 inset = Vector2::Constant(kPostInsetMm);
            const Vector2 a = sheet.low + inset, b = sheet.high - inset;
            sheet.posts = {a, {b.x(), a.y()}, b, {a.x(), b.y()}};
            sheets.push_back(sheet);
        }
        BeadSheet& sheet = sheets.back();
        if (sheet.beads.size() == kMostBeads) {
            return invalidInput("beads", fmt::format("more than {} beads in one plane", kMostBeads),
                                fmt::format("at most {}", kMostBeads));
        }
        for (const Bead& other : sheet.beads) {
            const double apart = (other.center_mm - bead.center_mm).head<2>().norm();
            const double least = 0.5 * (other.diameter_mm + bead.diameter_mm) + kHoleFitMm + kWallMm;
            if (!(apart >= least)) {
                return invalidInput(fmt::format("beads \"{}\" and \"{}\"", other.name, bead.name),
                                    fmt::format("holes {:.3g} mm apart", apart),
                                    fmt::format("at least {:.3g} mm, for a wall of {:g} mm", least, kWallMm));
            }
        }
        sheet.beads.push_back(bead);
    }
    return sheets;
}

Result<TriangleMesh> sheetSolid(const BeadSheet& sheet) {
    TriangleMesh mesh;
    const double top = sheet.plane_mm + 0.5 * sheet.thickness_mm, bottom = top - sheet.thickness_mm;
    const auto add = [&](const Vector2& p, double z) {
        mesh.vertices.emplace_back(p.x(), p.y(), z);
        return static_cast<std::int32_t>(mesh.vertices.size() - 1);
    };
    using Ring = std::vector<std::int32_t>;
    // Counter-clockwise, its area that of the circle. The first corner is off the axes, so that no two corners of holes
    // in a row are at one level.
    const double stretch = std::sqrt(2 * std::numbers::pi / (kSegments * std::sin(2 * std::numbers::pi / kSegments)));
    const auto ring = [&](const Vector2& center, double radius, double z) {
        Ring corners;
        for (int n = 0; n < kSegments; ++n) {
            const double angle = 0.02 + 2 * std::numbers::pi * n / kSegments;
            corners.push_back(add(center + stretch * radius * Vector2(std::cos(angle), std::sin(angle)), z));
        }
        return corners;
    };
    // Between a lower and an upper ring, seen from outside of a body (`inward`: from inside of a hole).
    const auto wall = [&](const Ring& lower, const Ring& upper, bool inward) {
        for (std::size_t n = 0; n < lower.size(); ++n) {
            const std::size_t next = (n + 1) % lower.size();
            if (inward) {
                mesh.triangles.push_back({lower[n], upper[next], lower[next]});
                mesh.triangles.push_back({lower[n], upper[n], upper[next]});
            } else {
                mesh.triangles.push_back({lower[n], lower[next], upper[next]});
                mesh.triangles.push_back({lower[n], upper[next], upper[n]});
            }
        }
    };
    const Vector2 corners[] = {sheet.low, {sheet.high.x(), sheet.low.y()}, sheet.high, {sheet.low.x(), sheet.high.y()}};
    Ring outer_top, outer_bottom;
    for (const Vector2& corner : corners) {
        outer_top.push_back(add(corner, top));
        outer_bottom.push_back(add(corner, bottom));
    }
    wall(outer_bottom, outer_top, false);
    std::vector<Ring> top_holes, bottom_holes;
    const auto clockwise = [](Ring corners_of_hole) {
        std::reverse(corners_of_hole.begin(), corners_of_hole.end());
        return corners_of_hole;
    };
    for (const Bead& bead : sheet.beads) {
        const Vector2 center = bead.center_mm.head<2>();
        const double radius = 0.5 * (bead.diameter_mm + kHoleFitMm), floor = top - sheet.holeDepth(bead);
        const Ring upper = ring(center, radius, top), lower = ring(center, radius, floor);
        wall(lower, upper, true);
        for (std::size_t n = 1; n + 1 < lower.size(); ++n)
            mesh.triangles.push_back({lower[0], lower[n], lower[n + 1]});
        top_holes.push_back(clockwise(upper));
    }
    for (const Vector2& post : sheet.posts) {
        const Ring upper = ring(post, 0.5 * kPostHoleMm, top), lower = ring(post, 0.5 * kPostHoleMm, bottom);
        wall(lower, upper, true);
        top_holes.push_back(clockwise(upper));
        bottom_holes.push_back(clockwise(lower));
    }
    std::vector<Vector2> flat;
    flat.reserve(mesh.vertices.size());
    for (const Vector3& v : mesh.vertices)
        flat.emplace_back(v.x(), v.y());
    const auto upper_face = triangulate(flat, outer_top, top_holes);
    if (!upper_face) return upper_face.error();
    const auto lower_face = triangulate(flat, outer_bottom, bottom_holes);
    if (!lower_face) return lower_face.error();
    mesh.triangles.insert(mesh.triangles.end(), upper_face->begin(), upper_face->end());
    for (const Triangle& t : *lower_face)
        mesh.triangles.push_back({t[0], t[2], t[1]});
    return mesh;
}

Drawing drawSheet(const BeadSheet& sheet, int number, int count) {
    constexpr double kLeftMm = 34, kAboveMm = 22, kBelowMm = 34, kGapMm = 25, kDetail = 4;
    const Vector2 size = sheet.high - sheet.low;
    Table table{{"No.", "x", "y", "\xE2\x8C\x80", "depth", "bead"}, {12, 20, 20, 16, 18, 26}, {}};
    for (std::size_t n = 0; n < sheet.beads.size(); ++n) {
        const Bead& bead = sheet.beads[n];
        const Vector2 from_datum = bead.center_mm.head<2>() - sheet.low;
        table.rows.push_back({std::to_string(n + 1), inMicrons(from_datum.x()), inMicrons(from_datum.y()),
                              millimetres(bead.diameter_mm + kHoleFitMm), millimetres(sheet.holeDepth(bead)),
                              fitted(bead.name, 26)});
    }
    for (std::size_t n = 0; n < sheet.posts.size(); ++n) {
        const Vector2 from_datum = sheet.posts[n] - sheet.low;
        table.rows.push_back({fmt::format("P{}", n + 1), inMicrons(from_datum.x()), inMicrons(from_datum.y()),
                              millimetres(kPostHoleMm), "through", "post"});
    }
    const double notes = 6 * Drawing::kNoteMm + Drawing::kTitleHeightMm;
    const double column = std::max(size.x(), 60.0);
    const double below_section = 40 + kDetail * sheet.thickness_mm;  // where the table begins
    const double height = std::max(kAboveMm + size.y() + kBelowMm, notes + below_section + 40);
    Drawing drawing([&](double inner_height) {
        const double table_height = std::max(height, inner_height) - notes - below_section;
        return Vector2(kLeftMm + column + kGapMm + std::max(table.widthIn(table_height), Drawing::kTitleWidthMm),
                       height);
    });
    const double ceiling = drawing.size().y() - Drawing::kBorderMm;
    const Vector2 low(Drawing::kBorderMm + kLeftMm, ceiling - kAboveMm - size.y()), high = low + size;
    const auto onPaper = [&](const Vector2& p) { return Vector2(low + p - sheet.low); };
    drawing.text({low.x(), ceiling - 8}, "VIEW FROM THE DRILLED SIDE (+z), 1:1", Align::left, 4);
    drawing.rectangle(low, high);
    for (std::size_t n = 0; n < sheet.beads.size(); ++n) {
        const Bead& bead = sheet.beads[n];
        const Vector2 center = onPaper(bead.center_mm.head<2>());
        const double radius = 0.5 * (bead.diameter_mm + kHoleFitMm);
        drawing.circle(center, radius);
        drawing.centerMark(center, radius + 1.2);
        drawing.text(center + Vector2(0.8 * radius + 0.5, 0.8 * radius + 0.5), std::to_string(n + 1), Align::left, 2.5);
    }
    for (std::size_t n = 0; n < sheet.posts.size(); ++n) {
        const Vector2 center = onPaper(sheet.posts[n]);
        drawing.circle(center, 0.5 * kPostHoleMm);
        drawing.centerMark(center, 0.5 * kPostHoleMm + 1.5);
        drawing.text(center + Vector2(2.6, 2.6), fmt::format("P{}", n + 1), Align::left, 2.5);
    }
    const Vector2 first_post = onPaper(sheet.posts[0]), last_post = onPaper(sheet.posts[2]);
    drawing.dimensionX(low, {high.x(), low.y()}, low.y() - 24, millimetres(size.x()));
    drawing.dimensionY(low, {low.x(), high.y()}, low.x() - 24, millimetres(size.y()));
    drawing.dimensionX(first_post, {last_post.x(), first_post.y()}, low.y() - 13,
                       millimetres(last_post.x() - first_post.x()));
    drawing.dimensionY(first_post, {first_post.x(), last_post.y()}, low.x() - 13,
                       millimetres(last_post.y() - first_post.y()));
    drawing.text(low + Vector2(-7, -7), "A", Align::middle, 4);

    // Section of the first hole.
    const double right = low.x() + column + kGapMm;
    const Bead& bead = sheet.beads[0];
    const double width = bead.diameter_mm + kHoleFitMm, half = 0.5 * width * kDetail, t = sheet.thickness_mm * kDetail;
    drawing.text({right, ceiling - 8}, fmt::format("SECTION OF HOLE 1 WITH ITS BEAD, {:g}:1", kDetail), Align::left, 4);
    const Vector2 at(right + 25 + half, ceiling - 28 - t);  // below the hole's middle, at the sheet's -z face
    const double reach = half + 14, floor = t - kDetail * sheet.holeDepth(bead);
    drawing.polyline({at + Vector2(-reach, t), at + Vector2(-half, t), at + Vector2(-half, floor),
                      at + Vector2(half, floor), at + Vector2(half, t), at + Vector2(reach, t)},
                     false);
    drawing.line(at + Vector2(-reach, 0), at + Vector2(reach, 0));
    drawing.line(at + Vector2(-reach, 0), at + Vector2(-reach, t), Pen::thin);
    drawing.line(at + Vector2(reach, 0), at + Vector2(reach, t), Pen::thin);
    drawing.circle(at + Vector2(0, 0.5 * t), 0.5 * kDetail * bead.diameter_mm, Pen::hidden);
    drawing.centerMark(at + Vector2(0, 0.5 * t), 0.5 * kDetail * bead.diameter_mm + 2);
    drawing.dimensionX(at + Vector2(-half, t), at + Vector2(half, t), at.y() + t + 9,
                       "\xE2\x8C\x80" + millimetres(width));
    drawing.dimensionY(at + Vector2(half, floor), at + Vector2(reach, t), at.x() + reach + 10,
                       millimetres(sheet.holeDepth(bead)));
    drawing.dimensionY(at + Vector2(reach, 0), at + Vector2(reach, t), at.x() + reach + 22,
                       millimetres(sheet.thickness_mm));
    drawing.dimensionY(at + Vector2(-reach, 0), at + Vector2(0, 0.5 * t), at.x() - reach - 10,
                       millimetres(0.5 * sheet.thickness_mm));
    const double table_top = ceiling - below_section;
    table.draw(drawing, {right, table_top}, table_top - Drawing::kBorderMm - notes);
    drawing.frame(
        {fmt::format("Bead phantom, sheet {} of {}: plane z = {}", number, count, millimetres(sheet.plane_mm)),
         fmt::format("1:1, section {:g}:1", kDetail),
         "acrylic (PMMA), cast, " + millimetres(sheet.thickness_mm) + " thick",
         "ISO 2768-m; place of every hole \xC2\xB1"
         "0.02 from datum A, depth \xC2\xB1"
         "0.05",
         {"Datum: corner A and the two edges that meet there; x to the right, y up.",
          fmt::format("{} blind holes as in the table, flat bottomed, drilled from the side shown.",
                      sheet.beads.size()),
          "Beads of hardened steel (bearing balls) touch the bottom; fix with a drop of clear glue.",
          fmt::format("4 through holes {}{} for posts M5 of polyamide.", "\xE2\x8C\x80", millimetres(kPostHoleMm)),
          "Measure the beads' places afterwards and correct the JSON: it is what calibration uses."}});
    return drawing;
}

Drawing drawAssembly(const BeadLayout& layout, const std::vector<BeadSheet>& sheets) {
    constexpr double kLeftMm = 22, kAboveMm = 26, kBelowMm = 34, kGapMm = 70;
    Table table{{"bead", "x", "y", "z", "\xE2\x8C\x80"}, {30, 24, 24, 24, 16}, {}};
    for (const BeadSheet& sheet : sheets)
        for (const Bead& bead : sheet.beads)
            table.rows.push_back({fitted(bead.name, 30), inMicrons(bead.center_mm.x()), inMicrons(bead.center_mm.y()),
                                  inMicrons(bead.center_mm.z()), millimetres(bead.diameter_mm)});
    const BeadSheet &first = sheets.front(), &last = sheets.back();
    const double width = first.high.x() - first.low.x();
    const double bottom = first.plane_mm - 0.5 * first.thickness_mm;
    const double tall = last.plane_mm + 0.5 * last.thickness_mm - bottom;
    const double notes = 4 * Drawing::kNoteMm + Drawing::kTitleHeightMm;
    const double height = std::max(kAboveMm + tall + kBelowMm, notes + 110);
    Drawing drawing([&](double inner_height) {
        const double table_height = std::max(height, inner_height) - notes - 12;
        return Vector2(kLeftMm + width + kGapMm + std::max(table.widthIn(table_height), Drawing::kTitleWidthMm),
                       height);
    });
    const double ceiling = drawing.size().y() - Drawing::kBorderMm;
    const Vector2 low(Drawing::kBorderMm + kLeftMm, ceiling - kAboveMm - tall);
    const auto onPaper = [&](double x, double z) { return Vector2(low + Vector2(x - first.low.x(), z - bottom)); };
    drawing.text({low.x(), ceiling - 8}, "ASSEMBLY, view along +y, 1:1", Align::left, 4);
    for (std::size_t n = 0; n < sheets.size(); ++n) {
        const BeadSheet& sheet = sheets[n];
        const double half = 0.5 * sheet.thickness_mm;
        drawing.rectangle(onPaper(sheet.low.x(), sheet.plane_mm - half),
                          onPaper(sheet.high.x(), sheet.plane_mm + half));
        for (const Bead& bead : sheet.beads)
            drawing.circle(onPaper(bead.center_mm.x(), bead.center_mm.z()), 0.5 * bead.diameter_mm, Pen::thin);
        drawing.text(onPaper(sheet.high.x(), sheet.plane_mm) + Vector2(3, 1), fmt::format("sheet {}", n + 1));
        if (n == 0) continue;
        const BeadSheet& under = sheets[n - 1];
        const double from = under.plane_mm + 0.5 * under.thickness_mm, to = sheet.plane_mm - half;
        for (const double post : {sheet.posts[0].x(), sheet.posts[1].x()})
            drawing.rectangle(onPaper(post - 5, from), onPaper(post + 5, to));
        const Vector2 right = onPaper(sheet.high.x(), 0);
        drawing.dimensionY(onPaper(sheet.high.x(), from), onPaper(sheet.high.x(), to), right.x() + 24,
                           millimetres(to - from));
        drawing.dimensionY(onPaper(sheet.high.x(), under.plane_mm), onPaper(sheet.high.x(), sheet.plane_mm),
                           right.x() + 38, millimetres(sheet.plane_mm - under.plane_mm));
    }
    drawing.dimensionX(low, {low.x() + width, low.y()}, low.y() - 12, millimetres(width));
    const double right = low.x() + width + kGapMm;
    drawing.text({right, ceiling - 8}, fmt::format("BEADS, frame {}", name(layout.frame)), Align::left, 4);
    table.draw(drawing, {right, ceiling - 12}, ceiling - 12 - Drawing::kBorderMm - notes);
    drawing.frame(
        {fmt::format("Bead phantom, assembly: {} beads in {} planes", layout.beads.size(), sheets.size()),
         "1:1",
         "sheets: acrylic; spacers and screws: polyamide; beads: steel",
         "length of spacers \xC2\xB1"
         "0.02, the four of a level alike within 0.01",
         {"Distances on the right: length of the spacers (10 outside, 5.3 inside), and between planes of bead centres.",
          "The drilled sides face +z. Screws M5 of polyamide go through all sheets and spacers.",
          "Corner A of each sheet above that of the next; edges flush within 0.02 (pin two corners)."}});
    return drawing;
}

}  // namespace fluorocut
