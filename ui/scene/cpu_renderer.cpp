// The renderer without OpenGL: a z-buffer.
#include <QPainter>
#include <algorithm>
#include <array>
#include <cmath>

#include "ui/scene/scene_renderer.h"
#include "ui/scene/shading.h"

namespace fluorocut::ui {
namespace {

constexpr float kFar = 2;  // deeper than everything, in units of the far plane

constexpr float kEdge = -1e-5F;  // a weight of nearly zero is on the edge, whatever rounding made of it: no cracks

// A vertex on its way to the screen. Depth is 1 - near / z: linear on the screen along lines, 0 at the near plane.
struct Corner {
    float x = 0, y = 0, depth = 0;
    float inverse_z = 0;
    float toward = 0;  // the normal's part toward the viewer
    float u = 0, v = 0;
};

// The same before perspective: right, up, in front.
struct Seen {
    std::array<float, 3> p{};
    float toward = 0;
    float u = 0, v = 0;
};

Seen between(const Seen& a, const Seen& b, float t) {
    Seen seen;
    for (std::size_t i = 0; i < 3; ++i)
        seen.p[i] = a.p[i] + t * (b.p[i] - a.p[i]);
    seen.toward = a.toward + t * (b.toward - a.toward);
    seen.u = a.u + t * (b.u - a.u);
    seen.v = a.v + t * (b.v - a.v);
    return seen;
}

struct Color {
    float red = 0, green = 0, blue = 0, alpha = 1;
};

QRgb over(const Color& color, QRgb behind) {
    const auto mix = [&](float front, int back) {
        return static_cast<int>(color.alpha * std::min(255.0F, front) + (1 - color.alpha) * static_cast<float>(back) +
                                0.5F);
    };
    return qRgb(mix(color.red, qRed(behind)), mix(color.green, qGreen(behind)), mix(color.blue, qBlue(behind)));
}

// What one item looks like where it is nearest.
class Look {
  public:
    explicit Look(const SceneItem& item)
        : color_{static_cast<float>(item.color.red()), static_cast<float>(item.color.green()),
                 static_cast<float>(item.color.blue()), 1},
          face_(static_cast<float>(item.opacity)),
          rim_(static_cast<float>(item.rim_opacity)),
          shine_(static_cast<float>(255 * item.shine)),
          ambient_(static_cast<float>(item.ambient)),
          picture_(item.picture ? &item.picture->image : nullptr),
          lines_(!item.surface) {}

    Color at(float toward, float u, float v) const {
        if (picture_) return pictured(u, v);
        if (lines_) return {color_.red, color_.green, color_.blue, face_};
        const float n = std::min(1.0F, std::abs(toward));
        const float bright = ambient_ + (1 - ambient_) * n;
        const float shine = shine_ > 0 ? shine_ * std::pow(n, static_cast<float>(kShininess)) : 0;
        return {color_.red * bright + shine, color_.green * bright + shine, color_.blue * bright + shine,
                rim_ + n * (face_ - rim_)};
    }

  private:
    Color pictured(float u, float v) const {
        const int width = picture_->width(), height = picture_->height();
        const float x = std::clamp(u * static_cast<float>(width) - 0.5F, 0.0F, static_cast<float>(width - 1));
        const float y = std::clamp(v * static_cast<float>(height) - 0.5F, 0.0F, static_cast<float>(height - 1));
        const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
        const int x1 = std::min(x0 + 1, width - 1), y1 = std::min(y0 + 1, height - 1);
        const float right = x - static_cast<float>(x0), down = y - static_cast<float>(y0);
        const auto* upper = reinterpret_cast<const QRgb*>(picture_->constScanLine(y0));
        const auto* lower = reinterpret_cast<const QRgb*>(picture_->constScanLine(y1));
        const auto mix = [&](int (*part)(QRgb)) {
            const auto of = [&](QRgb pixel) { return static_cast<float>(part(pixel)); };
            return (1 - down) * ((1 - right) * of(upper[x0]) + right * of(upper[x1])) +
                   down * ((1 - right) * of(lower[x0]) + right * of(lower[x1]));
        };
        return {mix(qRed), mix(qGreen), mix(qBlue), face_};
    }

    Color color_;
    float face_, rim_, shine_, ambient_;
    const QImage* picture_;
    bool lines_;
};

class CpuRenderer : public SceneRenderer {
  public:
    bool usesOpenGL() const override { return false; }

    QImage render(const std::vector<SceneItem>& items, const SceneCamera& camera, const QSize& size) override {
        if (size.isEmpty()) return {};
        width_ = size.width();
        height_ = size.height();
        focal_ = static_cast<float>(camera.focalLengthPx(size));
        const SceneCamera::Depths depths = camera.depths(ballAround(items));
        near_ = static_cast<float>(depths.near_mm);

        picture_ = QImage(size, QImage::Format_RGB32);
        QPainter painter(&picture_);
        QLinearGradient gradient(0, 0, 0, height_);
        gradient.setColorAt(0, kSceneAbove);
        gradient.setColorAt(1, kSceneBelow);
        painter.fillRect(picture_.rect(), gradient);
        painter.end();
        pixels_ = reinterpret_cast<QRgb*>(picture_.bits());  // 32 bits a pixel: rows follow each other
        depth_.assign(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), kFar);

