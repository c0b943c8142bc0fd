#include "core/fiducial/corkscrew_refinement/predicted_image.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/base/parallel.h"
#include "core/fiducial/corkscrew_refinement/row_kernels.h"

namespace fluorocut::corkscrew {
namespace {

constexpr double kSamplesPerWire = 8;  // across

}  // namespace

// A piece as the imager sees it.
struct CorkscrewPredictor::Placed {
    PieceInView view;
    Part part;
    bool in_rod;
    int group;
    float velocity[kMostOfGroup][3];
    // Of the region's pixels: where it may be seen, and the line of its axis.
    double left, right, top, bottom;
    Vector2 middle = Vector2::Zero(), along = Vector2::Zero();  // along: unit, when half_length is positive
    double half_width, half_length;

    // Columns [begin, end) of fine samples in the fine row at `y` px.
    void columns(double y, double half_row, int samples, int begin_limit, int end_limit, int& begin, int& end) const {
        double low = left, high = right;
        const auto within = [&](const Vector2& normal, double half) {  // |normal . (pixel - middle)| <= half
            if (std::abs(normal.x()) < 1e-3) return;
            const double at = middle.x() - (y - middle.y()) * normal.y() / normal.x();
            const double reach = (half + half_row * std::abs(normal.y())) / std::abs(normal.x());
            low = std::max(low, at - reach);
            high = std::min(high, at + reach);
        };
        if (half_length > 0) {
            within(Vector2(-along.y(), along.x()), half_width);
            within(along, half_length);
        }
        begin = std::max(begin_limit, static_cast<int>(std::floor((std::max(low, -1.0) + 0.5) * samples)));
        end = std::min(end_limit, static_cast<int>(std::ceil((std::min(high, 1e6) + 0.5) * samples)) + 1);
    }
};

CorkscrewPredictor::CorkscrewPredictor(const CArm& carm, const CorkscrewLayout& layout, const PixelRegion& region)
    : rays_(carm, region), solid_(layout), pixel_mm_(carm.pixel_mm) {
    attenuation_[wire] = attenuationPerMm(layout.wire);
    attenuation_[shaft] = attenuation_[beads] = attenuationPerMm(layout.shaft);
    attenuation_[rod] = attenuationPerMm(layout.rod);
    // A wire is seen at least this wide.
    double thinnest = layout.helix.wire_radius_mm;
    for (const CorkscrewRing& ring : layout.rings)
        thinnest = std::min(thinnest, ring.wire_radius_mm);
    samples_ = std::clamp(
        static_cast<int>(std::ceil(0.75 * kSamplesPerWire * carm.pixel_mm.maxCoeff() / (2 * thinnest))), 2, 4);
}

std::vector<CorkscrewPredictor::Placed> CorkscrewPredictor::place(const Rigid3& imager_from_corkscrew,
                                                                  const std::array<double, kParts>& attenuation,
                                                                  int samples) const {
    const Matrix3 rotation = imager_from_corkscrew.rotationMatrix();
    const Vector3 origin = imager_from_corkscrew.translation();
    const double focal = rays_.focal_length_mm(), pixel = pixel_mm_.mean();
    std::vector<Placed> placed;
    placed.reserve(solid_.pieces.size());
    for (const Piece& piece : solid_.pieces) {
        Placed out;
        const Vector3 a = rotation * piece.a, b = rotation * piece.b, center = 0.5 * (a + b) + origin;
        const double nearest = std::min(a.z(), b.z()) + origin.z() - piece.radius_mm;
        if (!(nearest > 1)) continue;  // at the source or behind it
        const Vector2 a_mm = focal * (a + origin).head<2>() / (a + origin).z();
        const Vector2 b_mm = focal * (b + origin).head<2>() / (b + origin).z();
        const double oblique = std::sqrt(1 + a_mm.squaredNorm() / (focal * focal));
        const double reach_px = piece.radius_mm * focal / nearest * oblique * oblique * 1.08 / pixel + 0.75;
        const Vector2 a_px = rays_.pixel(a_mm), b_px = rays_.pixel(b_mm);
        out.left = std::min(a_px.x(), b_px.x()) - reach_px;
        out.right = std::max(a_px.x(), b_px.x()) + reach_px;
        out.top = std::min(a_px.y(), b_px.y()) - reach_px;
        out.bottom = std::max(a_px.y(), b_px.y()) + reach_px;
        const PixelRegion& region = rays_.region();
        if (!(out.right >= -0.5 && out.left <= region.width && out.bottom >= -0.5 && out.top <= region.height))
            continue;
        out.middle = 0.5 * (a_px + b_px);
        const double seen_px = (b_px - a_px).norm();
        out.half_length = 0;
        out.half_width = reach_px + 0.03 * seen_px;
        if (!piece.sphere && seen_px > 0.5) {
            // Its ends are discs, seen the more open the more the piece is foreshortened.
            const double full_px = (b - a).norm() * focal / center.z() / pixel;
            const double open = std::sqrt(std::max(0.0, 1 - std::pow(seen_px / (1.05 * full_px), 2)));
            out.along = (b_px - a_px) / seen_px;
            out.half_length = 0.53 * seen_px + reach_px * open + 0.75;
        }
        out.part = piece.part;
        out.in_rod = piece.in_rod;
        out.group = piece.group;

        PieceInView& view = out.view;
        view.sphere = piece.sphere;
        view.inverse_focal = static_cast<float>(1 / focal);
        view.radius_squared = static_cast<float>(piece.radius_mm * piece.radius_mm);
        view.half_sample =
            static_cast<float>(0.5 * pixel * center.z() / focal / static_cast<double>(piece.part == rod ? 1 : samples));
        const Vector3 axis = piece.sphere ? Vector3(Vector3::UnitZ()) : Vector3((b - a).normalized());
        const Vector3 across = axis.unitOrthogonal(), other = axis.cross(across);
        const Vector3 normals[2] = {rotation * piece.normal_a, rotation * piece.normal_b};
        const double offsets[2] = {normals[0].dot(0.5 * (a - b)), normals[1].dot(0.5 * (b - a))};
        for (int i = 0; i < 3; ++i) {
            view.center[i] = static_cast<float>(center[i]);
            view.from_origin[i] = static_cast<float>(center[i] - origin[i]);
            view.a[i] = static_cast<float>(across[i]);
            view.b[i] = static_cast<float>(other[i]);
            for (int k = 0; k < 2; ++k)
                view.normal[k][i] = static_cast<float>(normals[k][i]);
        }
        const double own = attenuation[piece.part] - (piece.in_rod ? attenuation[rod] : 0);
        view.attenuation = static_cast<float>(std::max(own, 1e-3));
        view.flat[0] = piece.flat_a ? 1.0f : 0.0f;
        view.flat[1] = piece.flat_b ? 1.0f : 0.0f;
        for (int k = 0; k < 2; ++k)
            view.offset[k] = static_cast<float>(offsets[k]);
        for (int k = 0; k < kMostOfGroup; ++k) {
            const Vector3 moved = rotation * piece.velocity[static_cast<std::size_t>(k)];
            for (int i = 0; i < 3; ++i)
                out.velocity[k][i] = static_cast<float>(moved[i]);
        }
        placed.push_back(out);
    }
    return placed;
}

// Fine samples of a few rows of pixels, drawn piece by piece. The rod, which is wide and smooth, is drawn once a pixel.
class CorkscrewPredictor::Strip {
  public:
    Strip(const CorkscrewPredictor& predictor, int samples, int first_row, int rows, const std::vector<Placed>& placed)
        : memory_(memory()), predictor_(predictor), samples_(samples), first_row_(first_row), rows_(rows) {
        const double top = first_row - 0.5, bottom = first_row + rows - 0.5;
        double left = 1e9, right = -1e9;
        memory_.here.clear();
        for (const Placed& piece : placed) {
            if (!(piece.bottom >= top && piece.top <= bottom)) continue;
            memory_.here.push_back(&piece);
            left = std::min(left, piece.left);
            right = std::max(right, piece.right);
        }
        if (memory_.here.empty()) return;
        const int width = predictor.rays_.region().width;
        begin_ = std::clamp(static_cast<int>(std::floor(left)) - 1, 0, width);
        end_ = std::clamp(static_cast<int>(std::ceil(right)) + 2, begin_, width);
        // Whole vectors: rows of samples are a multiple of kRowStep, the last ones beyond the right border.
        fine_width_ = ((end_ - begin_) * samples_ + kRowStep - 1) / kRowStep * kRowStep;
        plane_size_ = static_cast<std::size_t>(fine_width_) * static_cast<std::size_t>(rows_ * samples_);
        if (!empty()) lookAlong();
    }

