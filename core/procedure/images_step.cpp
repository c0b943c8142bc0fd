// images k: a picture from every view, and where the robot stands meanwhile.
#include <algorithm>

#include <fmt/format.h>

#include "core/procedure/cut_run.h"
#include "core/procedure/steps.h"

namespace fluorocut {

Result<StepOutput> imagesStep(const ProcedureSetup& setup, int stage, const std::vector<std::string>& known_hashes,
                              const ProcedureEquipment& equipment, Progress& progress) {
    const Result<RobotFeedback> robot = whereItStands(*equipment.robot);
    if (!robot) return robot.error();
    if (stage == 0) {
        // From now on the bone is where this registration will have it.
        if (auto set = equipment.robot->setBoneReference(); !set) return set.error();
    }
    ImagesResult result;
    result.stage = stage;
    result.robot_from_flange = robot->robot_from_cutter * setup.calibration.flange_from_cutter.inverse();
    result.taken_utc = utcNow();
    StepOutput output;
    std::vector<std::string> known = known_hashes;
    for (std::size_t i = 0; i < setup.views.size(); ++i) {
        const ProcedureView& view = setup.views[i];
        const double share = 1.0 / static_cast<double>(setup.views.size());
        SubProgress part(progress, share * static_cast<double>(i), share * static_cast<double>(i + 1));
        ImageRequest request;
        if (equipment.images->capabilities().moves) request.position = view.position;
        Result<AcquiredImage> taken = equipment.images->acquire(request, part);
        if (!taken) {
            Error error = taken.error();
            error.where = fmt::format("image of the view {}: {}", view.name, error.where);
            return error;
        }
        if (taken->image.width() != view.carm.columns || taken->image.height() != view.carm.rows) {
            return invalidInput("image of the view " + view.name,
                                fmt::format("{} x {} pixels", taken->image.width(), taken->image.height()),
                                fmt::format("the calibrated {} x {}", view.carm.columns, view.carm.rows),
                                "calibrate the C-arm for this image size");
        }
        Result<CaseContentItem> item = imageItem(fmt::format("stage_{}_{}", stage, view.name), taken->image);
        if (!item) return item.error();
        TakenImage image;
        image.view = view.name;
        image.hash = item->hash();
        image.file_name = item->item.file_name;
        image.position = view.position;
        image.source = taken->provenance.source;
        image.identity = taken->provenance.identity;
        if (std::find(known.begin(), known.end(), image.hash) != known.end()) {
            result.findings.doubts.push_back(
                fmt::format("the image of the view {} is the same picture as one before", view.name));
        }
        known.push_back(image.hash);
        for (const std::string& warning : taken->provenance.warnings)
            result.findings.warnings.push_back(view.name + ": " + warning);
        result.images.push_back(std::move(image));
        output.products.push_back(std::move(*item));
    }
    // The robot must not have moved in the meantime: the registration would be of two places.
    const Result<RobotFeedback> after = whereItStands(*equipment.robot);
    if (!after) return after.error();
    const double moved = (after->robot_from_cutter.translation() - robot->robot_from_cutter.translation()).norm();
    result.findings.acceptance.push_back(atMost("robot's motion between the images", moved, 0.2, "mm"));
    result.findings.summary =
        fmt::format("{} image{} {}.", result.images.size(), result.images.size() == 1 ? "" : "s",
                    stage == 0 ? "before the first cut" : fmt::format("after the cut of {}", stageName(setup, stage)));
    output.json = jsonText(result);
    return output;
}

}  // namespace fluorocut
