#include "core/procedure/chain_measurement.h"

#include <algorithm>
#include <map>
#include <utility>

#include <fmt/format.h>

namespace fluorocut {
namespace {

// Parameters by name, each once, with what is known of it.
class Parameters {
  public:
    explicit Parameters(std::vector<SharedParameter>& list) : list_(list) {}

    std::size_t of(const SharedParameter& parameter) {
        const auto [at, is_new] = known_.try_emplace(parameter.name, list_.size());
        if (is_new) list_.push_back(parameter);
        return at->second;
    }
    // The first three of every image's evidence.
    std::vector<std::size_t> ofImager(const ChainImage& image, const BeadUncertainty& known) {
        return {of({"focal length of " + image.focal_length_of, "focal length", known.focal_length}),
                of({"image centre u of " + image.image_centre_of, "image centre", known.principal_point_px}),
                of({"image centre v of " + image.image_centre_of, "image centre", known.principal_point_px})};
    }

  private:
    std::vector<SharedParameter>& list_;
    std::map<std::string, std::size_t> known_;
};

Error in(const std::string& image, Error error) {
    error.where = image + ", " + error.where;
    return error;
}

// The corkscrew's pose with the errors that are this image's alone; how it follows the shared ones is the evidence's.
Result<PoseMeasurement> seenCorkscrew(const ChainImage& image, const CorkscrewLayout& layout, double distortion_mm,
                                      ChainMeasurement& result, Progress& progress) {
    CorkscrewPoseOptions options;
    options.calibration.focal_length = options.calibration.principal_point_mm = options.calibration.dimensions_mm = 0;
    options.calibration.distortion_mm = distortion_mm;
    const Result<CorkscrewPose> pose = estimateCorkscrewPose(image.image, image.carm, layout, options, progress);
    if (!pose) return in(image.name, pose.error());
    for (Judgement judgement : pose->acceptance) {
        judgement.what = "corkscrew in " + image.name + ", " + judgement.what;
        result.acceptance.push_back(std::move(judgement));
    }
    for (const std::string& warning : pose->warnings)
        result.warnings.push_back("Corkscrew in " + image.name + ": " + warning);
    PoseMeasurement seen;
    seen.pose = pose->imager_from_corkscrew;
    seen.sensitivity = pose->evidence.sensitivity();
    return seen;
}

}  // namespace

Result<FemurView> beadViewOf(const std::string& name, const Image& image, const CArm& carm, const BeadLayout& layout,
                             bool bright, Progress& progress) {
    if (image.width() != carm.columns || image.height() != carm.rows) {
        return invalidInput(name, fmt::format("{} x {} pixels", image.width(), image.height()),
                            fmt::format("the C-arm's {} x {}", carm.columns, carm.rows),
                            "give each image the C-arm that it was taken with");
    }
    if (auto good = layout.validate(); !good) return good.error();
    FemurView view;
    view.name = name;
    view.carm = carm;
    // A bead in a femur lies between half way to the detector and the detector.
    double least = layout.beads.front().diameter_mm, most = least;
    for (const Bead& bead : layout.beads) {
        least = std::min(least, bead.diameter_mm);
        most = std::max(most, bead.diameter_mm);
    }
    const double pixel_mm = carm.pixel_mm.mean();
    BeadDetectionOptions detection;
    detection.bright = bright;
    detection.least_diameter_px = std::clamp(0.8 * least / pixel_mm, 2.0, 100.0);
    detection.most_diameter_px = std::clamp(2.5 * most / pixel_mm, 2 * detection.least_diameter_px, 300.0);
    Result<BeadDetections> beads = detectBeads(image, detection, progress);
    if (!beads) return in(name, beads.error());
    view.detections = std::move(beads->beads);
    return view;
}

Result<ChainMeasurement> measureChain(const std::vector<ChainImage>& images, const CorkscrewLayout& corkscrew,
                                      const BeadLayout& beads, const Pose& flange_from_corkscrew,
                                      const ChainMeasurementOptions& options, Progress& progress) {
    const std::vector<std::string> dimensions = corkscrewParameters(corkscrew);
    ChainMeasurement measured;
    ChainProblem& problem = measured.problem;
    problem.flange_from_corkscrew = flange_from_corkscrew;
    Parameters parameters(problem.parameters);
    std::vector<FemurView> femur_views;
    for (std::size_t i = 0; i < images.size(); ++i) {
        const ChainImage& image = images[i];
        const double part = 0.8 / static_cast<double>(images.size()), from = part * static_cast<double>(i);
        SubProgress looking(progress, from, from + 0.6 * part), detecting(progress, from + 0.6 * part, from + part);
        Result<PoseMeasurement> seen = seenCorkscrew(image, corkscrew, options.distortion_mm, measured, looking);
        if (!seen) return seen.error();
        Result<FemurView> femur =
            beadViewOf(image.name, image.image, image.carm, beads, options.bright_beads, detecting);
        if (!femur) return femur.error();
        ChainView view;
        view.name = image.name;
        view.robot_from_flange = image.robot_from_flange;
        view.imager_from_corkscrew = std::move(*seen);
        view.imager_from_corkscrew.parameters = parameters.ofImager(image, options.beads);
        for (std::size_t k = 3; k < dimensions.size(); ++k) {
            // A phase counts as far as it moves the wire.
            const bool angle = dimensions[k].find("phase") != std::string::npos;
            view.imager_from_corkscrew.parameters.push_back(parameters.of(
                {"corkscrew: " + dimensions[k], "corkscrew's dimensions",
                 angle ? options.corkscrew_mm / corkscrew.helix.radius_mm : options.corkscrew_mm, false}));
        }
        problem.views.push_back(std::move(view));
        femur_views.push_back(std::move(*femur));
    }
    FemurBeadOptions registration;
    registration.uncertainty = options.beads;
    SubProgress solving(progress, 0.8, 1);
    Result<FemurBeads> femur = registerBeads(femur_views, beads, registration, solving);
    if (!femur) return femur.error();
    if (!femur->rejected.empty())
        return noSolution("beads", femur->rejected.front(), "the femur's beads in every view");
    measured.femur = std::move(*femur);
    measured.warnings.insert(measured.warnings.end(), measured.femur.warnings.begin(), measured.femur.warnings.end());
    measured.acceptance.insert(measured.acceptance.end(), measured.femur.acceptance.begin(),
                               measured.femur.acceptance.end());
    const std::vector<std::string> names = beadParameters(beads);
    for (std::size_t i = 0; i < problem.views.size(); ++i) {
        const FemurViewPose& pose = measured.femur.views[i];
        std::vector<std::size_t> shared = parameters.ofImager(images[i], options.beads);
        for (std::size_t k = 3; k < names.size(); ++k)
            shared.push_back(parameters.of({names[k], "places of the beads", options.beads.bead_mm, false}));
        problem.views[i].imager_from_femur =
            measurementOf(Frame::imager, Frame::femur, pose.evidence, pose.noise_covariance, std::move(shared));
    }
    for (const Bead& bead : beads.beads)
        measured.beads_middle += bead.center_mm / static_cast<double>(beads.beads.size());
    return measured;
}

}  // namespace fluorocut
