// May this path be run? Two checks, written independently of each other, ask of every move whether the cutter, ball and
// shank, stays inside the envelope; a path is checked only when both say yes of every move.
//
//   mesh    distance of the sweep's parallelogram to every triangle of the envelope's surface, through a tree of boxes;
//           exact, and its first place is inside. Knows nothing of grids.
//   voxels  the envelope's surface mesh filled into voxels (core/image/voxelize.h), an exact Euclidean distance
//           transform of what is outside, and the sweep sampled at half a voxel. Knows nothing of triangles' distances.
//
// The envelope is what may be cut: the final cavity, and above its top the way through which cutter and stem come, open
// far enough for the shank. Frame `cavity`, mm. NaN anywhere fails.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/cutting/tool_path.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

struct EnvelopeOptions {
    double tolerance_mm = 0.05;  // by which the cutter may reach beyond the envelope
    double voxel_mm = 0.25;      // of the voxel check; its own tolerance is tolerance_mm plus what a voxel hides

    Result<void> validate() const;
};

struct EnvelopeVerdict {
    std::vector<bool> inside;  // of every move
    double worst_mm;           // farthest that the cutter reaches beyond the envelope (negative: room left)
    std::size_t worst_move = 0;

    bool passed() const;
};

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
    friend Result<CheckedToolPath> checkToolPath(ToolPath, const TriangleMesh&, const EnvelopeOptions&, Progress&);
    CheckedToolPath(ToolPath path, double by_mesh_mm, double by_voxels_mm)
        : path_(std::move(path)), by_mesh_mm_(by_mesh_mm), by_voxels_mm_(by_voxels_mm) {}

    ToolPath path_;
    double by_mesh_mm_, by_voxels_mm_;
};

// noSolution names the first move that either check refuses, or on which they disagree.
Result<CheckedToolPath> checkToolPath(ToolPath path, const TriangleMesh& envelope, const EnvelopeOptions& options = {},
                                      Progress& progress = Progress::none());

}  // namespace fluorocut
