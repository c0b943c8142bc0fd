// From a case to what is seen of it in three dimensions:
//
//   bone       the CT's outer surface, translucent, more so where it faces the viewer
//   implant    opaque, with its head
//   cavities   the stages, one in the other, translucent
//   views      for every C-arm pose that is known: the cone from the source to the detector, and on the detector the
//              latest image, seen from the source's side
//   path       of the tool
//   robot      the cutter and what holds it
//
// What is made of an image or a mesh is kept as long as the case has that image or mesh, so that a moved implant costs
// nothing. The CT's surface takes a while: boneOf() is for a thread of its own.
#pragma once

#include <map>
#include <memory>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "ui/scene/scene.h"
#include "ui/session/case_state.h"

namespace fluorocut::ui {

// Null when the CT shows no bone.
Result<std::shared_ptr<const ShadedMesh>> boneOf(const Volume& ct, Progress& progress);

class SceneBuilder {
  public:
    // What boneOf() has made of this CT.
    void setBone(std::shared_ptr<const Volume> ct, std::shared_ptr<const ShadedMesh> surface);
    bool hasBone(const std::shared_ptr<const Volume>& ct) const { return ct == ct_; }

    Scene build(const CaseState& state);

  private:
    // Made of a case's value, which is kept too: so its address stays its own.
    template <class Source, class Made>
    struct Kept {
        std::shared_ptr<const Source> source;
        Made made;
        bool used = false;
    };
    template <class Source, class Made>
    using Keep = std::map<const void*, Kept<Source, Made>>;
    template <class Source, class Made, class Make>
    static const Made& keep(Keep<Source, Made>& kept, const std::shared_ptr<const Source>& source, const Make& make);

    // What does not change while the C-arm stays as it is and has the same image: in the imager's frame.
    struct KeptView {
        CArm carm;
        std::shared_ptr<const Image> image;
        std::vector<SceneItem> items;
        bool used = false;
    };

    void addImplant(const ImplantPlan& plan, Scene& scene);
    void addCavities(const ImplantPlan& plan, Scene& scene);
    void addView(const CaseView& view, Scene& scene);
    void addRobot(const CaseState& state, Scene& scene);

    // Items here have their surface or lines and know their size; colour and place follow.
    std::shared_ptr<const Volume> ct_;
    SceneItem bone_;
    Keep<TriangleMesh, SceneItem> meshes_;
    Keep<Implant, SceneItem> heads_;
    Keep<std::vector<Vector3>, SceneItem> paths_;
    std::vector<KeptView> views_;
    SceneItem cutter_;
    double cutter_radius_mm_ = 0;
};

}  // namespace fluorocut::ui
