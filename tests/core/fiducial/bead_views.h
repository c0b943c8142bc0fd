// Views of the calibration phantom for tests, and detections made from the geometry alone.
#pragma once

#include <filesystem>

#include <gtest/gtest.h>

#include "core/base/units.h"
#include "core/fiducial/bead_detection.h"
#include "core/fiducial/sphere_shadow.h"
#include "core/imaging/carm.h"
#include "tests/core/fiducial/bead_scene.h"
#include "tests/support/fixtures.h"

namespace fluorocut::test {

inline BeadLayout phantom(const std::string& name = "two-plane") {
    const auto layout =
        readBeadLayout(std::filesystem::path(FLUOROCUT_SOURCE_DIR) / "resources/phantoms" / (name + ".json"));
    EXPECT_OK(layout);
    return layout ? *layout : BeadLayout{};
}

// A C-arm that is nobody's nominal one.
inline CArm trueCArm() {
    CArm carm;
    carm.name = "truth";
    carm.focal_length_mm = 1043;
    carm.principal_point_px = {262.3, 247.9};
    return carm;
}

// The phantom 180 mm before the detector, turned about the image's axes and in its plane.
inline Rigid3 phantomPose(double about_x_deg, double about_y_deg, double in_plane_deg, Vector2 shift_mm = {0, 0}) {
    return Rigid3::fromTranslation({shift_mm.x(), shift_mm.y(), 850}) *
           Rigid3::fromRotationVector({radiansFromDegrees(about_x_deg), radiansFromDegrees(about_y_deg), 0}) *
           Rigid3::fromRotationVector({0, 0, radiansFromDegrees(in_plane_deg)});
}

struct SyntheticDetections {
    std::vector<BeadDetection> detections;
    std::vector<int> bead;  // which one each is; -1: none
};

// Shadows where the geometry has them, with normal errors; some beads missing, some shadows of nothing.
inline SyntheticDetections syntheticDetections(const BeadLayout& layout, const CArm& carm,
                                               const Rigid3& imager_from_layout, double sigma_px, double missing,
                                               int extra, Random& random) {
    SyntheticDetections made;
    const auto add = [&](const Vector2& center, double radius, int bead) {
        BeadDetection one;
        one.center_px = center + sigma_px * Vector2(random.normal(), random.normal());
        one.covariance_px2 = std::max(sigma_px, 1e-3) * std::max(sigma_px, 1e-3) * Matrix2::Identity();
        one.radius_px = radius * (1 + 0.03 * random.normal());
        one.contrast = 1.5;
        one.blur_px = 0.8;
        one.score = 0.95;
        made.detections.push_back(one);
        made.bead.push_back(bead);
    };
    for (std::size_t i = 0; i < layout.beads.size(); ++i) {
        const Bead& bead = layout.beads[i];
        const Vector3 center = imager_from_layout * bead.center_mm;
        const Vector2 place = shadowCenter(carm, center, 0.5 * bead.diameter_mm);
        const double radius = 0.5 * bead.diameter_mm * carm.focal_length_mm / center.z() / carm.pixel_mm.x();
        const bool lost = random.uniform() < missing;
        if (!lost && place.x() > radius && place.y() > radius && place.x() < carm.columns - 1 - radius &&
            place.y() < carm.rows - 1 - radius) {
            add(place, radius, static_cast<int>(i));
        }
    }
    for (int i = 0; i < extra; ++i)
        add({random.uniform(10, carm.columns - 10), random.uniform(10, carm.rows - 10)}, random.uniform(2, 6), -1);
    // In no order that means anything.
    for (std::size_t i = made.detections.size(); i > 1; --i) {
        const auto j = static_cast<std::size_t>(random.below(i));
        std::swap(made.detections[i - 1], made.detections[j]);
        std::swap(made.bead[i - 1], made.bead[j]);
    }
    return made;
}

}  // namespace fluorocut::test
