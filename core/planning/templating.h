// Templating: which size of a stem to begin with, and where. The largest size that has a pose in which it lies in the
// canal, reaches into the cortex by no more than `most_reaming_mm` and, wherever it does, leaves a wall of at least
// `least_wall_mm`; in the pose with the most even room (core/planning/stem_fit.h). A starting point that the surgeon
// moves, and no more.
//
// What may be filled, as an excess (mm; c, o: signed distances to the canal and to the outer surface, negative inside):
//     e = max(c - most_reaming, min(c, o + least_wall))
// so that a thin wall that is not cut into does not count. Sizes are tried from the largest downward; the first that
// fits is proposed, the one below is offered too, and for those that do not fit the place and the reason are said.
//
// (a) from a CT: core/planning/bone_walls.h gives c and o.
// (b) from two views or more: the walls of the canal as polylines in the images, drawn or detected. A point's excess is
//     that of its projection, the worst of all views, distances in the image brought to the point's own depth (z / f):
//     the stem's silhouette lies between the lines. What no view shows (corners of a canal that is no ellipse) is not
//     known, and the outer surface only where it is drawn.
//
// Frame `femur`; stems in `cavity` (core/planning/implant.h), the resection's plane at their z = resection_z_mm is laid
// on the seat. mm.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/imaging/rays.h"
#include "core/planning/bone_walls.h"
#include "core/planning/implant.h"

namespace fluorocut {

struct TemplateOptions {
    double least_wall_mm = 2;
    double most_reaming_mm = 1.5;
    double tolerance_mm = 0.05;  // of the excess: what walls and fields are true to
    int points = 1500;           // of the stem's surface, in the search
    double level_step_mm = 10;   // of the fill's table

    Result<void> validate() const;
};

// Where a stem is put in.
struct StemSeat {
    Vector3 point = Vector3::Zero();    // on the canal's axis, at the level of the resection
    Vector3 axis = Vector3::UnitZ();    // unit, proximal
    Vector3 medial = Vector3::UnitX();  // toward the head
    Side side = Side::left;

    Rigid3 femurFromCavity(double resection_z_mm = 0) const;
};

struct FillLevel {
    double below_mm = 0;  // the resection, along the stem
    Vector2 stem_mm;      // widths of stem and canal: medio-lateral (the stem's x), antero-posterior (its y)
    Vector2 canal_mm;
    double area = std::numeric_limits<double>::quiet_NaN();  // of the stem's section over the canal's; from views the
                                                             // product of the widths' ratios
    double medioLateral() const { return stem_mm.x() / canal_mm.x(); }
    double anteroPosterior() const { return stem_mm.y() / canal_mm.y(); }
};

// The thinnest wall beside the stem. Where the stem reaches into the cortex (`cut`) what it leaves, else the wall
// there.
struct LeastWall {
    double thickness_mm = std::numeric_limits<double>::quiet_NaN();
    Vector3 place = Vector3::Zero();  // femur, on the stem's surface
    double below_mm = 0;              // the resection
    std::string side;                 // "medial", "antero-lateral", ...
    bool cut = false;
};

struct SizeTrial {
    std::string size;
    bool fits = false;
    double excess_mm = std::numeric_limits<double>::quiet_NaN();  // negative: room left all round
    Rigid3 femur_from_cavity;
    std::string reason;  // why it does not fit, a sentence
};

struct TemplateProposal {
    std::string size;
    Rigid3 femur_from_cavity;
    double excess_mm = std::numeric_limits<double>::quiet_NaN();
    std::vector<FillLevel> fill;
    LeastWall least_cut;   // where the stem cuts into the cortex; NaN: it does not, or the outer surface is not known
    LeastWall least_wall;  // anywhere beside the stem
    std::string next_size_reason;   // why the next larger does not fit; empty: there is none
    std::vector<SizeTrial> trials;  // from the largest tried to the one below the proposal
    std::vector<std::string> warnings;
    double elapsed_ms = std::numeric_limits<double>::quiet_NaN();
};

// `sizes` from small to large, made for the seat's side. noSolution when none fits: says why not the smallest.
Result<TemplateProposal> proposeStem(const std::vector<Implant>& sizes, const BoneWalls& walls, const StemSeat& seat,
                                     const TemplateOptions& options = {}, Progress& progress = Progress::none());

enum class WallSide { medial, lateral, anterior, posterior };
std::string_view name(WallSide side);

struct DrawnWall {
    WallSide side = WallSide::medial;
    bool outer = false;           // the bone's outer surface; otherwise the canal's wall
    std::vector<Vector2> pixels;  // from proximal to distal
};
struct CanalView {
    std::string name;
    View view;                     // imager_from_femur
    std::vector<DrawnWall> walls;  // both walls of the canal: medial and lateral, or anterior and posterior
};

// Axis from the canal's middle lines (each view's lie in a plane through its source; two planes meet in the axis),
// version and side from which wall is which, level from the walls' proximal ends. invalidInput names view and wall.
Result<StemSeat> seatFromViews(const std::vector<CanalView>& views);

Result<TemplateProposal> proposeStem(const std::vector<Implant>& sizes, const std::vector<CanalView>& views,
                                     const StemSeat& seat, const TemplateOptions& options = {},
                                     Progress& progress = Progress::none());

}  // namespace fluorocut
