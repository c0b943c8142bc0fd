// The fits of the corkscrew and what they are made of, beside peers in the same run: exact projection of the same
// solids as meshes, and OpenCV's pose from points that are given their true correspondence. Prints a Markdown table.
//
//     corkscrew_benchmark [rounds]
//
// Images: 512 x 512, soft tissue, 1000 photons. Times are medians over rounds and poses; errors are means over poses.
#include <cmath>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/calib3d.hpp>

#include "core/base/median.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/stopwatch.h"
#include "core/base/units.h"
#include "core/fiducial/corkscrew_refinement.h"
#include "core/fiducial/corkscrew_refinement/predicted_image.h"
#include "core/fiducial/corkscrew_solid.h"
#include "core/imaging/mesh_projector.h"
#include "core/imaging/xray_physics.h"

using namespace fluorocut;

namespace {

struct Row {
    std::string name;
    std::vector<double> ms = {};
    double aside_mm = 0, depth_mm = 0, angle_deg = 0;
    int poses = 0;

    void time(const std::function<void()>& run) {
        const Stopwatch stopwatch;
        run();
        ms.push_back(stopwatch.ms());
    }
    void score(const Rigid3& pose, const Rigid3& truth) {
        const Vector6 off = pose.deltaFrom(truth);
        aside_mm += off.head<2>().norm();
        depth_mm += std::abs(off[2]);
        angle_deg += degreesFromRadians(off.tail<3>().norm());
        ++poses;
    }
};

struct Solids {
    std::vector<std::pair<MeshProjector, double>> parts;

    void add(const TriangleMesh& mesh, double mu) {
        if (mesh.triangles.empty()) return;
        Result<MeshProjector> projector = MeshProjector::prepare(mesh);
        if (projector) parts.emplace_back(std::move(*projector), mu);
    }
    Image lineIntegrals(const CArm& carm, const Rigid3& pose) const {
        Image sum(carm.columns, carm.rows);
        for (const auto& [projector, mu] : parts) {
            const Image length = projector.project(carm, pose, {2});
            for (std::size_t i = 0; i < sum.size(); ++i)
                sum.pixels()[i] += static_cast<float>(mu) * length.pixels()[i];
        }
        return sum;
    }
};

// What a point fit would be given: places on the wires with 0.1 px of error, each known by name.
Rigid3 solvePnp(const CorkscrewLayout& layout, const CArm& carm, const Rigid3& truth, Random& random, Row& row) {
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> pixels;
    const auto add = [&](const Vector3& point) {
        const Vector2 seen = carm.project(truth * point);
        points.emplace_back(point.x(), point.y(), point.z());
        pixels.emplace_back(seen.x() + 0.1 * random.normal(), seen.y() + 0.1 * random.normal());
    };
    for (const CorkscrewRing& ring : layout.rings)
        for (int k = 0; k < 60; ++k)
            add(ring.point(k * radiansFromDegrees(6)));
    for (int k = 0; k < 100; ++k)
        add(layout.helix.point((k + 0.5) / 100));
    const cv::Mat camera =
        (cv::Mat_<double>(3, 3) << carm.focal_length_mm / carm.pixel_mm.x(), 0, carm.principal_point_px.x(), 0,
         carm.focal_length_mm / carm.pixel_mm.y(), carm.principal_point_px.y(), 0, 0, 1);
    cv::Mat rotation, translation;
    row.time([&] { cv::solvePnP(points, pixels, camera, cv::noArray(), rotation, translation); });
    const Vector3 vector(rotation.at<double>(0), rotation.at<double>(1), rotation.at<double>(2));
    return Rigid3(expRotation(vector),
                  Vector3(translation.at<double>(0), translation.at<double>(1), translation.at<double>(2)));
}

}  // namespace

