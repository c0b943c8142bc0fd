// Volumes whose line integrals are known in closed form, and the views that the projector's tests look from.
#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/units.h"
#include "core/geometry/rigid3.h"
#include "core/image/image.h"
#include "core/image/volume.h"
#include "core/imaging/carm.h"

namespace fluorocut::test {

inline constexpr double kMuWater = 0.02;

struct Blob {
    Vector3 center;
    double sigma_mm;
    double hu;  // above air, at the centre
};

inline VolumeGrid centeredGrid(std::array<int, 3> size, const Vector3& spacing_mm, const Rigid3& pose = {}) {
    VolumeGrid grid;
    grid.size = size;
    grid.spacing_mm = spacing_mm;
    grid.direction = pose.rotationMatrix();
    grid.origin_mm = pose * Vector3(-0.5 * spacing_mm.cwiseProduct(Vector3(size[0] - 1, size[1] - 1, size[2] - 1)));
    return grid;
}

template <class Function>
std::shared_ptr<const Volume> makeVolume(const VolumeGrid& grid, const Function& hounsfield) {
    auto volume = std::make_shared<Volume>(grid);
    parallelFor(static_cast<std::size_t>(grid.size[2]), 1, [&](std::size_t begin, std::size_t end) {
        for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
            for (int j = 0; j < grid.size[1]; ++j) {
                for (int i = 0; i < grid.size[0]; ++i) {
                    (*volume)(i, j, k) = static_cast<float>(hounsfield(grid.pointFromIndex(Vector3(i, j, k))));
                }
            }
        }
    });
    return volume;
}

inline std::shared_ptr<const Volume> makeBlobs(const VolumeGrid& grid, const std::vector<Blob>& blobs) {
    return makeVolume(grid, [&](const Vector3& point) {
        double hu = -1000;
        for (const Blob& blob : blobs) {
            hu += blob.hu * std::exp(-(point - blob.center).squaredNorm() / (2 * blob.sigma_mm * blob.sigma_mm));
        }
        return hu;
    });
}

// The integral of the blobs' mu along the ray through each pixel, over the whole line.
inline Image blobIntegrals(const std::vector<Blob>& blobs, const CArm& carm, const Rigid3& imager_from_volume) {
    Image image(carm.columns, carm.rows);
    for (int y = 0; y < carm.rows; ++y) {
        for (int x = 0; x < carm.columns; ++x) {
            const Vector3 direction = carm.rayDirection(Vector2(x, y));
            double sum = 0;
            for (const Blob& blob : blobs) {
                const Vector3 center = imager_from_volume * blob.center;
                const double distance2 = center.squaredNorm() - std::pow(center.dot(direction), 2);
                sum += kMuWater / 1000 * blob.hu * blob.sigma_mm * std::sqrt(2 * M_PI) *
                       std::exp(-distance2 / (2 * blob.sigma_mm * blob.sigma_mm));
            }
            image(x, y) = static_cast<float>(sum);
        }
    }
    return image;
}

// A view of the volume's origin from `angle` about the volume's z axis and `tilt` out of its xy plane.
inline Rigid3 orbit(double angle_deg, double tilt_deg, double source_object_mm = 650) {
    const Rigid3 turn = Rigid3::fromRotationVector(Vector3(radiansFromDegrees(90 + tilt_deg), 0, 0)) *
                        Rigid3::fromRotationVector(Vector3(0, 0, radiansFromDegrees(angle_deg)));
    return Rigid3::fromTranslation({0, 0, source_object_mm}) * turn;
}

// Root mean square of a - b over the largest of b.
inline double normalizedRms(const Image& a, const Image& b) {
    double sum = 0, largest = 0;
    for (std::size_t i = 0; i < b.size(); ++i) {
        const double d = static_cast<double>(a.pixels()[i]) - b.pixels()[i];
        sum += d * d;
        largest = std::max(largest, std::abs(static_cast<double>(b.pixels()[i])));
    }
    return std::sqrt(sum / static_cast<double>(b.size())) / largest;
}

}  // namespace fluorocut::test
