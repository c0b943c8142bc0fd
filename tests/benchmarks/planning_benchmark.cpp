// What the surgeon waits for while moving an implant, beside what other programs' parts would take, in one run. Prints
// a Markdown table.
//
//     planning_benchmark [rounds]
//
// Each round takes every row over the same poses; times are medians. Processor time, of all threads together, is what
// to look at on a machine that does other things too: the clock's is nearly that divided by the threads when it does
// not.
#include <cstdlib>
#include <ctime>
#include <functional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "core/base/median.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/stopwatch.h"
#include "core/geometry/primitives.h"
#include "core/imaging/mesh_projector.h"
#include "core/imaging/silhouette.h"
#include "core/planning/implant_file.h"
#include "core/planning/predicted_image.h"

using namespace fluorocut;

namespace {

struct Row {
    std::string what;
    std::function<void(const Rigid3&)> run;
    int repeats;
    std::vector<double> ms = {}, processor_ms = {};
};

void require(bool good, const char* what) {
    if (good) return;
    fmt::print(stderr, "{} failed\n", what);
    std::exit(1);
}

// The outlines of a mask, as OpenCV finds them: pixel by pixel.
std::size_t maskContours(const Image& lengths) {
    cv::Mat mask(lengths.height(), lengths.width(), CV_8U);
    for (int y = 0; y < lengths.height(); ++y)
        for (int x = 0; x < lengths.width(); ++x)
            mask.at<std::uint8_t>(y, x) = lengths(x, y) > 0;
    std::vector<std::vector<cv::Point>> found;
    cv::findContours(mask, found, cv::RETR_CCOMP, cv::CHAIN_APPROX_NONE);
    return found.size();
}

}  // namespace

int main(int argc, char** argv) {
    const int rounds = argc > 1 ? std::atoi(argv[1]) : 5;
    if (rounds < 1) {
        fmt::print(stderr, "usage: planning_benchmark [rounds]\n");
        return 2;
    }
    StemShape shape;
    shape.length_mm = 140;
    shape.sections = 250;
    shape.segments = 100;
    const TriangleMesh mesh = makeStem(shape);
    const auto silhouette = Silhouette::prepare(mesh);
    const auto projector = MeshProjector::prepare(mesh);
    require(silhouette.ok() && projector.ok(), "preparing the stem");
    const CArm carm;
    std::vector<Rigid3> poses;
    for (int i = 0; i < 10; ++i)
        poses.push_back(Rigid3::fromTranslation({5.0 * i - 20, -30, 650}) *
                        Rigid3::fromRotationVector({1.5 + 0.02 * i, 0.1 * i, 0.05 * i - 0.2}));

    std::vector<Row> rows;
    const auto contours = [&](const SilhouetteOptions& options) {
        return [&, options](const Rigid3& pose) {
            const auto loops = silhouette->project(carm, pose, options);
            require(loops.ok() && !loops->empty(), "the silhouette");
        };
    };
    rows.push_back({"silhouette", contours({}), 50});
    rows.push_back({"silhouette, its outline found", contours({true, false}), 50});
    rows.push_back({"silhouette, hidden parts found", contours({true, true}), 50});
    rows.push_back(
        {"peer: path lengths as a mask, OpenCV findContours",
         [&](const Rigid3& pose) { require(maskContours(projector->project(carm, pose)) > 0, "findContours"); }, 5});

    // A stem of 12,000 triangles with its head in a cavity of the next size; the CT is of 0.8 mm voxels.
    const auto implant = loadImplant("straight", {.size = "12"});
    const auto wider = loadImplant("straight", {.size = "13"});
    require(implant.ok() && wider.ok(), "the implant");
    const auto solids = PlannedSolids::prepare(&*implant, &wider->in_bone);
    const auto view = PredictedView::prepare(Image(carm.columns, carm.rows, 1000), carm, {});
    require(solids.ok() && view.ok(), "preparing the prediction");
    Random random(1);
    VolumeGrid grid;
    grid.size = {160, 160, 400};
    grid.spacing_mm = {0.8, 0.8, 0.8};
    std::vector<float> hounsfield(grid.voxelCount());
    for (float& value : hounsfield)
        value = static_cast<float>(random.uniform(-100, 700));
    const auto predict = [&](bool with_ct) {
        return [&, with_ct](const Rigid3& pose) {
            // The CT lies round the implant wherever that is seen.
            const Volume* ct = nullptr;
            Volume around;
            if (with_ct) {
                VolumeGrid placed = grid;
                placed.direction = pose.rotationMatrix();
                placed.origin_mm = pose * Vector3(-64, -64, -200);
                around = Volume(placed, std::move(hounsfield));
                ct = &around;
            }
            const auto plan = placePlan(*solids, pose, ct);
            require(plan.ok() && view->predict(*solids, *plan).ok(), "the predicted image");
            if (with_ct) hounsfield = std::move(around.voxels());
        };
    };
    rows.push_back({"predicted image, without CT", predict(false), 10});
    rows.push_back({"predicted image, with CT", predict(true), 10});

    for (int round = 0; round < rounds; ++round) {
        for (const Rigid3& pose : poses) {
            for (Row& row : rows) {
                for (int repeat = 0; repeat < row.repeats; ++repeat) {
                    const std::clock_t busy = std::clock();
                    const Stopwatch stopwatch;
                    row.run(pose);
                    row.ms.push_back(stopwatch.ms());
                    row.processor_ms.push_back(1e3 * static_cast<double>(std::clock() - busy) / CLOCKS_PER_SEC);
                }
            }
        }
    }
    fmt::print("Stem of {} triangles, image {} x {}, {} threads, {} rounds of {} poses\n\n", mesh.triangles.size(),
               carm.columns, carm.rows, parallelThreads(), rounds, poses.size());
    fmt::print("| | ms (median) | processor ms | times the silhouette |\n|---|---:|---:|---:|\n");
    for (const Row& row : rows)
        fmt::print("| {} | {:.3f} | {:.3f} | {:.1f} |\n", row.what, median(row.ms), median(row.processor_ms),
                   median(row.ms) / median(rows.front().ms));
    return 0;
}
