#include "app/cli/figures/template_figure.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "app/cli/figures/canvas.h"
#include "core/geometry/half_edge_mesh.h"
#include "core/geometry/mesh_section.h"

namespace fluorocut::cli {
namespace {

constexpr double kStep = 0.4;                  // mm per pixel of the slices
constexpr float kBlack = -200, kWhite = 1600;  // HU

// A slice in the frame `cavity`: from `origin` along unit vectors, mm.
struct Slice {
    Vector3 origin, right, down;
    double width, height;

    Vector3 at(double x, double y) const { return origin + x * right + y * down; }
};

class Panel {
  public:
    Panel(Canvas& canvas, const Vector2& corner, const Slice& slice)
        : canvas_(canvas), corner_(corner), slice_(slice) {}

    void picture(const Volume& ct, const Rigid3& femur_from_cavity) {
        Image image(static_cast<int>(slice_.width / kStep), static_cast<int>(slice_.height / kStep));
        for (int y = 0; y < image.height(); ++y)
            for (int x = 0; x < image.width(); ++x) {
                const Vector3 p = femur_from_cavity * slice_.at(kStep * x, kStep * y);
                const float hu = sampleLinear(ct, ct.grid().indexFromPoint(p), -1000);
                image(x, y) = std::clamp((hu - kBlack) / (kWhite - kBlack), 0.0F, 1.0F);
            }
        canvas_.picture(image, corner_, 1);
    }
    // Where the plane cuts a mesh.
    void section(const HalfEdgeMesh& mesh, const Rigid3& cavity_from_mesh, Color color) {
        const Rigid3 back = cavity_from_mesh.inverse();
        const Plane plane{back * slice_.origin, back.rotate(slice_.right.cross(slice_.down))};
        for (const std::vector<Vector3>& polygon : sectionPolygons(mesh, plane)) {
            std::vector<Vector2> line;
            for (std::size_t i = 0; i <= polygon.size(); ++i) {
                const Vector3 p = cavity_from_mesh * polygon[i % polygon.size()] - slice_.origin;
                const Vector2 q(p.dot(slice_.right), p.dot(slice_.down));
                const bool inside = q.x() >= 0 && q.y() >= 0 && q.x() <= slice_.width && q.y() <= slice_.height;
                if (inside) line.push_back(corner_ + q / kStep);
                if (!inside || i == polygon.size()) {
                    if (line.size() > 1) canvas_.curve(line, color);
                    line.clear();
                }
            }
        }
    }
    void label(const std::string& words) { canvas_.text(corner_ + Vector2(4, 14), words, 11, kYellow); }

  private:
    Canvas& canvas_;
    Vector2 corner_;
    Slice slice_;
};

}  // namespace

Result<ColorImage> templateFigure(const Volume& ct, const BoneWalls& walls, const Implant& implant,
                                  const Rigid3& femur_from_cavity) {
    const auto stem = HalfEdgeMesh::build(implant.parts.front().mesh, "stem");
    if (!stem) return stem.error();
    const auto canal = HalfEdgeMesh::build(walls.canal, "canal");
    if (!canal) return canal.error();
    const auto outer = HalfEdgeMesh::build(walls.outer, "outer wall");
    if (!outer) return outer.error();
    const double top = implant.resection_z_mm, length = implant.stem_length_mm;
    const double width = 100, height = length + 70;
    std::vector<std::pair<Slice, std::string>> slices{
        {{Vector3(-50, 0, top + 50), Vector3::UnitX(), -Vector3::UnitZ(), width, height}, "medial right"},
        {{Vector3(0, -50, top + 50), Vector3::UnitY(), -Vector3::UnitZ(), width, height},
         implant.side == Side::left ? "anterior right" : "posterior right"}};
    for (const double part : {0.1, 0.45, 0.85})
        slices.push_back(
            {{Vector3(-30, 30, top - part * length), Vector3::UnitX(), -Vector3::UnitY(), 60, height / 3 - 1},
             fmt::format("{:.0f} mm below", part * length)});
    const Rigid3 cavity_from_femur = femur_from_cavity.inverse();
    const double gap = 4;
    Canvas canvas(static_cast<int>(2 * (width / kStep + gap) + 60 / kStep), static_cast<int>(height / kStep));
    for (std::size_t n = 0; n < slices.size(); ++n) {
        const auto& [slice, words] = slices[n];
        const Vector2 corner =
            n < 2 ? Vector2(static_cast<double>(n) * (width / kStep + gap), 0)
                  : Vector2(2 * (width / kStep + gap), static_cast<double>(n - 2) * height / 3 / kStep);
        Panel panel(canvas, corner, slice);
        panel.picture(ct, femur_from_cavity);
        panel.section(*outer, cavity_from_femur, kGreen);
        panel.section(*canal, cavity_from_femur, kSkyBlue);
        panel.section(*stem, {}, kVermilion);
        panel.label(words);
    }
    return canvas.image();
}

}  // namespace fluorocut::cli
