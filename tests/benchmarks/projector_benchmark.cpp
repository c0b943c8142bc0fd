// The CT projector beside its open peers in one run: time of one projection of a prepared volume and error against the
// closed form of Gaussian blobs. Prints a Markdown table.
//
//     projector_benchmark [rounds]
//
// Each round takes every program over the same views, so that a change of the machine's speed meets all of them. Times
// are medians over rounds and views; a program's own start and the reading of the volume are not counted.
#include <algorithm>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/parallel.h"
#include "core/base/stopwatch.h"
#include "core/imaging/volume_projector.h"
#include "tests/benchmarks/itk_ray_cast.h"
#include "tests/core/imaging/blob_volumes.h"
#include "tests/support/fixtures.h"
#include "tests/support/peers/plastimatch.h"

using namespace fluorocut;

namespace {

struct Timed {
    Image image;
    double ms = 0;
};

Timed timed(const std::function<Image()>& project) {
    const Stopwatch stopwatch;
    Timed result{project(), 0};
    result.ms = stopwatch.ms();
    return result;
}

benchmark::ItkView itkView(const CArm& carm, const Rigid3& imager_from_volume) {
    const Rigid3 volume_from_imager = imager_from_volume.inverse();
    const Vector3 source = volume_from_imager.translation();
    const Vector3 corner = volume_from_imager * carm.detectorPoint(Vector2::Zero());
    benchmark::ItkView view{{source.x(), source.y(), source.z()},
                            {corner.x(), corner.y(), corner.z()},
                            {},
                            {carm.pixel_mm.x(), carm.pixel_mm.y()},
                            carm.columns,
                            carm.rows};
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(view.direction.data()) =
        volume_from_imager.rotationMatrix();
    return view;
}

struct Row {
    std::string program;
    std::function<Timed(const CArm&, const Rigid3&)> run;
    int repeats;                 // per view and round
    bool in_closed_form = true;  // the image is comparable with the closed form of the full image
    std::vector<double> ms = {};
    double worst_error = 0;
};

}  // namespace

int main(int argc, char** argv) {
    const int rounds = argc > 1 ? std::atoi(argv[1]) : 3;
    if (rounds < 1) {
        fmt::print(stderr, "usage: projector_benchmark [rounds]\n");
        return 2;
    }
    const std::vector<test::Blob> blobs{{{7.3, -11.7, 4.9}, 20, 10000}};
    const VolumeGrid grid = test::centeredGrid({256, 256, 256}, {1, 1, 1});
    const auto volume = test::makeBlobs(grid, blobs);
    CArm carm;
    carm.pixel_mm = {0.8, 0.8};
    std::vector<Rigid3> views;
    for (const double angle : {5.0, 65.0, 125.0, 185.0, 245.0})
        views.push_back(test::orbit(angle, 12));

    const Stopwatch stopwatch;
    const Result<VolumeProjector> projector = VolumeProjector::prepare(volume);
    const double prepare_ms = stopwatch.ms();
    if (!projector) return 1;

    const auto ours = [&](ProjectionOptions options) {
        return [&, options](const CArm& c, const Rigid3& pose) {
            return timed([&] { return projector->project(c, pose, options); });
        };
    };
    std::vector<Row> rows;
    rows.push_back({"FluoroCut, fast", ours({}), 15});
    rows.push_back({"FluoroCut, fast, with six derivatives",
                    [&](const CArm& c, const Rigid3& pose) {
                        return timed([&] { return projector->projectWithGradient(c, pose).image; });
                    },
                    5});
    rows.push_back({"FluoroCut, fast, 4-fold binning", ours({ProjectionMethod::fast, 4, {}}), 15, false});
    rows.push_back({"FluoroCut, fast, one thread",
                    [&](const CArm& c, const Rigid3& pose) {
                        const ThreadLimit one(1);
                        return timed([&] { return projector->project(c, pose); });
                    },
                    5});
    rows.push_back({"FluoroCut, exact", ours({ProjectionMethod::exact, 1, {}}), 1});

    // The same object in a volume with twice the air around it on every side: empty space costs nothing.
    const auto object = test::makeBlobs(test::centeredGrid({128, 128, 128}, {1, 1, 1}), {{{0, 0, 0}, 9, 10000}});
    const auto roomy = test::makeBlobs(test::centeredGrid({384, 384, 384}, {1, 1, 1}), {{{0, 0, 0}, 9, 10000}});
    const Result<VolumeProjector> tight_projector = VolumeProjector::prepare(object);
    const Result<VolumeProjector> roomy_projector = VolumeProjector::prepare(roomy);
    if (!tight_projector || !roomy_projector) return 1;
    for (const auto& [name, other] : {std::pair("FluoroCut, fast, small object in 128^3", &*tight_projector),
                                      std::pair("FluoroCut, fast, the same in 384^3", &*roomy_projector)}) {
        rows.push_back(
            {name,
             [other](const CArm& c, const Rigid3& pose) { return timed([&] { return other->project(c, pose); }); }, 15,
             false});
    }

    Volume density = *volume;
    for (float& value : density.voxels())
        value += 1000;
    const benchmark::ItkRayCast itk(density.voxels(), grid.size, {1, 1, 1},
                                    {grid.origin_mm.x(), grid.origin_mm.y(), grid.origin_mm.z()});
    rows.push_back({"ITK RayCastInterpolateImageFunction",
                    [&](const CArm& c, const Rigid3& pose) {
                        return timed([&] { return Image(c.columns, c.rows, itk.project(itkView(c, pose))); });
                    },
                    1});
    const test::ScratchFolder scratch;
    if (test::plastimatchIsInstalled()) {
        test::writeForPlastimatch(*volume, scratch / "density.mha");
        rows.push_back({"plastimatch drr, exact",
                        [&](const CArm& c, const Rigid3& pose) {
                            test::PlastimatchProjection peer =
                                test::runPlastimatch(scratch / "density.mha", c, pose, scratch.path());
                            return Timed{std::move(peer.line_integrals), peer.elapsed_ms};
                        },
                        1});
    } else {
        fmt::print(stderr, "plastimatch is not installed: left out\n");
    }

    for (int round = 0; round < rounds; ++round) {
        for (const Rigid3& pose : views) {
            const Image closed_form = test::blobIntegrals(blobs, carm, pose);
            for (Row& row : rows) {
                for (int repeat = 0; repeat < row.repeats; ++repeat) {
                    Timed result = row.run(carm, pose);
                    row.ms.push_back(result.ms);
                    if (repeat > 0 || !row.in_closed_form) continue;
                    if (!row.program.starts_with("FluoroCut")) {  // peers integrate HU + 1000
                        for (float& value : result.image.pixels())
                            value *= static_cast<float>(test::kMuWater / 1000);
                    }
                    row.worst_error = std::max(row.worst_error, test::normalizedRms(result.image, closed_form));
                }
            }
        }
    }

    fmt::print(
        "512 x 512 image of a 256^3 volume (float32), {} threads, {} rounds of {} views; preparing it once: {:.0f} "
        "ms\n\n",
        parallelThreads(), rounds, views.size(), prepare_ms);
    fmt::print(
        "| program | ms (median) | times as long as FluoroCut | normalised RMS error, worst view "
        "|\n|---|---:|---:|---:|\n");
    const double reference = median(rows.front().ms);
    for (const Row& row : rows) {
        const double ms = median(row.ms);
        fmt::print("| {} | {:.2f} | {:.2f} | {} |\n", row.program, ms, ms / reference,
                   row.in_closed_form ? fmt::format("{:.1e}", row.worst_error) : "");
    }
    return 0;
}
