// What the case says is to be seen in a picture: silhouettes of implant and cavities, axes, fiducials, and how well
// their places are known, as curves and points in the picture's own pixels.
//
//   implant      the stem's outline where the plan has it
//   stages       the outlines of the cavities to be cut
//   axis         the middle of the canal, and the stem's own axis
//   beads, corkscrew   where the poses put the fiducials
//   cavity       the cavity as it was found (found) and as it was planned (predicted), for a picture after a cut
//   uncertainty  95 % ellipses of what the poses leave open: of the found cavity's top and tip, or else of the plan's
//
// All follow the distortion of the imager. Silhouettes need their meshes prepared, which takes a while once for each
// mesh and happens on another thread: until then they are absent, and `Silhouettes::prepared` says when to ask again.
#pragma once

#include <QObject>
#include <QString>
#include <array>
#include <list>
#include <memory>
#include <optional>

#include "core/geometry/pose.h"
#include "core/imaging/carm.h"
#include "core/imaging/silhouette.h"
#include "ui/session/case_state.h"
#include "ui/session/job_runner.h"
#include "ui/spreadsheet/overlay.h"

namespace fluorocut::ui {

enum class OverlayKind { implant, stages, axis, beads, corkscrew, cavity, uncertainty };
inline constexpr std::array kOverlayKinds{OverlayKind::implant,    OverlayKind::stages,    OverlayKind::axis,
                                          OverlayKind::beads,      OverlayKind::corkscrew, OverlayKind::cavity,
                                          OverlayKind::uncertainty};
const char* name(OverlayKind kind);  // in files
QString titleOf(OverlayKind kind);
Ink inkOf(OverlayKind kind);

// How points come into a picture.
struct Picture {
    CArm carm;
    std::optional<Pose> imager_from_femur, imager_from_corkscrew;
    int cut = 0;  // that it was taken after; 0: before the first
};

class Silhouettes : public QObject {
    Q_OBJECT

  public:
    explicit Silhouettes(QObject* parent = nullptr);

    // Null while the mesh is being prepared, and for one that is no closed solid.
    const Silhouette* find(const std::shared_ptr<const TriangleMesh>& mesh);

  signals:
    void prepared();

  private:
    struct Known {
        std::shared_ptr<const TriangleMesh> mesh;
        std::optional<Result<Silhouette>> silhouette;  // nothing: not yet
    };
    void startNext();

    std::list<Known> known_;  // the latest asked for first
    JobRunner jobs_;
};

// Empty for a mesh without vertices. Asked for again and again while something is dragged: the latest is remembered.
Eigen::AlignedBox3d boundsOf(const std::shared_ptr<const TriangleMesh>& mesh);

Overlay overlayOf(OverlayKind kind, const CaseState& state, const Picture& picture, Silhouettes& silhouettes);

}  // namespace fluorocut::ui
