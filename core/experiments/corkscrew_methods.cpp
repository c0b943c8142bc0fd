#include <memory>
#include <optional>

#include "core/experiments/corkscrew_experiment.h"
#include "core/fiducial/corkscrew_closed_form.h"

namespace fluorocut {

std::vector<PoseFromImage> corkscrewMethods(const CorkscrewPoseOptions& options) {
    const auto last = std::make_shared<std::optional<Rigid3>>();
    const auto ours = [=](const Image& image, const CArm& carm, const CorkscrewLayout& layout) -> Result<Rigid3> {
        last->reset();
        const Result<CorkscrewPose> pose = estimateCorkscrewPose(image, carm, layout, options);
        if (!pose) return pose.error();
        *last = pose->imager_from_corkscrew.target_from_source;
        if (accepted(pose->acceptance)) return **last;
        return noSolution("corkscrew pose", "an answer that is not accepted", "one within its limits");
    };
    const auto closed_form = [=](const Image& image, const CArm& carm,
                                 const CorkscrewLayout& layout) -> Result<Rigid3> {
        if (!*last) return noSolution("closed form", "no corkscrew", "one that was found before");
        const Result<CorkscrewFeatures> features = measureCorkscrewFeatures(image, carm, layout, **last);
        if (!features) return features.error();
        return closedFormCorkscrewPose(*features, layout, carm.focal_length_mm);
    };
    return {ours, closed_form};
}

}  // namespace fluorocut