        for (const SceneItem& item : items)
            if (item.isOpaque()) draw(item, camera);
        for (const SceneItem& item : items)
            if (!item.isOpaque()) drawTranslucent(item, camera);
        return std::move(picture_);
    }

  private:
    // Its nearest layer on a sheet of its own, which is then laid over the picture.
    void drawTranslucent(const SceneItem& item, const SceneCamera& camera) {
        layer_.assign(depth_.size(), {});
        to_layer_ = true;
        draw(item, camera);
        to_layer_ = false;
        for (std::size_t i = 0; i < layer_.size(); ++i)
            if (layer_[i].drawn) pixels_[i] = over(layer_[i].color, pixels_[i]);
    }

    void draw(const SceneItem& item, const SceneCamera& camera) {
        const Look look(item);
        // item -> right, up, in front of the viewer
        Matrix3 axes;
        axes << camera.right().transpose(), camera.up().transpose(), -camera.towardViewer().transpose();
        const Matrix3 turn = axes * item.femur_from_item.rotationMatrix();
        const Vector3 move = axes * (item.femur_from_item.translation() - camera.position());
        if (item.surface) drawSurface(item, turn, move, look);
        if (item.lines) drawLines(item, turn, move, look);
    }

    void drawSurface(const SceneItem& item, const Matrix3& turn, const Vector3& move, const Look& look) {
        const ShadedMesh& mesh = *item.surface;
        seen_.resize(mesh.vertices.size());
        corners_.resize(mesh.vertices.size());
        for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
            const Vector3 p = turn * mesh.vertices[i] + move;
            Seen& seen = seen_[i];
            seen.p = {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
            seen.toward = static_cast<float>(-turn.row(2).dot(mesh.normals[i]));
            if (item.picture) {
                seen.u = static_cast<float>(item.picture->places[i].x());
                seen.v = static_cast<float>(item.picture->places[i].y());
            }
            if (seen.p[2] >= near_) corners_[i] = projected(seen);
        }
        for (const Triangle& triangle : mesh.triangles) {
            const auto at = [&](std::size_t i) { return static_cast<std::size_t>(triangle[i]); };
            const bool whole = seen_[at(0)].p[2] >= near_ && seen_[at(1)].p[2] >= near_ && seen_[at(2)].p[2] >= near_;
            if (whole) {
                fill(corners_[at(0)], corners_[at(1)], corners_[at(2)], item.one_sided, look);
            } else {
                fillClipped({seen_[at(0)], seen_[at(1)], seen_[at(2)]}, item.one_sided, look);
            }
        }
    }

    // The part of a triangle beyond the near plane.
    void fillClipped(const std::array<Seen, 3>& triangle, bool one_sided, const Look& look) {
        std::array<Corner, 4> corners;
        std::size_t count = 0;
        for (std::size_t i = 0; i < 3; ++i) {
            const Seen &a = triangle[i], &b = triangle[(i + 1) % 3];
            const bool a_beyond = a.p[2] >= near_, b_beyond = b.p[2] >= near_;
            if (a_beyond) corners[count++] = projected(a);
            if (a_beyond != b_beyond) corners[count++] = projected(between(a, b, (near_ - a.p[2]) / (b.p[2] - a.p[2])));
        }
        for (std::size_t i = 2; i < count; ++i)
            fill(corners[0], corners[i - 1], corners[i], one_sided, look);
    }

    Corner projected(const Seen& seen) const {
        Corner corner;
        corner.inverse_z = 1 / std::max(seen.p[2], 0.999F * near_);
        corner.x = 0.5F * static_cast<float>(width_) + focal_ * seen.p[0] * corner.inverse_z;
        corner.y = 0.5F * static_cast<float>(height_) - focal_ * seen.p[1] * corner.inverse_z;
        corner.depth = 1 - near_ * corner.inverse_z;
        corner.toward = seen.toward;
        corner.u = seen.u * corner.inverse_z;
        corner.v = seen.v * corner.inverse_z;
        return corner;
    }

