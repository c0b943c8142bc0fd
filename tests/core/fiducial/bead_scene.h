// Pictures of beads for tests, made without any of the code they test: exact path lengths of rays through spheres.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>

#include "core/base/random.h"
#include "core/fiducial/bead_layout.h"
#include "core/image/blur.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut::test {

struct BeadScene {
    CArm carm;
    Rigid3 imager_from_layout;
    BeadLayout layout;
    double mu_per_mm = 0.96;                               // steel at 60 keV
    double photons = 1000;                                 // per pixel behind the background
    double blur_px = 0.7;                                  // of the detector
    bool blur_before_noise = false;                        // white noise, as of a detector without spread in its noise
    std::function<double(double u, double v)> background;  // relative intensity; none: 1
    std::uint64_t seed = 1;
    bool noise = true;
};

// Expected photons, averaged over 4 x 4 rays per pixel; not yet blurred.
inline Image expectedPhotons(const BeadScene& scene) {
    const CArm& carm = scene.carm;
    Image image(carm.columns, carm.rows);
    for (int y = 0; y < carm.rows; ++y) {
        for (int x = 0; x < carm.columns; ++x)
            image(x, y) = static_cast<float>(scene.photons * (scene.background ? scene.background(x, y) : 1));
    }
    for (const Bead& bead : scene.layout.beads) {
        const Vector3 center = scene.imager_from_layout * bead.center_mm;
        const double radius = 0.5 * bead.diameter_mm;
        const Vector2 middle = carm.project(center);
        const double reach = 1.3 * radius * carm.focal_length_mm / center.z() / carm.pixel_mm.minCoeff() + 4;
        const int left = std::max(0, static_cast<int>(middle.x() - reach)),
                  right = std::min(carm.columns - 1, static_cast<int>(middle.x() + reach)),
                  top = std::max(0, static_cast<int>(middle.y() - reach)),
                  bottom = std::min(carm.rows - 1, static_cast<int>(middle.y() + reach));
        for (int y = top; y <= bottom; ++y) {
            for (int x = left; x <= right; ++x) {
                double sum = 0;
                for (int j = 0; j < 4; ++j) {
                    for (int i = 0; i < 4; ++i) {
                        const Vector3 ray = carm.rayDirection({x - 0.375 + 0.25 * i, y - 0.375 + 0.25 * j});
                        const double off2 = center.squaredNorm() - std::pow(ray.dot(center), 2);
                        const double half2 = radius * radius - off2;
                        sum += half2 > 0 ? std::exp(-2 * scene.mu_per_mm * std::sqrt(half2)) : 1.0;
                    }
                }
                image(x, y) *= static_cast<float>(sum / 16);
            }
        }
    }
    return image;
}

inline Image pictureOf(const BeadScene& scene) {
    Image image = expectedPhotons(scene);
    if (scene.blur_before_noise) image = gaussianBlurred(image, scene.blur_px);
    if (scene.noise) {
        Random random(scene.seed);
        for (float& value : image.pixels())
            value = static_cast<float>(random.poisson(value));
    }
    return scene.blur_before_noise ? image : gaussianBlurred(image, scene.blur_px);
}

}  // namespace fluorocut::test
