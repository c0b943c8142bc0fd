// The measurements of a chain: from a file of poses, or from images that show corkscrew and beads together.
#include <set>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/register.h"
#include "app/cli/files.h"
#include "app/cli/options.h"
#include "core/base/units.h"
#include "core/io/pose_file.h"
#include "core/io/resources.h"
#include "core/procedure/chain_measurement.h"

namespace fluorocut::cli {
namespace {

struct ViewFiles {
    std::string image, carm, robot;
};

Result<std::vector<ViewFiles>> filesOf(const std::vector<std::string>& views) {
    std::vector<ViewFiles> files;
    std::set<std::string> images;
    for (const std::string& view : views) {
        const Result<std::vector<std::string>> parts = partsOf("--view", view, 3, "IMAGE,CARM,ROBOT_POSE");
        if (!parts) return parts.error();
        if (!images.insert((*parts)[0]).second)
            return invalidOption("--view", (*parts)[0] + " a second time", "another image for each view");
        files.push_back({(*parts)[0], (*parts)[1], (*parts)[2]});
    }
    return files;
}

Result<Measured> fromImages(const ChainInput& input, Progress& progress) {
    const Result<std::vector<ViewFiles>> files = filesOf(input.views);
    if (!files) return files.error();
    const Result<std::filesystem::path> corkscrew_file = findResource("fiducials", input.corkscrew);
    if (!corkscrew_file) return corkscrew_file.error();
    const Result<CorkscrewLayout> corkscrew = readCorkscrew(*corkscrew_file);
    if (!corkscrew) return corkscrew.error();
    const Result<BeadLayout> beads = readBeadLayout(input.beads);
    if (!beads) return beads.error();
    const Result<Pose> mount = readPose(input.flange_from_corkscrew, Frame::flange, Frame::corkscrew);
    if (!mount) return mount.error();
    ChainMeasurementOptions options;
    options.beads = input.uncertainty;
    options.beads.focal_length = input.focal_percent / 100;
    options.corkscrew_mm = input.dimensions_mm;
    options.bright_beads = input.bright;

    Measured measured;
    RegistrationFile& result = measured.file;
    result.inputs = {*corkscrew_file, input.beads, input.flange_from_corkscrew};
    std::vector<ChainImage> images;
    Pictures pictures;
    for (const ViewFiles& view : *files) {
        for (const std::string& file : {view.image, view.carm, view.robot})
            result.inputs.emplace_back(file);
        Result<Pose> robot = readPose(view.robot, Frame::robot, Frame::flange);
        if (!robot) return robot.error();
        if (!robot->covariance) {
            Vector6 sigma;
            sigma << Vector3::Constant(input.robot.place_mm),
                Vector3::Constant(radiansFromDegrees(input.robot.rotation_deg));
            robot->covariance = sigma.cwiseAbs2().asDiagonal();
        }
        Result<PictureOfImager> picture = pictureOf({view.image, view.carm}, pictures);
        if (!picture) return picture.error();
        images.push_back(
            {view.image, std::move(picture->image), std::move(picture->carm), view.carm, view.carm, *robot});
        result.times.emplace_back();
    }
    Result<ChainMeasurement> chain = measureChain(images, *corkscrew, *beads, *mount, options, progress);
    if (!chain) return chain.error();
    result.problem = std::move(chain->problem);
    result.points = {{"beads' middle", chain->beads_middle}};
    measured.warnings = std::move(chain->warnings);
    measured.acceptance = std::move(chain->acceptance);
    return measured;
}

}  // namespace

void declareInput(CLI::App& app, ChainInput& input) {
    auto* measurements =
        app.add_option("--measurements", input.measurements, "Measured poses, fluorocut/registration/1");
    app.add_option("--view", input.views,
                   "Instead: IMAGE,CARM,ROBOT_POSE (robot_from_flange, fluorocut/pose/1) of an image that shows "
                   "corkscrew and beads; again for each further view")
        ->allow_extra_args(false)
        ->excludes(measurements);
    app.add_option("--corkscrew", input.corkscrew, "fluorocut/corkscrew/1, or a built-in corkscrew's name")
        ->capture_default_str();
    app.add_option("--beads", input.beads, "fluorocut/beads/1, frame femur; with --view");
    app.add_option("--flange-from-corkscrew", input.flange_from_corkscrew, "From calibrate robot; with --view");
    app.add_flag("--bright", input.bright, "The beads are brighter than what lies around them");
    app.add_option("--focal-percent", input.focal_percent, "Standard deviation of the calibrated focal length")
        ->check(between(0, 20))
        ->capture_default_str();
    app.add_option("--centre-px", input.uncertainty.principal_point_px,
                   "Standard deviation of the calibrated image centre")
        ->check(between(0, 500))
        ->capture_default_str();
    app.add_option("--bead-sd-mm", input.uncertainty.bead_mm, "Standard deviation of each bead's place in the femur")
        ->check(between(0, 5))
        ->capture_default_str();
    declareDimensions(app, input.dimensions_mm);
    declareRobotNoise(app, input.robot, ", where its pose has no covariance");
    app.add_option("--at-mm", input.at,
                   "Point of the femur whose error is wanted, x,y,z or NAME=x,y,z; again for each further one")
        ->allow_extra_args(false);
}

Result<Measured> measure(const ChainInput& input, Progress& progress) {
    Result<std::vector<NamedPoint>> points = pointsOf(input.at);
    if (!points) return points.error();
    if (input.measurements.empty() && input.views.empty())
        return invalidOption("register", "no measurements", "--measurements FILE, or --view for each image");
    if (!input.views.empty()) {
        for (const auto& [option, value] :
             {std::pair{"--beads", input.beads}, std::pair{"--flange-from-corkscrew", input.flange_from_corkscrew}}) {
            if (value.empty()) return invalidOption(option, "nothing", "a file, with --view");
        }
    }
    Measured measured;
    if (input.views.empty()) {
        Result<RegistrationFile> file = readRegistration(input.measurements);
        if (!file) return file.error();
        measured.file = std::move(*file);
        measured.file.inputs.emplace_back(input.measurements);
    } else {
        Result<Measured> seen = fromImages(input, progress);
        if (!seen) return seen.error();
        measured = std::move(*seen);
    }
    if (!points->empty()) measured.file.points = std::move(*points);
    return measured;
}

}  // namespace fluorocut::cli