    bool empty() const { return begin_ >= end_; }
    std::array<int, 2> columns() const { return {begin_, end_}; }

    void draw(const std::array<double, kParts>& attenuation, bool with_forces) {
        memory_.lengths.assign(kParts * plane_size_, 0.0f);
        if (with_forces) memory_.forces.assign(kForces * plane_size_, 0.0f);
        memory_.nowhere.assign(static_cast<std::size_t>(fine_width_), 0.0f);
        float* const lengths_at = memory_.lengths.data();
        drawRod(lengths_at + rod * plane_size_);
        const RowKernels& kernels = rowKernels();
        for (const Placed* piece : memory_.here) {
            if (piece->part == rod) continue;
            const auto weight =
                static_cast<float>(-attenuation[piece->part] + (piece->in_rod ? attenuation[rod] : 0.0));
            forRows(*piece, [&](std::size_t at, int count) {
                float* length = lengths_at + piece->part * plane_size_ + at;
                float* displaced = piece->in_rod ? lengths_at + rod * plane_size_ + at : memory_.nowhere.data();
                const float *x = memory_.x.data() + at, *y = memory_.y.data() + at;
                if (!with_forces) {
                    kernels.lengths(piece->view, x, y, count, length, displaced);
                    return;
                }
                float* planes[kForces];
                for (std::size_t k = 0; k < kForces; ++k)
                    planes[k] = memory_.forces.data() + k * plane_size_ + at;
                kernels.forces(piece->view, x, y, count, weight, length, displaced, planes);
            });
        }
    }