    void fill(const Corner& a, const Corner& b, const Corner& c, bool one_sided, const Look& look) {
        // Twice its area; negative when counter-clockwise on the screen, whose y runs down: the front.
        const float area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
        if (area == 0 || (one_sided && area > 0) || !std::isfinite(area)) return;
        const int left = firstCenter(std::min({a.x, b.x, c.x})), right = lastCenter(std::max({a.x, b.x, c.x}), width_);
        const int top = firstCenter(std::min({a.y, b.y, c.y})), bottom = lastCenter(std::max({a.y, b.y, c.y}), height_);
        const float inverse = 1 / area;
        // Weights of the corners, which are linear on the screen.
        const float step_b = (c.y - a.y) * inverse, step_c = (a.y - b.y) * inverse;
        for (int y = top; y <= bottom; ++y) {
            const float py = static_cast<float>(y) + 0.5F, px = static_cast<float>(left) + 0.5F;
            float wb = ((px - a.x) * (c.y - a.y) - (c.x - a.x) * (py - a.y)) * inverse;
            float wc = ((b.x - a.x) * (py - a.y) - (px - a.x) * (b.y - a.y)) * inverse;
            std::size_t at =
                static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(left);
            for (int x = left; x <= right; ++x, ++at, wb += step_b, wc += step_c) {
                const float wa = 1 - wb - wc;
                if (wa < kEdge || wb < kEdge || wc < kEdge) continue;
                const float depth = wa * a.depth + wb * b.depth + wc * c.depth;
                if (!(depth < depth_[at])) continue;
                const float z = 1 / (wa * a.inverse_z + wb * b.inverse_z + wc * c.inverse_z);
                const float u = (wa * a.u + wb * b.u + wc * c.u) * z, v = (wa * a.v + wb * b.v + wc * c.v) * z;
                put(at, depth, look.at(wa * a.toward + wb * b.toward + wc * c.toward, u, v));
            }
        }
    }

    void drawLines(const SceneItem& item, const Matrix3& turn, const Vector3& move, const Look& look) {
        const int breadth = std::max(1, static_cast<int>(std::lround(item.width_px)));
        for (const auto& line : *item.lines) {
            for (std::size_t i = 1; i < line.size(); ++i) {
                const auto seen = [&](const Vector3& point) {
                    const Vector3 p = turn * point + move;
                    Seen s;
                    s.p = {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
                    return s;
                };
                Seen a = seen(line[i - 1]), b = seen(line[i]);
                if (a.p[2] < near_ && b.p[2] < near_) continue;
                const float t = (near_ - a.p[2]) / (b.p[2] - a.p[2]);
                if (a.p[2] < near_) {
                    a = between(a, b, t);
                } else if (b.p[2] < near_) {
                    b = between(a, b, t);
                }
                drawSegment(projected(a), projected(b), breadth, look);
            }
        }
    }

    void drawSegment(Corner a, Corner b, int breadth, const Look& look) {
        const bool flat = std::abs(b.x - a.x) >= std::abs(b.y - a.y);
        // Along the longer side, pixel by pixel.
        const auto along = [&](const Corner& c) { return flat ? c.x : c.y; };
        const auto across = [&](const Corner& c) { return flat ? c.y : c.x; };
        if (along(a) > along(b)) std::swap(a, b);
        const int first = firstCenter(along(a)), last = lastCenter(along(b), flat ? width_ : height_);
        const float length = along(b) - along(a);
        for (int i = first; i <= last; ++i) {
            const float t = length > 0 ? (static_cast<float>(i) + 0.5F - along(a)) / length : 0;
            const float middle = across(a) + t * (across(b) - across(a));
            const float depth = a.depth + t * (b.depth - a.depth);
            if (!(std::abs(middle) < 1e6F)) continue;
            const int start = static_cast<int>(std::floor(middle - 0.5F * static_cast<float>(breadth - 1)));
            for (int j = start; j < start + breadth; ++j) {
                const int x = flat ? i : j, y = flat ? j : i;
                if (x < 0 || y < 0 || x >= width_ || y >= height_) continue;
                const std::size_t at =
                    static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
                if (depth < depth_[at]) put(at, depth, look.at(1, 0, 0));
            }
        }
    }

    // Pixels whose centres lie between two places.
    static int firstCenter(float low) { return static_cast<int>(std::ceil(std::clamp(low - 0.5F, 0.0F, 1e6F))); }
    static int lastCenter(float high, int count) {
        return static_cast<int>(std::floor(std::clamp(high - 0.5F, -1.0F, static_cast<float>(count - 1))));
    }

    void put(std::size_t at, float depth, const Color& color) {
        depth_[at] = depth;
        if (to_layer_) {
            layer_[at] = {color, true};
        } else {
            pixels_[at] = over(color, pixels_[at]);
        }
    }

    struct LayerPixel {
        Color color;
        bool drawn = false;
    };

    int width_ = 0, height_ = 0;
    float focal_ = 1, near_ = 1;
    QImage picture_;
    QRgb* pixels_ = nullptr;
    std::vector<float> depth_;
    std::vector<LayerPixel> layer_;
    bool to_layer_ = false;
    std::vector<Seen> seen_;
    std::vector<Corner> corners_;
};

}  // namespace

std::unique_ptr<SceneRenderer> makeCpuRenderer() {
    return std::make_unique<CpuRenderer>();
}

}  // namespace fluorocut::ui
