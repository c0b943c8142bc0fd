// A 118 mm stem from its mesh to a path that may be run: the time of every step and what the path leaves. Prints a
// Markdown table.
//
//     cutting_benchmark [rounds]
#include <algorithm>
#include <cstdlib>

#include <fmt/format.h>

#include "core/base/parallel.h"
#include "core/cutting/envelope_check.h"
#include "core/cutting/removal.h"
#include "core/geometry/primitives.h"
#include "core/planning/cavity.h"
#include "tests/benchmarks/timing.h"

using namespace fluorocut;
using benchmark::medianMs;

namespace {

// Ends the program with the error's sentence: there is nothing to measure then.
template <class T>
T valueOf(Result<T> result) {
    if (result) return std::move(*result);
    fmt::print(stderr, "{}\n", result.error().message());
    std::exit(1);
}

void row(const Cavity& cavity, const char* name, const ToolPathOptions& options, int rounds) {
    const auto plan = [&] { return valueOf(planToolPath(cavity.field, cavity.mesh, cavity.top_mm, options)); };
    const ToolPath path = plan();
    const TriangleMesh envelope = valueOf(openedUpward(cavity.mesh, options.openPlane(cavity.top_mm)));
    const RemovalReport report = valueOf(simulateRemoval(path, cavity.mesh, cavity.top_mm));
    const EnvelopeVerdict mesh = valueOf(checkByMesh(path, envelope)), voxels = valueOf(checkByVoxels(path, envelope));
    VolumeGrid ct;
    ct.size = {80, 80, 200};
    ct.spacing_mm = Vector3::Constant(0.7);
    ct.origin_mm = {-28, -28, -130};
    fmt::print(
        "| {} | {} | {:.0f} | {:.0f} | {:.0f} | {:.0f} | {:.0f} | {:.0f} | {:.0f} | {:.3f} | {:.3f} | {:.3f} | {:.3f} "
        "| {:.3f} |\n",
        name, path.moves.size(), path.time_s, medianMs(rounds, plan),
        medianMs(rounds, [&] { valueOf(planToolPath(cavity.field, cavity.top_mm, options)); }),
        medianMs(rounds, [&] { valueOf(checkByMesh(path, envelope)); }),
        medianMs(rounds, [&] { valueOf(checkByVoxels(path, envelope)); }),
        medianMs(rounds, [&] { valueOf(simulateRemoval(path, cavity.mesh, cavity.top_mm)); }),
        medianMs(rounds, [&] { removedFraction(path, Rigid3(), ct); }), report.left_95_mm, report.outside_cusps_95_mm,
        report.most_beyond_mm, mesh.worst_mm, voxels.worst_mm);
}

}  // namespace

int main(int argc, char** argv) {
    const int rounds = argc > 1 ? std::max(1, std::atoi(argv[1])) : 3;
    const Cavity final = valueOf(planCavity(makeStem()));
    fmt::print("Stem of 118 mm, cavity of {:.0f} mm3 and {} triangles, {} threads, medians of {}\n\n", final.volume_mm3,
               final.mesh.triangles.size(), parallelThreads(), rounds);
    fmt::print(
        "| path | moves | cutting s | plan ms | plan (field) ms | check by mesh ms | by voxels ms | removal of 20,000 "
        "points "
        "ms | removed in CT ms | left 95 % mm | outside cusps mm | most beyond mm | worst by mesh | worst by voxels "
        "|\n");
    fmt::print("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    ToolPathOptions options;
    row(final, "as shipped", options, rounds);
    options.step_down_mm = 0.5;
    options.step_over_mm = 1;
    options.most_cusp_mm = 0.02;
    options.tolerance_mm = 0.005;
    row(final, "fine", options, rounds);
    row(valueOf(insetCavity(final, 1)), "first stage, inset by 1 mm", {}, rounds);
    return 0;
}