    void expose(const std::array<double, kParts>& attenuation) {
        memory_.transmission.resize(plane_size_);
        float coefficients[kParts];
        const float* planes[kParts];
        for (std::size_t k = 0; k < kParts; ++k) {
            coefficients[k] = static_cast<float>(attenuation[k]);
            planes[k] = lengths(k);
        }
        rowKernels().transmission(planes, coefficients, kParts, static_cast<int>(plane_size_),
                                  memory_.transmission.data());
    }

    const float* lengths(std::size_t part) const { return memory_.lengths.data() + part * plane_size_; }
    const float* force(std::size_t k) const { return memory_.forces.data() + k * plane_size_; }
    const float* transmission() const { return memory_.transmission.data(); }

    // out(pixel) = scale * mean over its samples of plane * transmission (of plane alone: times_transmission false).
    void collect(const float* plane, float scale, bool times_transmission, const PixelRegion& box, Image& out) {
        const float share = scale / static_cast<float>(samples_ * samples_);
        const int left = std::max(begin_, box.x), right = std::min(end_, box.x + box.width);
        if (left >= right) return;
        std::vector<float>& sums = memory_.sums;
        const std::size_t width = static_cast<std::size_t>((right - left) * samples_);
        for (int row = 0; row < rows_; ++row) {
            const int y = first_row_ + row - box.y;
            if (y < 0 || y >= box.height) continue;
            float* const target = out.row(y) + (left - box.x);
            if (samples_ == 1) {
                const float* values = plane + fine(left, row);
                const float* through = memory_.transmission.data() + fine(left, row);
                for (std::size_t i = 0; i < width; ++i)
                    target[i] = times_transmission ? share * values[i] * through[i] : share * values[i];
                continue;
            }
            sums.assign(width, 0.0f);
            for (int s = 0; s < samples_; ++s) {
                const std::size_t at = fine(left, row * samples_ + s);
                const float* values = plane + at;
                const float* through = memory_.transmission.data() + at;
                if (times_transmission) {
                    for (std::size_t i = 0; i < width; ++i)
                        sums[i] += values[i] * through[i];
                } else {
                    for (std::size_t i = 0; i < width; ++i)
                        sums[i] += values[i];
                }
            }
            if (samples_ == 2) {  // the usual, in vectors
                for (int x = 0; x < right - left; ++x)
                    target[x] =
                        share * (sums[static_cast<std::size_t>(2 * x)] + sums[static_cast<std::size_t>(2 * x + 1)]);
                continue;
            }
            for (int x = 0; x < right - left; ++x) {
                float sum = 0;
                for (int s = 0; s < samples_; ++s)
                    sum += sums[static_cast<std::size_t>(x * samples_ + s)];
                target[x] = share * sum;
            }
        }
    }

