// The measurements of a chain: from a file of poses, or from images that show corkscrew and beads together.
#include <map>
#include <set>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/register.h"
#include "app/cli/files.h"
#include "app/cli/options.h"
#include "core/base/units.h"
#include "core/fiducial/corkscrew_pose.h"
#include "core/io/image_file.h"
#include "core/io/pose_file.h"
#include "core/io/resources.h"

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

// Parameters by name, each once, with what is known of it.
class Parameters {
  public:
    explicit Parameters(std::vector<SharedParameter>& list) : list_(list) {}

    std::size_t of(const SharedParameter& parameter) {
        const auto [at, is_new] = known_.try_emplace(parameter.name, list_.size());
        if (is_new) list_.push_back(parameter);
        return at->second;
    }
    // The first three of every image's evidence: those of one C-arm file are the same.
    std::vector<std::size_t> ofImager(const std::string& carm, const BeadUncertainty& known) {
        return {of({"focal length of " + carm, "focal length", known.focal_length}),
                of({"image centre u of " + carm, "image centre", known.principal_point_px}),
                of({"image centre v of " + carm, "image centre", known.principal_point_px})};
    }

  private:
    std::vector<SharedParameter>& list_;
    std::map<std::string, std::size_t> known_;
};

// The corkscrew's pose with the errors that are this image's alone; how it follows the shared ones is the evidence's.
Result<PoseMeasurement> seenCorkscrew(const ViewFiles& files, const CArm& carm, const CorkscrewLayout& layout,
                                      Measured& result, Progress& progress) {
    const Result<ImageFile> image = readImage(files.image);
    if (!image) return image.error();
    CorkscrewPoseOptions options;
    options.calibration.focal_length = options.calibration.principal_point_mm = options.calibration.dimensions_mm = 0;
    const Result<CorkscrewPose> pose = estimateCorkscrewPose(image->image, carm, layout, options, progress);
    if (!pose) {
        Error error = pose.error();
        error.where = files.image + ", " + error.where;
        return error;
    }
    for (Judgement judgement : pose->acceptance) {
        judgement.what = "corkscrew in " + files.image + ", " + judgement.what;
        result.acceptance.push_back(std::move(judgement));
    }
    for (const std::string& warning : pose->warnings)
        result.warnings.push_back("Corkscrew in " + files.image + ": " + warning);
    PoseMeasurement seen;
    seen.pose = pose->imager_from_corkscrew;
    seen.sensitivity = pose->evidence.sensitivity();
    return seen;
}

Result<Measured> fromImages(const ChainInput& input, Progress& progress) {
    const Result<std::vector<ViewFiles>> files = filesOf(input.views);
    if (!files) return files.error();
    const Result<std::filesystem::path> corkscrew_file = findResource("fiducials", input.corkscrew);
    if (!corkscrew_file) return corkscrew_file.error();
    const Result<CorkscrewLayout> corkscrew = readCorkscrew(*corkscrew_file);
    if (!corkscrew) return corkscrew.error();
    const std::vector<std::string> dimensions = corkscrewParameters(*corkscrew);
    const Result<BeadLayout> beads = readBeadLayout(input.beads);
    if (!beads) return beads.error();
    const Result<Pose> mount = readPose(input.flange_from_corkscrew, Frame::flange, Frame::corkscrew);
    if (!mount) return mount.error();
    BeadUncertainty known = input.uncertainty;
    known.focal_length = input.focal_percent / 100;

    Measured measured;
    RegistrationFile& result = measured.file;
    result.inputs = {*corkscrew_file, input.beads, input.flange_from_corkscrew};
    ChainProblem& problem = result.problem;
    problem.flange_from_corkscrew = *mount;
    Parameters parameters(problem.parameters);
    std::vector<FemurView> femur_views;
    Pictures pictures;
    for (std::size_t i = 0; i < files->size(); ++i) {
        const ViewFiles& view_files = (*files)[i];
        for (const std::string& file : {view_files.image, view_files.carm, view_files.robot})
            result.inputs.emplace_back(file);
        const double part = 0.8 / static_cast<double>(files->size()), from = part * static_cast<double>(i);
        SubProgress looking(progress, from, from + 0.6 * part), detecting(progress, from + 0.6 * part, from + part);
        ChainView view;
        view.name = view_files.image;
        Result<Pose> robot = readPose(view_files.robot, Frame::robot, Frame::flange);
        if (!robot) return robot.error();
        view.robot_from_flange = *robot;
        if (!robot->covariance) {
            Vector6 sigma;
            sigma << Vector3::Constant(input.robot.place_mm),
                Vector3::Constant(radiansFromDegrees(input.robot.rotation_deg));
            view.robot_from_flange.covariance = sigma.cwiseAbs2().asDiagonal();
        }
        Result<FemurView> femur =
            beadViewOf({view_files.image, view_files.carm}, *beads, input.bright, pictures, detecting);
        if (!femur) return femur.error();
        Result<PoseMeasurement> seen = seenCorkscrew(view_files, femur->carm, *corkscrew, measured, looking);
        if (!seen) return seen.error();
        view.imager_from_corkscrew = std::move(*seen);
        view.imager_from_corkscrew.parameters = parameters.ofImager(view_files.carm, known);
        for (std::size_t k = 3; k < dimensions.size(); ++k) {
            // A phase counts as far as it moves the wire.
            const bool angle = dimensions[k].find("phase") != std::string::npos;
            view.imager_from_corkscrew.parameters.push_back(
                parameters.of({"corkscrew: " + dimensions[k], "corkscrew's dimensions",
                               angle ? input.dimensions_mm / corkscrew->helix.radius_mm : input.dimensions_mm, false}));
        }
        problem.views.push_back(std::move(view));
        femur_views.push_back(std::move(*femur));
        result.times.emplace_back();
    }
    FemurBeadOptions registration;
    registration.uncertainty = known;
    SubProgress solving(progress, 0.8, 1);
    const Result<FemurBeads> femur = registerBeads(femur_views, *beads, registration, solving);
    if (!femur) return femur.error();
    if (!femur->rejected.empty())
        return noSolution("beads", femur->rejected.front(), "the femur's beads in every view");
    measured.warnings.insert(measured.warnings.end(), femur->warnings.begin(), femur->warnings.end());
    measured.acceptance.insert(measured.acceptance.end(), femur->acceptance.begin(), femur->acceptance.end());
    const std::vector<std::string> names = beadParameters(*beads);
    for (std::size_t i = 0; i < problem.views.size(); ++i) {
        const FemurViewPose& pose = femur->views[i];
        std::vector<std::size_t> shared = parameters.ofImager((*files)[i].carm, known);
        for (std::size_t k = 3; k < names.size(); ++k)
            shared.push_back(parameters.of({names[k], "places of the beads", known.bead_mm, false}));
        problem.views[i].imager_from_femur =
            measurementOf(Frame::imager, Frame::femur, pose.evidence, pose.noise_covariance, std::move(shared));
    }
    Vector3 middle = Vector3::Zero();
    for (const Bead& bead : beads->beads)
        middle += bead.center_mm / static_cast<double>(beads->beads.size());
    result.points = {{"beads' middle", middle}};
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
