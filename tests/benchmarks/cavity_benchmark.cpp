// Distances to a stem of 50,000 triangles, and cavities planned from stems. Prints a Markdown table.
//
//     cavity_benchmark [rounds]
//
// Times are medians over rounds, on all cores where the work is parallel (distances at single points are not).
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/geometry/mesh_distance.h"
#include "core/geometry/primitives.h"
#include "core/planning/cavity.h"
#include "tests/benchmarks/timing.h"

using namespace fluorocut;
using benchmark::medianMs;

namespace {

// Points about so far from places spread over the surface.
std::vector<Vector3> pointsNear(const TriangleMesh& mesh, double distance_mm, int count) {
    Random random(1);
    std::vector<Vector3> points;
    for (int n = 0; n < count; ++n) {
        const auto& triangle = mesh.triangles[static_cast<std::size_t>(random.below(mesh.triangles.size()))];
        const Vector3 off(random.normal(), random.normal(), random.normal());
        points.push_back(mesh.vertices[static_cast<std::size_t>(triangle[0])] + distance_mm / std::sqrt(3.0) * off);
    }
    return points;
}

}  // namespace

int main(int argc, char** argv) {
    const int rounds = argc > 1 ? std::atoi(argv[1]) : 5;
    if (rounds < 1) {
        fmt::print(stderr, "usage: cavity_benchmark [rounds]\n");
        return 2;
    }
    StemShape shape;
    shape.sections = 200;
    shape.segments = 128;
    const TriangleMesh stem = makeStem(shape);
    fmt::print("{} threads\n\n| what | ms |\n|---|---|\n", parallelThreads());
    const auto row = [](const std::string& what, double ms) { fmt::print("| {} | {:.1f} |\n", what, ms); };

    row(fmt::format("tree of {} triangles", stem.triangles.size()),
        medianMs(rounds, [&] { (void)MeshDistance::build(stem); }));
    const Result<MeshDistance> distance = MeshDistance::build(stem);
    if (!distance) return 1;
    double sum = 0;  // so that nothing is left out
    for (const double off : {0.5, 3.0, 10.0}) {
        const std::vector<Vector3> points = pointsNear(stem, off, 100000);
        row(fmt::format("100,000 signed distances at {:g} mm", off), medianMs(rounds, [&] {
                for (const Vector3& p : points)
                    sum += distance->signedDistance(p);
            }));
    }
    for (const double length : {118.0, 250.0}) {
        shape.length_mm = length;
        const TriangleMesh implant = makeStem(shape);
        Result<Cavity> cavity = planCavity(implant);
        if (!cavity) return 1;
        row(fmt::format("cavity of a stem of {:g} mm, 0.5 mm voxels", length),
            medianMs(rounds, [&] { cavity = planCavity(implant); }));
        row("a stage of it", medianMs(rounds, [&] { (void)insetCavity(*cavity, 1); }));
    }
    return std::isfinite(sum) ? 0 : 1;
}