    // How the transmission's exponent changes with the dimensions of one group: kMostOfGroup planes.
    const float* motions(int group, float weight) {
        memory_.motions.assign(kMostOfGroup * plane_size_, 0.0f);
        for (const Placed* piece : memory_.here) {
            if (piece->group != group) continue;
            forRows(*piece, [&](std::size_t at, int count) {
                float* planes[kMostOfGroup];
                for (std::size_t k = 0; k < kMostOfGroup; ++k)
                    planes[k] = memory_.motions.data() + k * plane_size_ + at;
                rowKernels().motions(piece->view, memory_.x.data() + at, memory_.y.data() + at, count, weight,
                                     piece->velocity, planes);
            });
        }
        return memory_.motions.data();
    }
    std::size_t planeSize() const { return plane_size_; }

  private:
    // Kept by each thread from strip to strip: to ask the system for it again takes longer than to fill it.
    struct Memory {
        std::vector<const Placed*> here;
        std::vector<float> x, y, lengths, forces, transmission, motions, nowhere, between, sums, rod_x, rod_y;
    };
    static Memory& memory() {
        static thread_local Memory memory;
        return memory;
    }

    // `column` of pixels, `row` of samples.
    std::size_t fine(int column, int row) const {
        return static_cast<std::size_t>(row) * static_cast<std::size_t>(fine_width_) +
               static_cast<std::size_t>((column - begin_) * samples_);
    }

    // Where the samples look: between the pixels' places in straight lines.
    void lookAlong() {
        memory_.x.resize(plane_size_);
        memory_.y.resize(plane_size_);
        memory_.between.resize(static_cast<std::size_t>(end_ - begin_ + 2));
        const RayMap& rays = predictor_.rays_;
        for (int r = 0; r < rows_ * samples_; ++r) {
            const int row = first_row_ + r / samples_;
            const float down = (static_cast<float>(r % samples_) + 0.5f) / static_cast<float>(samples_) - 0.5f;
            const int other = down < 0 ? row - 1 : row + 1;
            for (const bool vertical : {false, true}) {
                const float* here = (vertical ? rays.rowY(row) : rays.rowX(row)) + begin_ - 1;
                const float* beside = (vertical ? rays.rowY(other) : rays.rowX(other)) + begin_ - 1;
                float* const between = memory_.between.data();
                for (int i = 0; i < end_ - begin_ + 2; ++i)
                    between[i] = here[i] + std::abs(down) * (beside[i] - here[i]);
                float* out = (vertical ? memory_.y : memory_.x).data() + fine(begin_, r);
                for (int s = 0; s < samples_; ++s) {
                    const float aside = (static_cast<float>(s) + 0.5f) / static_cast<float>(samples_) - 0.5f;
                    const int step = aside < 0 ? -1 : 1;
                    for (int i = 0; i < end_ - begin_; ++i) {
                        const float* at = between + (i + 1);
                        out[i * samples_ + s] = at[0] + std::abs(aside) * (at[step] - at[0]);
                    }
                }
                for (int i = (end_ - begin_) * samples_; i < fine_width_; ++i)
                    out[i] = out[i - 1];
            }
        }
    }

