#include "core/procedure/steps.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "core/cutting/tool_path_file.h"
#include "core/io/mesh_file.h"

namespace fluorocut {

std::string StepInputs::hash(const std::string& role) const {
    for (const StepInput& input : inputs_)
        if (input.role == role) return input.hash;
    return {};
}

Result<std::string> StepInputs::bytes(const std::string& role) const {
    const std::string found = hash(role);
    if (found.empty())
        return invalidInput("case, inputs of a step", "no " + role, "one", "begin the procedure in a new case");
    return content_(found);
}

std::string stageName(const ProcedureSetup& setup, int stage) {
    return fmt::format("stage {} of {}", stage, setup.plan.stages);
}

Matrix6 processCovariance(const ProcedureSetup& setup, double bone_rms_mm, double bone_rms_rad) {
    const ProcedureCalibration& robot = setup.calibration;
    Vector6 variance;
    variance << Vector3::Constant((robot.robot_sigma_mm * robot.robot_sigma_mm + bone_rms_mm * bone_rms_mm) / 3),
        Vector3::Constant((robot.robot_sigma_rad * robot.robot_sigma_rad + bone_rms_rad * bone_rms_rad) / 3);
    return variance.asDiagonal();
}

Pose announcedPlace(const ProcedureSetup& setup, const Pose& robot_from_femur) {
    Pose place =
        robot_from_femur * Pose{Frame::femur, Frame::cavity, setup.plan.femur_from_cavity, Matrix6(Matrix6::Zero())};
    if (place.covariance) *place.covariance += processCovariance(setup);
    return place;
}

std::string boundAgainstRoom(const ProcedureSetup& setup, int stage, double inset_mm, double bound_mm) {
    const double room = inset_mm > 0 ? inset_mm : setup.limits.envelope_delta_mm;
    if (bound_mm <= room) return {};
    return fmt::format("{} may lie up to {:.2f} mm (95 %) from its place and has {:.2f} mm of room {}",
                       stageName(setup, stage), bound_mm, room,
                       inset_mm > 0 ? "inside the final cavity" : "in its envelope");
}

Result<StageImages> readImages(const ProcedureSetup& setup, int stage, const StepInputs& inputs) {
    const std::string step = fmt::format("images {}", stage);
    Result<ImagesResult> taken = inputs.result(step, parseImages);
    if (!taken) return taken.error();
    StageImages read;
    for (const ProcedureView& view : setup.views) {
        const auto found = std::find_if(taken->images.begin(), taken->images.end(),
                                        [&](const TakenImage& image) { return image.view == view.name; });
        if (found == taken->images.end())
            return invalidInput(step, "no image of the view " + view.name, "one of every view", "take them again");
        const Result<std::string> bytes = inputs.bytes(step + " " + view.name);
        if (!bytes) return bytes.error();
        Result<Image> image = imageFrom(found->file_name, *bytes);
        if (!image) return image.error();
        read.images.push_back(std::move(*image));
    }
    read.result = std::move(*taken);
    return read;
}

Result<TriangleMesh> readStageMesh(int stage, const StepInputs& inputs) {
    const Result<std::string> bytes = inputs.bytes(fmt::format("mesh {}", stage));
    if (!bytes) return bytes.error();
    Result<MeshFile> mesh = readBytes(fmt::format("stage_{}.stl", stage), *bytes,
                                      [](const std::filesystem::path& path) { return readMesh(path); });
    if (!mesh) return mesh.error();
    return std::move(mesh->mesh);
}

Result<ToolPath> readStagePath(int stage, const StepInputs& inputs) {
    const Result<std::string> bytes = inputs.bytes(fmt::format("path {}", stage));
    if (!bytes) return bytes.error();
    return readBytes(fmt::format("path_{}.json", stage), *bytes, readToolPath);
}

Result<StepOutput> calculate(const ProcedureStep& step, const ProcedureSetup& setup, const StepInputs& inputs,
                             Progress& progress) {
    switch (step.kind) {
        case StepKind::registration:
            return registerStep(setup, inputs, progress);
        case StepKind::plan:
            return planStep(setup, inputs, progress);
        case StepKind::locate:
            return locateStep(setup, step.stage, inputs, progress);
        case StepKind::correct:
            return correctStep(setup, step.stage, inputs, progress);
        case StepKind::images:
        case StepKind::timeOut:
        case StepKind::cut:
            break;
    }
    throw std::logic_error(step.name() + " does more than calculate");
}

}  // namespace fluorocut
