// May this path be run? Two checks, written independently of each other, ask of every move whether the cutter, ball and
// shank, stays inside the envelope; a path is checked only when both say yes of every move.
//
//   mesh    distance of the sweep's parallelogram to the triangles of the envelope's walls, through a tree of boxes;
//           exact, intersections included. Inside: the spindle's axis goes out through the open end and meets no wall.
//           Knows nothing of grids.
//   voxels  the envelope filled into voxels (core/image/voxelize.h), an exact Euclidean distance transform of what is
//           outside, and the sweep sampled at half a voxel. Knows nothing of triangles' distances.
//
// The envelope is what may be cut: the final cavity, and above its top the way through which the cutter comes. It is a
// closed mesh with a flat, level face as its highest: its open end, which is no wall. Above the open end nothing is
// asked of the shank; the ball's centre must stay below it. `openedUpward` makes one of a cavity's mesh. Frame
// `cavity`, mm.
//
// A move is refused, by both checks, whose numbers are not finite, whose spindle is no unit vector or leans by more
// than 60 degrees, which does not begin where the last one ended, whose feed is not positive, or for which the shank is
// too short to reach the open end; also one that turns the spindle anywhere but within 2 mm of the open end.
//
// What the checks may miss. Mesh: nothing beyond rounding. Voxels of h mm: the surface is placed in every voxel it cuts
// by the voxel's filled part, exact for a plane and within 0.1 h for walls no sharper than the cutter; between samples
// h/2 apart the cutter may reach h/8 farther; 0.25 h in all, which is its tolerance on top of `tolerance_mm`: so it
// refuses all that reaches tolerance + 0.5 h beyond, and nothing that stays within the tolerance.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/cutting/tool_path.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

struct EnvelopeOptions {
    double tolerance_mm = 0.05;  // by which the cutter may reach beyond the envelope
    double voxel_mm = 0.25;      // of the voxel check

    Result<void> validate() const;
};

struct EnvelopeVerdict {
    std::vector<bool> inside;  // of every move
    // Farthest that the cutter reaches beyond the envelope, infinite for a move that is refused for its numbers;
    // negative: room left (the mesh check looks no farther than 0.5 mm, the voxel check loses count of more).
    double worst_mm = std::numeric_limits<double>::quiet_NaN();
    std::size_t worst_move = 0;

    bool passed() const;  // every move, and there are some
};

// The cavity's mesh with its flat top raised to `open_mm`, the walls between straight up. invalidInput when its highest
// face is not flat, or not below open_mm.
Result<TriangleMesh> openedUpward(const TriangleMesh& cavity, double open_mm);

// invalidInput when the envelope is no closed surface or has no open end, when the path is empty, or when the envelope
// would need more than 2^27 voxels.
Result<EnvelopeVerdict> checkByMesh(const ToolPath& path, const TriangleMesh& envelope,
                                    const EnvelopeOptions& options = {}, Progress& progress = Progress::none());
Result<EnvelopeVerdict> checkByVoxels(const ToolPath& path, const TriangleMesh& envelope,
                                      const EnvelopeOptions& options = {}, Progress& progress = Progress::none());

// A path that both checks passed. Only checkToolPath makes one.
class CheckedToolPath {
  public:
    const ToolPath& path() const { return path_; }
    double worstByMesh() const { return by_mesh_mm_; }
    double worstByVoxels() const { return by_voxels_mm_; }

  private:
    friend Result<CheckedToolPath> checkToolPath(ToolPath, const Cutter&, const TriangleMesh&, const EnvelopeOptions&,
                                                 Progress&);
    CheckedToolPath(ToolPath path, double by_mesh_mm, double by_voxels_mm)
        : path_(std::move(path)), by_mesh_mm_(by_mesh_mm), by_voxels_mm_(by_voxels_mm) {}

    ToolPath path_;
    double by_mesh_mm_, by_voxels_mm_;
};

// `mounted`: the cutter in the spindle; a path planned for another one is invalidInput. noSolution names the first move
// that either check refuses.
Result<CheckedToolPath> checkToolPath(ToolPath path, const Cutter& mounted, const TriangleMesh& envelope,
                                      const EnvelopeOptions& options = {}, Progress& progress = Progress::none());

}  // namespace fluorocut