    // body(first sample, number of samples) for the rows of samples that a piece may be seen in.
    template <class Body>
    void forRows(const Placed& piece, const Body& body) const {
        const double step = 1.0 / samples_;
        const int first =
            std::max(0, static_cast<int>(std::floor((std::max(piece.top, -1.0) + 0.5 - first_row_) * samples_)));
        const int last =
            std::min(rows_ * samples_ - 1,
                     static_cast<int>(std::ceil((std::min(piece.bottom, 1e6) + 0.5 - first_row_) * samples_)));
        for (int r = first; r <= last; ++r) {
            const double y = first_row_ - 0.5 + (r + 0.5) * step;
            int begin, end;
            piece.columns(y, 0.5 * step, samples_, begin_ * samples_, end_ * samples_, begin, end);
            if (begin >= end) continue;
            const int count = (end - begin + kRowStep - 1) / kRowStep * kRowStep;
            begin = std::min(begin - begin_ * samples_, fine_width_ - count);
            body(fine(begin_, r) + static_cast<std::size_t>(begin), count);
        }
    }

    void drawRod(float* length) {
        std::vector<float>& sums = memory_.sums;
        for (int row = 0; row < rows_; ++row) {
            const int width = (end_ - begin_ + kRowStep - 1) / kRowStep * kRowStep;
            sums.assign(static_cast<std::size_t>(width), 0.0f);
            std::vector<float>&x = memory_.rod_x, &y = memory_.rod_y;
            x.assign(static_cast<std::size_t>(width), 0.0f);
            y.assign(static_cast<std::size_t>(width), 0.0f);
            std::copy_n(predictor_.rays_.rowX(first_row_ + row) + begin_, end_ - begin_, x.begin());
            std::copy_n(predictor_.rays_.rowY(first_row_ + row) + begin_, end_ - begin_, y.begin());
            for (const Placed* piece : memory_.here) {
                if (piece->part != rod) continue;
                int begin, end;
                piece->columns(first_row_ + row, 0.5, 1, begin_, end_, begin, end);
                if (begin >= end) continue;
                begin = (begin - begin_) / kRowStep * kRowStep;
                end = (end - begin_ + kRowStep - 1) / kRowStep * kRowStep;
                memory_.nowhere.resize(std::max(memory_.nowhere.size(), static_cast<std::size_t>(width)));
                rowKernels().lengths(piece->view, x.data() + begin, y.data() + begin, end - begin, sums.data() + begin,
                                     memory_.nowhere.data());
            }
            for (int s = 0; s < samples_; ++s) {
                float* out = length + fine(begin_, row * samples_ + s);
                for (int i = 0; i < end_ - begin_; ++i)
                    for (int k = 0; k < samples_; ++k)
                        out[i * samples_ + k] = sums[static_cast<std::size_t>(i)];
            }
        }
    }

