#include "core/cavity/region_pixels.h"

#include <algorithm>
#include <cmath>

namespace fluorocut::cavity {

std::optional<Region> regionOf(const CArm& carm, const TriangleMesh& mesh, const Rigid3& imager_from_cavity,
                               double margin_mm, int block_px) {
    Vector2 low = Vector2::Constant(1e9), high = -low;
    double depth = 0;
    for (const Vector3& vertex : mesh.vertices) {
        const Vector3 p = imager_from_cavity * vertex;
        const Vector2 px = carm.project(p);
        if (!px.allFinite()) return std::nullopt;
        low = low.cwiseMin(px);
        high = high.cwiseMax(px);
        depth += p.z() / static_cast<double>(mesh.vertices.size());
    }
    const Vector2 margin = (margin_mm * carm.focal_length_mm / depth) * carm.pixel_mm.cwiseInverse();
    const auto clip = [](double value, int most) {
        return static_cast<int>(std::clamp(value, 0.0, static_cast<double>(most)));
    };
    Region region;
    region.px_per_mm = carm.focal_length_mm / depth / carm.pixel_mm.mean();
    region.x = clip(low.x() - margin.x(), carm.columns);
    region.y = clip(low.y() - margin.y(), carm.rows);
    // Whole blocks of the coarsest level.
    region.width = (clip(high.x() + margin.x(), carm.columns) - region.x) / block_px * block_px;
    region.height = (clip(high.y() + margin.y(), carm.rows) - region.y) / block_px * block_px;
    if (region.width < 8 * block_px || region.height < 8 * block_px) return std::nullopt;
    return region;
}

Image logOf(const Image& image, const Region& region, int binning) {
    Image result(region.width / binning, region.height / binning);
    float top = 0;
    for (const float pixel : image.pixels())
        top = std::max(top, pixel);
    const float least = 1e-4f * std::max(top, 1e-20f);
    for (int y = 0; y < result.height(); ++y) {
        for (int x = 0; x < result.width(); ++x) {
            float sum = 0;
            for (int j = 0; j < binning; ++j)
                for (int i = 0; i < binning; ++i)
                    sum += image(region.x + x * binning + i, region.y + y * binning + j);
            result(x, y) = std::log(std::max(sum / static_cast<float>(binning * binning), least));
        }
    }
    return result;
}

Eigen::MatrixXf slowBasis(int width, int height) {
    Eigen::MatrixXf basis(static_cast<Eigen::Index>(width) * height, kSlow);
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const double u = 2.0 * x / (width - 1) - 1, v = 2.0 * y / (height - 1) - 1;
            // Legendre polynomials: nearly orthogonal, so that the equations are well scaled.
            const double pu[5] = {1, u, (3 * u * u - 1) / 2, (5 * u * u - 3) * u / 2,
                                  ((35 * u * u - 30) * u * u + 3) / 8};
            const double pv[5] = {1, v, (3 * v * v - 1) / 2, (5 * v * v - 3) * v / 2,
                                  ((35 * v * v - 30) * v * v + 3) / 8};
            int column = 0;
            for (int i = 0; i <= kDegree; ++i)
                for (int j = 0; i + j <= kDegree; ++j)
                    basis(static_cast<Eigen::Index>(y) * width + x, column++) = static_cast<float>(pu[i] * pv[j]);
        }
    }
    return basis;
}

Image halfLaplacian(const Image& image) {
    Image result(image.width(), image.height());
    const auto at = [&](int x, int y) {
        return image(std::clamp(x, 0, image.width() - 1), std::clamp(y, 0, image.height() - 1));
    };
    for (int y = 0; y < image.height(); ++y)
        for (int x = 0; x < image.width(); ++x)
            result(x, y) = 0.5f * (at(x - 1, y) + at(x + 1, y) + at(x, y - 1) + at(x, y + 1) - 4 * image(x, y));
    return result;
}

}  // namespace fluorocut::cavity
