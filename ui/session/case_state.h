// CaseState: all that the desktop shows of a case, as one value. It is never changed: an edit makes a new one, which
// shares with the old whatever it does not touch (images, volumes and meshes are behind pointers to const), so that a
// state costs little, undoing is going back to one, and a job on another thread may keep the one that it was given.
//
// Frames as in core/geometry/frames.h; mm, rad.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/image.h"
#include "core/image/volume.h"
#include "core/imaging/carm.h"
#include "core/imaging/carm_position.h"
#include "core/planning/implant.h"

namespace fluorocut::ui {

// A picture, and where the bone was in it.
struct TakenImage {
    std::shared_ptr<const Image> image;
    std::optional<Pose> imager_from_femur;
    std::string unregistered_because;           // when there is no pose
    double registration_mm = 0;                 // rms of what the pose was found with
    std::optional<Pose> imager_from_corkscrew;  // where the fiducial was seen
};

// One C-arm pose: a row of the spreadsheet.
struct CaseView {
    std::string name;  // "AP"
    CArmPosition position;
    CArm carm;
    TakenImage before;
    std::vector<TakenImage> after;  // one for every cut so far
};

struct ImplantPlan {
    std::string family, size;                  // as core/planning knows them
    double head_mm = 32, neck_mm = 0;          // the head's diameter, and what it adds to the neck's length
    std::shared_ptr<const TriangleMesh> mesh;  // frame `cavity`; null: none is chosen
    std::shared_ptr<const Implant> implant;    // whose stem the mesh is; null: nothing but the mesh is known
    Rigid3 femur_from_implant;
    bool locked = false;  // cutting goes by it: nothing of it may be changed
    double cutter_radius_mm = 3;
    std::vector<double> insets_mm;                              // of the stages, falling to 0
    std::vector<std::shared_ptr<const TriangleMesh>> cavities;  // of the stages; empty: not worked out for this plan
    std::shared_ptr<const std::vector<Vector3>> tool_path;      // of the ball's centre, frame `cavity`; null: none
};

// The middle of the femur's canal, in `femur`.
struct CanalAxis {
    Vector3 distal, proximal;
};

enum class MeasureKind { length, angle };

// Between points on one image, at the depth of its plane (core/planning/measures.h).
struct PlacedMeasure {
    MeasureKind kind = MeasureKind::length;
    std::size_t view = 0;
    std::vector<Vector2> points_px;  // two, or four: two lines
};

// A place of the body, where it was clicked in one image.
struct SeenPoint {
    std::size_t view = 0;
    Vector2 at_px = Vector2::Zero();
};

struct CaseState {
    std::string patient, side;
    std::string calibrated_utc;        // empty: not calibrated
    std::shared_ptr<const Volume> ct;  // null: none
    double mu_water_per_mm = 0.02;
    std::optional<CanalAxis> canal;
    std::vector<Vector3> beads;                   // on the femur, frame `femur`
    std::vector<std::vector<Vector3>> corkscrew;  // the lines of its wires, frame `corkscrew`
    std::vector<CaseView> views;
    ImplantPlan plan;
    std::vector<PlacedMeasure> measures;
    std::vector<SeenPoint> head_center;       // of the femur's own head, at most one click in each view
    std::vector<Pose> found_cavities;         // femur_from_cavity after each cut, with covariance
    std::optional<Rigid3> femur_from_cutter;  // where the robot says that its cutter is
};

}  // namespace fluorocut::ui