    Memory& memory_;
    const CorkscrewPredictor& predictor_;
    int samples_, first_row_, rows_, fine_width_ = 0;
    int begin_ = 0, end_ = 0;  // columns of pixels that anything is drawn in
    std::size_t plane_size_ = 0;
};

namespace {

// The box about columns and rows [left, right] x [top, bottom], cut to the region, multiples of 4.
PixelRegion boxOf(const PixelRegion& region, double left, double right, double top, double bottom, double margin) {
    const auto low = [](double value, int size) {
        return std::clamp(static_cast<int>(std::floor(std::clamp(value, -1e6, 1e6) / 4)) * 4, 0, size);
    };
    const auto high = [](double value, int size) {
        return std::clamp(static_cast<int>(std::ceil((std::clamp(value, -1e6, 1e6) + 1) / 4)) * 4, 0, size);
    };
    PixelRegion box;
    box.x = low(left - margin, region.width);
    box.y = low(top - margin, region.height);
    box.width = std::max(0, high(right + margin, region.width) - box.x);
    box.height = std::max(0, high(bottom + margin, region.height) - box.y);
    return box;
}

}  // namespace

PredictedImage CorkscrewPredictor::predict(const Rigid3& imager_from_corkscrew, const std::array<double, kParts>& gains,
                                           Derivatives derivatives, Sampling sampling) const {
    PredictedImage out;
    predict(imager_from_corkscrew, gains, derivatives, sampling, out);
    return out;
}

void CorkscrewPredictor::predict(const Rigid3& imager_from_corkscrew, const std::array<double, kParts>& gains,
                                 Derivatives derivatives, Sampling sampling, PredictedImage& out) const {
    std::array<double, kParts> attenuation;
    for (std::size_t k = 0; k < kParts; ++k)
        attenuation[k] = gains[k] * attenuation_[k];
    const int samples = sampling == Sampling::fine ? samples_ : 1;
    const std::vector<Placed> placed = place(imager_from_corkscrew, attenuation, samples);
    const PixelRegion& region = rays_.region();
    const PixelRegion whole{0, 0, region.width, region.height};

    const auto clear = [](Image& image, int width, int height, float value) {
        if (image.width() == width && image.height() == height)
            std::fill(image.pixels().begin(), image.pixels().end(), value);
        else
            image = Image(width, height, value);
    };
    const auto clearAll = [&](auto& images) {
        for (Image& image : images)
            clear(image, region.width, region.height, 0);
    };
    clear(out.transmission, region.width, region.height, 1);
    const bool with_pose = derivatives != Derivatives::none, with_all = derivatives == Derivatives::all;
    if (with_pose) {
        out.pose.resize(6);
        clearAll(out.pose);
        clearAll(out.gains);
    }
    out.groups.clear();
    if (with_all) {
        out.imager.resize(3);
        clearAll(out.imager);
        for (std::size_t g = 0; g < solid_.groups.size(); ++g) {
            double left = 1e9, right = -1e9, top = 1e9, bottom = -1e9;
            for (const Placed& piece : placed) {
                if (piece.group != static_cast<int>(g)) continue;
                left = std::min(left, piece.left);
                right = std::max(right, piece.right);
                top = std::min(top, piece.top);
                bottom = std::max(bottom, piece.bottom);
            }
            GroupDerivatives group;
            if (left <= right) group.box = boxOf(region, left, right, top, bottom, kGroupMargin);
            group.planes.assign(static_cast<std::size_t>(solid_.groups[g].parameters),
                                Image(group.box.width, group.box.height));
            out.groups.push_back(std::move(group));
        }
    }

    const int strips = (region.height + kStripRows - 1) / kStripRows;
    out.drawn.assign(static_cast<std::size_t>(strips), {0, 0});
    parallelFor(static_cast<std::size_t>(strips), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t s = begin; s < end; ++s) {
            const int first = static_cast<int>(s) * kStripRows;
            Strip strip(*this, samples, first, std::min(kStripRows, region.height - first), placed);
            if (strip.empty()) continue;
            out.drawn[s] = strip.columns();
            strip.draw(attenuation, with_pose);
            strip.expose(attenuation);
            strip.collect(strip.transmission(), 1, false, whole, out.transmission);
            if (!with_pose) continue;
            for (std::size_t k = 0; k < 6; ++k)
                strip.collect(strip.force(k), 1, true, whole, out.pose[k]);
            for (std::size_t k = 0; k < kParts; ++k)
                strip.collect(strip.lengths(k), static_cast<float>(-attenuation_[k]), true, whole, out.gains[k]);
            if (!with_all) continue;
            // A longer focal length and a shifted centre move where the solid's points are seen.
            const double f = rays_.focal_length_mm();
            strip.collect(strip.force(6), 1, true, whole, out.imager[0]);
            strip.collect(strip.force(7), static_cast<float>(pixel_mm_.x() / f), true, whole, out.imager[1]);
            strip.collect(strip.force(8), static_cast<float>(pixel_mm_.y() / f), true, whole, out.imager[2]);
            for (std::size_t g = 0; g < out.groups.size(); ++g) {
                GroupDerivatives& group = out.groups[g];
                if (group.box.empty() || group.box.y >= first + kStripRows || group.box.y + group.box.height <= first)
                    continue;
                const bool is_bead = solid_.groups[g].parameters == 3;
                const double weight = attenuation[rod] - attenuation[is_bead ? beads : wire];
                const float* planes = strip.motions(static_cast<int>(g), static_cast<float>(weight));
                for (std::size_t k = 0; k < group.planes.size(); ++k)
                    strip.collect(planes + k * strip.planeSize(), 1, true, group.box, group.planes[k]);
            }
        }
    });
}

