// Beads of 2 mm in the built-in femur, with screws beside them, in the virtual operating room: found, labelled, and the
// femur's pose from them, against the truth.
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "core/base/chi_square.h"
#include "core/base/median.h"
#include "core/fiducial/femur_beads.h"
#include "core/simulation/calibration_objects.h"
#include "core/simulation/femur_phantom.h"
#include "core/simulation/truth.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

BeadLayout beadsInBone(const std::vector<Vector3>& axis) {
    // Along the shaft's canal wall and in the trochanters, none behind another for long.
    BeadLayout layout;
    layout.frame = Frame::femur;
    const Vector3 places[] = {{10, -6, 40},  {16, 7, 31},  {6, 11, 19},   {-8, 9, 7},    {10, -10, 0},
                              {-9, -8, -12}, {10, 4, -23}, {-4, 11, -34}, {6, -11, -45}, {-9, 3, -54}};
    for (const Vector3& place : places) {
        Bead bead;
        bead.name = std::string("b").append(std::to_string(layout.beads.size() + 1));
        bead.center_mm = place;
        if (place.z() < 0 && !axis.empty()) {
            for (const Vector3& middle : axis)
                if (std::abs(middle.z() - place.z()) < 6) bead.center_mm += Vector3(middle.x(), middle.y(), 0);
        }
        layout.beads.push_back(bead);
    }
    return layout;
}

constexpr int kViews = 16;

struct Summary {
    int solved = 0, held = 0, wrong = 0, found = 0, all = 0;
    std::vector<double> in_plane, depth, rotation, fre;
};

void poses(const FemurOptions& femur_options, double photons, Summary& summary) {
    const auto femur = generateFemur(femur_options);
    ASSERT_OK(femur);
    const BeadLayout layout = beadsInBone(femur->landmarks.shaft_axis_mm);
    OperatingRoomOptions options;
    const Rigid3 room_from_femur = [&] {
        // What a room without a plan does with the axes, but with the beads' middle in the isocentre.
        auto room =
            VirtualOperatingRoom::create(std::make_shared<Volume>(femur->ct), OperatingRoomOptions{}.withoutErrors());
        if (!room) throw std::runtime_error(room.error().message());
        return Rigid3(truthOf(*room).room_from_femur.rotation(), Vector3::Zero());
    }();
    options.planned_room_from_femur = room_from_femur * Rigid3::fromTranslation({-4, 0, 7});
    options.patient_offset_mm = 4;
    options.return_offset_mm = 8;
    options.xray.photons_per_pixel = photons;
    options.seed = 5;
    auto room = VirtualOperatingRoom::create(std::make_shared<Volume>(femur->ct), options);
    ASSERT_OK(room);
    auto beads = heldBeads("beads", layout, HeldBy::patient, Rigid3(), Material::steel);
    ASSERT_OK(beads);
    ASSERT_OK(room->hold(std::move(*beads)));
    // Two screws seen end on in some views: their heads are round.
    ASSERT_OK(room->hold(screw("screw 1", 30, HeldBy::patient, Rigid3(expRotation({M_PI / 2, 0, 0}), {20, 20, -15}))));
    ASSERT_OK(room->hold(screw("screw 2", 25, HeldBy::patient, Rigid3(expRotation({0, M_PI / 2, 0}), {-15, 5, -40}))));

    FemurBeadOptions registration;
    registration.uncertainty = {1e-6, 1e-3, 1e-4,
                                BeadUncertainty{}.unexplained_px};  // the C-arm and the layout are the true ones
    const double limit = chiSquareQuantile(0.05, 6);
    Random random(6);
    for (int i = 0; i < kViews; ++i) {
        ImageRequest request;
        request.position = CArmPosition{random.uniform(-1.6, 1.6), random.uniform(-0.4, 0.4), Vector3::Zero()};
        const auto image = room->acquire(request, Progress::none());
        ASSERT_OK(image);
        const ViewTruth& truth = truthOf(*room).views.back();
        FemurView view;
        view.name = "view";
        view.carm = truth.carm;
        BeadDetectionOptions detection;
        detection.least_diameter_px = 5;
        detection.most_diameter_px = 16;
        const auto detections = detectBeads(image->image, detection);
        ASSERT_OK(detections);
        view.detections = detections->beads;
        const auto result = registerBeads({view}, layout, registration);
        if (!result) {
            std::printf("view %d: %s\n", i, result.error().message().c_str());
            continue;
        }
        ++summary.solved;
        const FemurViewPose& pose = result->views[0];
        for (const FemurBead& bead : pose.beads) {
            const Vector3 place = truth.imager_from_femur * layout.beads[bead.bead].center_mm;
            const double off = (view.detections[bead.detection].center_px - truth.carm.project(place)).norm();
            summary.wrong += bead.used && off > 2 ? 1 : 0;
        }
        summary.found += static_cast<int>(pose.beads.size());
        summary.all += static_cast<int>(pose.beads.size() + pose.missing.size());
        const Vector6 e = pose.imager_from_femur.target_from_source.deltaFrom(truth.imager_from_femur);
        summary.in_plane.push_back(e.head<2>().norm());
        summary.depth.push_back(std::abs(e[2]));
        summary.rotation.push_back(degreesFromRadians(e.tail<3>().norm()));
        summary.fre.push_back(pose.fre_px);
        summary.held += e.dot(pose.noise_covariance.ldlt().solve(e)) < limit ? 1 : 0;
    }
    std::printf(
        "%d of %d views solved, %d of %d beads found, %d wrong; medians: %.3f mm across, %.2f mm depth, %.3f degrees, "
        "FRE "
        "%.3f px; 95 %% regions hold %d\n",
        summary.solved, kViews, summary.found, summary.all, summary.wrong, median(summary.in_plane),
        median(summary.depth), median(summary.rotation), median(summary.fre), summary.held);
}

TEST(FemurBeadsInBone, SlowInADryFemurAt1000Photons) {
    FemurOptions femur;
    femur.voxel_mm = 1.2;
    femur.soft_tissue = femur.pelvis = false;
    Summary summary;
    poses(femur, 1000, summary);
    EXPECT_GE(summary.solved, kViews - 1);
    EXPECT_EQ(summary.wrong, 0);
    EXPECT_LT(median(summary.in_plane), 0.05);
    EXPECT_LT(median(summary.depth), 0.4);
    EXPECT_LT(median(summary.rotation), 0.1);
    // Of 16: 15 expected; 12 or fewer has a chance of less than 1 %.
    EXPECT_GE(summary.held, summary.solved - 3);
}

TEST(FemurBeadsInBone, SlowInThePatient) {
    FemurOptions femur;
    femur.voxel_mm = 1.2;
    Summary summary;
    poses(femur, 50'000, summary);  // some 1000 behind 20 cm of hip
    EXPECT_GE(summary.solved, kViews - 1);
    EXPECT_EQ(summary.wrong, 0);
    EXPECT_LT(median(summary.in_plane), 0.05);
    EXPECT_LT(median(summary.depth), 0.4);
    EXPECT_LT(median(summary.rotation), 0.1);
    EXPECT_GE(summary.held, summary.solved - 3);
}

}  // namespace
}  // namespace fluorocut