int main(int argc, char** argv) {
    const int rounds = argc > 1 ? std::atoi(argv[1]) : 3;
    const Result<CorkscrewLayout> layout =
        readCorkscrew(std::string(FLUOROCUT_SOURCE_DIR) + "/resources/fiducials/corkscrew.json");
    if (rounds < 1 || !layout) {
        fmt::print(stderr, "usage: corkscrew_benchmark [rounds]\n");
        return 2;
    }
    const CorkscrewSolid solid = *corkscrewSolid(*layout);
    const double wire = attenuationPerMm(layout->wire), shaft = attenuationPerMm(layout->shaft);
    const double rod = attenuationPerMm(layout->rod);
    Solids solids;
    solids.add(solid.rod, rod);
    solids.add(solid.shaft_inside, shaft - rod);
    solids.add(solid.shaft_outside, shaft);
    solids.add(solid.helix, wire - rod);
    for (const TriangleMesh& ring : solid.rings)
        solids.add(ring, wire - rod);
    for (const TriangleMesh& bead : solid.beads)
        solids.add(bead, shaft - rod);

    const CArm carm;
    Random random(1);
    Row mesh{"exact projection of its meshes"}, predicted{"predicted image"},
        derivatives{"predicted image, derivatives"};
    Row shape{"fit of the shape, from 2 degrees, 3 mm"}, image_fit{"fit of the image, from the shape's"};
    Row with_evidence{"the same with evidence"}, tracking{"tracking, from 1 degree, 1 mm"};
    Row points{"OpenCV solvePnP, 340 named points, 0.1 px"};
    constexpr int kPoses = 6;
    for (int i = 0; i < kPoses; ++i) {
        const Rigid3 truth =
            Rigid3::fromTranslation({random.uniform(-15, 15), random.uniform(-15, 15), random.uniform(670, 730)}) *
            Rigid3::fromTwistRollPitch(random.uniform(0, 6.28), random.uniform(-0.8, 0.8), random.uniform(-1, 1));
        Image line_integrals;
        mesh.time([&] { line_integrals = solids.lineIntegrals(carm, truth); });
        for (float& value : line_integrals.pixels())
            value += 0.5f;
        XrayOptions physics;
        physics.photons_per_pixel = 1000;
        physics.seed = static_cast<std::uint64_t>(i);
        const Result<Exposure> exposure = expose(line_integrals, carm, physics);
        if (!exposure) return 1;
        const Image& image = exposure->image;
        const auto near = [&](double degrees, double mm) {
            Vector6 delta;
            for (int k = 0; k < 6; ++k)
                delta[k] = (k == 2 ? mm : k < 2 ? 0.3 * mm : radiansFromDegrees(degrees) / 1.7) * random.normal();
            return truth.perturbed(delta);
        };
        const corkscrew::CorkscrewPredictor predictor(carm, *layout, corkscrew::regionAround(carm, *layout, truth, 20));
        for (int round = 0; round < rounds; ++round) {
            const Rigid3 start = near(2, 3), tracked = near(1, 1);
            predicted.time([&] { predictor.predict(truth, {1, 1, 1, 1}, corkscrew::Derivatives::none); });
            derivatives.time([&] { predictor.predict(truth, {1, 1, 1, 1}, corkscrew::Derivatives::pose); });
            Rigid3 pose;
            const auto keep = [&](const Result<CorkscrewFit>& fit) {
                if (fit) pose = fit->imager_from_corkscrew;
            };
            shape.time([&] { keep(refineOnShape(image, carm, *layout, start)); });
            shape.score(pose, truth);
            const Rigid3 of_shape = pose;
            CorkscrewFitOptions quick;
            quick.evidence = false;
            image_fit.time([&] { keep(refineOnImage(image, carm, *layout, of_shape, quick)); });
            image_fit.score(pose, truth);
            with_evidence.time([&] { keep(refineOnImage(image, carm, *layout, of_shape)); });
            with_evidence.score(pose, truth);
            tracking.time([&] { keep(refineOnImage(image, carm, *layout, tracked, quick)); });
            tracking.score(pose, truth);
            points.score(solvePnp(*layout, carm, truth, random, points), truth);
        }
    }
    fmt::print("Threads: {}. {} poses, {} rounds.\n\n", parallelThreads(), kPoses, rounds);
    fmt::print("| | ms | x, y mm | depth mm | degrees |\n|---|---|---|---|---|\n");
    for (const Row& row : {mesh, predicted, derivatives, shape, image_fit, with_evidence, tracking, points}) {
        if (row.poses == 0) {
            fmt::print("| {} | {:.2f} | | | |\n", row.name, median(row.ms));
        } else {
            fmt::print("| {} | {:.2f} | {:.4f} | {:.3f} | {:.3f} |\n", row.name, median(row.ms),
                       row.aside_mm / row.poses, row.depth_mm / row.poses, row.angle_deg / row.poses);
        }
    }
    return 0;
}