std::array<Image, kParts> CorkscrewPredictor::pathLengths(const Rigid3& imager_from_corkscrew) const {
    const std::vector<Placed> placed = place(imager_from_corkscrew, {}, samples_);
    const PixelRegion& region = rays_.region();
    std::array<Image, kParts> out;
    out.fill(Image(region.width, region.height));
    const int strips = (region.height + kStripRows - 1) / kStripRows;
    parallelFor(static_cast<std::size_t>(strips), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t s = begin; s < end; ++s) {
            const int first = static_cast<int>(s) * kStripRows;
            Strip strip(*this, samples_, first, std::min(kStripRows, region.height - first), placed);
            if (strip.empty()) continue;
            strip.draw({}, false);
            for (std::size_t k = 0; k < kParts; ++k)
                strip.collect(strip.lengths(k), 1, false, {0, 0, region.width, region.height}, out[k]);
        }
    });
    return out;
}

PixelRegion regionAround(const CArm& carm, const CorkscrewLayout& layout, const Rigid3& imager_from_corkscrew,
                         double margin_px) {
    double left = 1e9, right = -1e9, top = 1e9, bottom = -1e9;
    const auto include = [&](const Vector3& point) {
        const Vector2 seen = carm.project(imager_from_corkscrew * point);
        if (!seen.allFinite()) return;
        left = std::min(left, seen.x());
        right = std::max(right, seen.x());
        top = std::min(top, seen.y());
        bottom = std::max(bottom, seen.y());
    };
    for (const double x : {layout.rod_x_mm[0], 0.5 * (layout.rod_x_mm[0] + layout.rod_x_mm[1]), layout.rod_x_mm[1]}) {
        for (int k = 0; k < 8; ++k) {
            const double angle = k * std::numbers::pi / 4;
            include(Vector3(x, layout.rod_radius_mm * std::cos(angle), layout.rod_radius_mm * std::sin(angle)));
        }
    }
    for (const double x : layout.shaft_x_mm)
        include(Vector3(x, 0, 0));
    if (!(left <= right)) return {};
    // A circle reaches beyond its octagon.
    const double reach = 0.08 * layout.rod_radius_mm * carm.focal_length_mm /
                         (std::max(1.0, imager_from_corkscrew.translation().z()) * carm.pixel_mm.minCoeff());
    PixelRegion region = boxOf({0, 0, carm.columns, carm.rows}, left, right, top, bottom, margin_px + reach);
    region.width -= region.width % 4;
    region.height -= region.height % 4;
    return region;
}

}  // namespace fluorocut::corkscrew
