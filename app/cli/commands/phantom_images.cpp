// phantom plate, phantom beads: a C-arm's picture of a calibration object, with what is true of it.
#include "app/cli/commands/phantom_images.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/files.h"
#include "app/cli/options.h"
#include "core/base/units.h"
#include "core/io/atomic_file.h"
#include "core/io/image_file.h"
#include "core/io/pose_file.h"
#include "core/io/resources.h"
#include "core/simulation/calibration_objects.h"
#include "core/simulation/femur_phantom.h"
#include "core/simulation/truth.h"

namespace fluorocut::cli {
namespace {

constexpr double kIsocentrePart = 0.65;  // of the way from the source to the detector
constexpr double kOpenBeamLevel = 0.9;   // of the full scale: nothing saturates
constexpr double kPhotonsWithoutNoise = 1e5;

// What both kinds are exposed with.
struct Exposing {
    std::string output;
    std::string truth;
    std::string carm;
    double photons = 2000;
    double blur_px = XrayOptions{}.detector_blur_px;
    bool plain = false;
    std::optional<double> field_radius_mm;
    std::optional<double> pincushion_mm;
    std::optional<double> s_shape_rad;
    std::optional<double> orbital_deg;
    std::optional<double> angulation_deg;
    int samples = 3;
    std::uint64_t seed = 1;
};

void addExposing(CLI::App* app, Exposing& e) {
    app->add_option("-o,--out", e.output, "Picture, 12 bits, bright is more photons: .png .tiff .mha .nrrd .dcm")
        ->required();
    app->add_option("--carm", e.carm, "C-arm, fluorocut/carm/1 (default: 512 x 512 pixels of 0.32 mm at 1000 mm)");
    app->add_option("--photons", e.photons, "Per pixel in the open beam; 0: no noise")
        ->check(between(0, 1e9))
        ->capture_default_str();
    app->add_option("--blur-px", e.blur_px, "Standard deviation of the detector's blur")
        ->check(between(0, 100))
        ->capture_default_str();
    app->add_flag("--plain", e.plain, "No scatter, veiling glare, focal spot or electronic noise");
    app->add_option("--field-radius-mm", e.field_radius_mm, "Of an intensifier's round window")->check(between(1, 1e4));
    app->add_option("--pincushion-mm", e.pincushion_mm, "Distortion: outward shift at half the picture's width")
        ->check(between(-20, 20));
    app->add_option("--s-shape-rad", e.s_shape_rad, "Distortion: turn at half the picture's width")
        ->check(between(-0.5, 0.5));
    app->add_option("--orbital-deg", e.orbital_deg,
                    "C-arm angle. Without the two above: the picture is bent as an intensifier's at that angle")
        ->check(between(-360, 360));
    app->add_option("--angulation-deg", e.angulation_deg, "The other C-arm angle")->check(between(-90, 90));
    app->add_option("--samples", e.samples, "Rays per pixel and axis")->check(CLI::Range(1, 16))->capture_default_str();
    app->add_option("--seed", e.seed, "Of the noise")->check(CLI::NonNegativeNumber)->capture_default_str();
}

Result<void> checkFiles(const Exposing& e, std::vector<std::filesystem::path> inputs) {
    inputs.emplace_back(e.carm);
    if (auto ok = checkOutput(e.output, inputs, {".png", ".tif", ".tiff", ".mha", ".nrrd", ".dcm"}); !ok) return ok;
    return e.truth.empty() ? Result<void>() : checkOutput(e.truth, inputs, {".csv"});
}

CArmPosition positionOf(const Exposing& e) {
    CArmPosition position;
    position.orbital_rad = radiansFromDegrees(e.orbital_deg.value_or(0));
    position.angulation_rad = radiansFromDegrees(e.angulation_deg.value_or(0));
    return position;
}

// A room without unknowns: everything in it was asked for.
Result<OperatingRoomOptions> roomOptions(const Exposing& e) {
    OperatingRoomOptions options = OperatingRoomOptions{}.withoutErrors();
    if (!e.carm.empty()) {
        const Result<CArm> carm = readImager(e.carm);
        if (!carm) return carm.error();
        options.nominal_carm = *carm;
    }
    const CArm& carm = options.nominal_carm;
    options.source_to_isocentre_mm = kIsocentrePart * carm.focal_length_mm;
    const double radius_mm = 0.5 * carm.columns * carm.pixel_mm.x();
    if (e.pincushion_mm || e.s_shape_rad) {
        options.constant_bending =
            IntensifierDistortionParameters{radius_mm, e.pincushion_mm.value_or(0), e.s_shape_rad.value_or(0)};
    } else if (e.orbital_deg || e.angulation_deg) {
        options.intensifier = IntensifierOptions{};
        options.intensifier.field_radius_mm = radius_mm;
    }
    XrayOptions& xray = options.xray;
    if (!e.plain) xray = XrayOptions{};
    xray.quantum_noise = e.photons > 0;
    xray.photons_per_pixel = e.photons > 0 ? e.photons : kPhotonsWithoutNoise;
    if (!xray.quantum_noise) xray.electronic_noise_photons = 0;
    xray.detector_blur_px = e.blur_px;
    xray.field_radius_mm = e.field_radius_mm;
    xray.bits = 12;
    xray.gain = kOpenBeamLevel * (std::ldexp(1.0, xray.bits) - 1) / xray.photons_per_pixel;
    options.samples_per_axis = e.samples;
    options.seed = e.seed;
    return options;
}

Result<Report> save(const Exposing& e, const AcquiredImage& acquired, const std::string& truth_csv) {
    const Image& image = acquired.image;
    ImageWriteOptions writing;
    if (acquired.pixel_spacing) writing.pixel_spacing_mm = acquired.pixel_spacing->mm;
    if (auto ok = writeImage(e.output, image, writing); !ok) return ok.error();
    if (!e.truth.empty()) {
        if (auto ok = writeWhole(e.truth, truth_csv); !ok) return ok.error();
    }
    const auto [least, most] = std::minmax_element(image.pixels().begin(), image.pixels().end());
    Report report;
    report.json = {{"file", e.output}, {"size", {image.width(), image.height()}}, {"least", *least}, {"most", *most}};
    report.line("picture", e.output);
    report.line("size", fmt::format("{} x {} px", image.width(), image.height()));
    report.line("levels", fmt::format("{:.0f} to {:.0f}", *least, *most));
    if (!e.truth.empty()) {
        report.json["truth"] = e.truth;
        report.line("truth", e.truth);
    }
    return report;
}

bool isInside(const CArm& carm, const Vector2& pixel) {
    return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() < carm.columns - 0.5 && pixel.y() < carm.rows - 0.5;
}

std::string quoted(const std::string& text) {
    std::string result = "\"";
    for (const char c : text)
        result += c == '"' ? std::string("\"\"") : std::string(1, c);
    return result + "\"";
}

// ---- plate
// -----------------------------------------------------------------------------------------------------------

struct PlateCommand {
    Exposing exposing;
    std::string plate = "paper";
    bool no_plate = false;
    double rotation_deg = 0;
    std::vector<double> shift_mm{0, 0};
    bool mirrored = false;
    std::vector<std::string> overlays;
    std::optional<double> beads_spacing_mm;
    double bead_diameter_mm = 3;

    bool has(const char* overlay) const {
        return std::find(overlays.begin(), overlays.end(), overlay) != overlays.end();
    }
    PlatePlacement placement() const {
        return {Vector2(shift_mm[0], shift_mm[1]), radiansFromDegrees(rotation_deg), mirrored};
    }
};

// The patient on the table: the built-in femur, as dry bone or in its soft tissue.
Result<std::shared_ptr<const Volume>> patientOf(const PlateCommand& command, Progress& progress) {
    if (!command.has("femur")) return std::shared_ptr<const Volume>();
    FemurOptions options;
    options.soft_tissue = command.has("ham");
    options.pelvis = false;
    Result<FemurPhantom> femur = generateFemur(options, progress);
    if (!femur) return femur.error();
    return std::make_shared<const Volume>(std::move(femur->ct));
}

Result<void> holdAll(VirtualOperatingRoom& room, std::vector<HeldObject> objects) {
    for (HeldObject& object : objects) {
        if (auto ok = room.hold(std::move(object)); !ok) return ok;
    }
    return {};
}

// Sizes and places are those for a field of 164 mm; they grow with the field.
Result<void> holdOverlays(VirtualOperatingRoom& room, const PlateCommand& command, const CArm& carm) {
    const double scale = 0.5 * carm.columns * carm.pixel_mm.x() / 82;
    if (command.has("ham") && !command.has("femur")) {
        Result<std::vector<HeldObject>> limb = heldLimb();
        if (!limb) return limb.error();
        if (auto ok = holdAll(room, std::move(*limb)); !ok) return ok;
    }
    if (command.has("clamp")) {  // lies on the plate
        const Rigid3 place = Rigid3::fromTranslation({-20 * scale, 25 * scale, -15}) *
                             Rigid3::fromRotationVector({0, 0, radiansFromDegrees(-35)});
        if (auto ok = holdAll(room, clamp("clamp", HeldBy::imager, place)); !ok) return ok;
    }
    if (command.has("screws")) {  // at the patient's depth
        const double spread_mm = 20 * scale;
        for (const int n : {-1, 0, 1}) {
            const Rigid3 place = Rigid3::fromTranslation({spread_mm * (n + 0.8), 12.0 * n, -1.2 * spread_mm * n}) *
                                 Rigid3::fromRotationVector({0.2 * n, 1.2 + 0.3 * n, 0});
            if (auto ok = room.hold(screw(fmt::format("screw {}", n + 2), 45, HeldBy::room, place)); !ok) return ok;
        }
    }
    return {};
}

// Groove crossings that the picture shows, or would if nothing lay over them.
std::string crossingsCsv(const GroovedPlate& plate, const Rigid3& imager_from_plate, const CArm& carm, int& count) {
    std::string csv = "u_px,v_px,x_mm,y_mm\n";
    const PlateExtent extent = plateExtent(plate);
    count = 0;
    for (int j = 0; j < extent.grooves[1]; ++j) {
        for (int i = 0; i < extent.grooves[0]; ++i) {
            const Vector3 crossing(plate.pitch_mm * (extent.first_groove[0] + i),
                                   plate.pitch_mm * (extent.first_groove[1] + j), 0);
            const Vector2 pixel = carm.project(imager_from_plate * crossing);
            if (!isInside(carm, pixel)) continue;
            csv += fmt::format("{:.6f},{:.6f},{:.6f},{:.6f}\n", pixel.x(), pixel.y(), crossing.x(), crossing.y());
            ++count;
        }
    }
    return csv;
}

Result<Report> runPlate(const PlateCommand& command, Progress& progress) {
    const Exposing& e = command.exposing;
    const Result<std::filesystem::path> plate_file = findResource("plates", command.plate);
    if (!plate_file) return plate_file.error();
    if (auto ok = checkFiles(e, {*plate_file}); !ok) return ok.error();
    const Result<GroovedPlate> plate = readGroovedPlate(*plate_file);
    if (!plate) return plate.error();
    Result<OperatingRoomOptions> options = roomOptions(e);
    if (!options) return options.error();
    // The femur's shaft, 60 mm below the lesser trochanter, in the isocentre.
    if (command.has("femur")) options->planned_room_from_femur = Rigid3::fromTranslation({0, 0, 60});
    SubProgress generating(progress, 0, 0.7), exposing(progress, 0.7, 0.95);
    Result<std::shared_ptr<const Volume>> patient = patientOf(command, generating);
    if (!patient) return patient.error();
    Result<VirtualOperatingRoom> room = VirtualOperatingRoom::create(std::move(*patient), *options);
    if (!room) return room.error();

    const CArm& nominal = options->nominal_carm;
    if (!command.no_plate) {
        Result<HeldObject> held = heldPlate(*plate, command.placement());
        if (!held) return held.error();
        if (auto ok = room->hold(std::move(*held)); !ok) return ok.error();
    }
    BeadLayout beads;
    PlatePlacement bead_placement = command.placement();
    bead_placement.mirrored = false;  // they are on the side toward the source, whichever that is
    const Rigid3 detector_from_beads = placedPlate(bead_placement);
    if (command.beads_spacing_mm) {
        const double half_mm =
            std::min(0.5 * std::max(nominal.columns * nominal.pixel_mm.x(), nominal.rows * nominal.pixel_mm.y()),
                     25 * *command.beads_spacing_mm);
        const Result<BeadLayout> made =
            beadsOnPlate(*command.beads_spacing_mm, command.bead_diameter_mm, half_mm, *plate);
        if (!made) return made.error();
        beads = *made;
        Result<HeldObject> held = heldBeads("beads", beads, HeldBy::imager, detector_from_beads);
        if (!held) return held.error();
        if (auto ok = room->hold(std::move(*held)); !ok) return ok.error();
    }
    if (auto ok = holdOverlays(*room, command, nominal); !ok) return ok.error();

    ImageRequest request;
    request.position = positionOf(e);
    const Result<AcquiredImage> acquired = room->acquire(request, exposing);
    if (!acquired) return acquired.error();
    if (progress.isCancelled()) return cancelled("phantom");

    const CArm& carm = truthOf(*room).views.back().carm;
    const Rigid3 imager_from_detector = Rigid3::fromTranslation({0, 0, carm.focal_length_mm});
    int crossings = 0;
    const std::string csv =
        crossingsCsv(*plate, imager_from_detector * placedPlate(command.placement()), carm, crossings);
    Result<Report> report = save(e, *acquired, csv);
    if (!report) return report;
    report->json["plate"] = plate_file->string();
    report->json["plate_left_on"] = !command.no_plate;
    report->json["crossings"] = crossings;
    report->json["groove_contrast"] = plate->grooveContrast();
    if (command.beads_spacing_mm) {
        report->json["bead_height_mm"] = beadHeight(*plate, command.bead_diameter_mm);
        report->json["beads"] = nlohmann::ordered_json::array();
        for (const Bead& bead : beads.beads) {
            const Vector2 pixel = carm.project(imager_from_detector * detector_from_beads * bead.center_mm);
            if (!isInside(carm, pixel)) continue;
            report->json["beads"].push_back({{"name", bead.name}, {"u_px", pixel.x()}, {"v_px", pixel.y()}});
        }
        report->line("beads", fmt::format("{}, centres {:.3f} mm above the plate plane", report->json["beads"].size(),
                                          beadHeight(*plate, command.bead_diameter_mm)));
    }
    report->line("grooves", fmt::format("{} crossings in the picture, contrast {:.1f} %{}", crossings,
                                        100 * plate->grooveContrast(), command.no_plate ? " (plate taken off)" : ""));
    return report;
}

// ---- beads
// -----------------------------------------------------------------------------------------------------------

struct BeadsCommand {
    Exposing exposing;
    std::string layout;
    std::string pose;
    std::optional<double> depth_mm;
    std::vector<double> turn_deg{0, 0, 0};
};

Result<Rigid3> poseOf(const BeadsCommand& command, Frame frame, double focal_length_mm) {
    if (!command.pose.empty()) {
        const Result<Pose> pose = readPose(command.pose, Frame::imager, frame);
        if (!pose) return pose.error();
        return pose->target_from_source;
    }
    const double depth_mm = command.depth_mm.value_or(0.85 * focal_length_mm);
    return Rigid3::fromTranslation({0, 0, depth_mm}) *
           Rigid3::fromTwistRollPitch(radiansFromDegrees(command.turn_deg[0]), radiansFromDegrees(command.turn_deg[1]),
                                      radiansFromDegrees(command.turn_deg[2]));
}

Result<Report> runBeads(const BeadsCommand& command, Progress& progress) {
    const Exposing& e = command.exposing;
    const Result<std::filesystem::path> layout_file = findResource("phantoms", command.layout);
    if (!layout_file) return layout_file.error();
    if (auto ok = checkFiles(e, {*layout_file, command.pose}); !ok) return ok.error();
    const Result<BeadLayout> layout = readBeadLayout(*layout_file);
    if (!layout) return layout.error();
    Result<OperatingRoomOptions> options = roomOptions(e);
    if (!options) return options.error();
    const double focal_length_mm = options->nominal_carm.focal_length_mm;
    const Result<Rigid3> imager_from_layout = poseOf(command, layout->frame, focal_length_mm);
    if (!imager_from_layout) return imager_from_layout.error();

    // The penumbra is that of the beads' mean depth.
    double depth_mm = 0;
    for (const Bead& bead : layout->beads)
        depth_mm += (*imager_from_layout * bead.center_mm).z() / static_cast<double>(layout->beads.size());
    if (!(depth_mm > 0 && depth_mm < focal_length_mm)) {
        return invalidOption("pose", fmt::format("beads {:.4g} mm in front of the source", depth_mm),
                             fmt::format("beads between source and detector (0 to {:g} mm)", focal_length_mm));
    }
    options->source_to_isocentre_mm = std::clamp(depth_mm, 10.0, focal_length_mm - 20);
    Result<VirtualOperatingRoom> room = VirtualOperatingRoom::create(nullptr, *options);
    if (!room) return room.error();
    const CArmPosition position = positionOf(e);
    const Rigid3 imager_from_room = nominalImagerFromRoom(position, options->source_to_isocentre_mm);
    Result<HeldObject> held =
        heldBeads("beads", *layout, HeldBy::room, imager_from_room.inverse() * *imager_from_layout);
    if (!held) return held.error();
    if (auto ok = room->hold(std::move(*held)); !ok) return ok.error();
    ImageRequest request;
    request.position = position;
    const Result<AcquiredImage> acquired = room->acquire(request, progress);
    if (!acquired) return acquired.error();

    const CArm& carm = truthOf(*room).views.back().carm;
    std::string csv = "u_px,v_px,x_mm,y_mm,z_mm,name\n";
    int seen = 0;
    for (const Bead& bead : layout->beads) {
        const Vector2 pixel = carm.project(*imager_from_layout * bead.center_mm);
        if (!isInside(carm, pixel)) continue;
        csv += fmt::format("{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{}\n", pixel.x(), pixel.y(), bead.center_mm.x(),
                           bead.center_mm.y(), bead.center_mm.z(), quoted(bead.name));
        ++seen;
    }
    Result<Report> report = save(e, *acquired, csv);
    if (!report) return report;
    report->json["layout"] = layout_file->string();
    report->json["beads"] = layout->beads.size();
    report->json["seen"] = seen;
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    const Matrix4 matrix = imager_from_layout->matrix();
    for (int r = 0; r < 4; ++r)
        rows.push_back({matrix(r, 0), matrix(r, 1), matrix(r, 2), matrix(r, 3)});
    report->json["imager_from_" + std::string(name(layout->frame))] = rows;
    report->line("beads", fmt::format("{} of {} in the picture", seen, layout->beads.size()));
    return report;
}

}  // namespace

Command declarePhantomPlate(CLI::App& phantom) {
    const auto command = std::make_shared<PlateCommand>();
    CLI::App* app = phantom.add_subcommand("plate", "A C-arm's picture of the grooved plate on its detector");
    addExposing(app, command->exposing);
    app->add_option("--plate", command->plate, "Plate, fluorocut/plate/1, or one built in by name")
        ->capture_default_str();
    app->add_flag("--no-plate", command->no_plate, "Taken off; what else was asked for stays");
    app->add_option("--rotation-deg", command->rotation_deg, "Of the plate on the detector")
        ->check(between(-360, 360))
        ->capture_default_str();
    app->add_option("--shift-mm", command->shift_mm, "Of the plate on the detector: x y")
        ->expected(2)
        ->check(between(-1000, 1000))
        ->default_str("0 0");
    app->add_flag("--mirrored", command->mirrored, "The plate turned over: seen mirrored, grooves to the detector");
    app->add_option("--overlay", command->overlays,
                    "What lies over it (repeatable). femur: the bone; ham: a limb with a bone;\n"
                    "femur and ham: the femur in its own soft tissue; clamp: on the plate; screws: at the isocentre")
        ->check(CLI::IsMember({"femur", "ham", "clamp", "screws"}))
        ->allow_extra_args(false);
    app->add_option("--beads-spacing-mm", command->beads_spacing_mm, "Beads over the plate, for the bead test")
        ->check(between(1, 200));
    app->add_option("--bead-diameter-mm", command->bead_diameter_mm)->check(between(0.5, 20))->capture_default_str();
    app->add_option("--truth", command->exposing.truth, "Groove crossings, .csv: u_px,v_px,x_mm,y_mm (plate frame)");
    app->footer(
        "Examples:\n"
        "  fluorocut-cli phantom plate --pincushion-mm 2 --s-shape-rad 0.02 --overlay ham --overlay clamp -o "
        "plate.png\n"
        "  fluorocut-cli phantom plate --orbital-deg 30 --no-plate --beads-spacing-mm 20 -o beads.png");
    return {app, [command](Progress& progress) { return runPlate(*command, progress); }};
}

Command declarePhantomBeads(CLI::App& phantom) {
    const auto command = std::make_shared<BeadsCommand>();
    CLI::App* app = phantom.add_subcommand("beads", "A C-arm's picture of a phantom of steel beads");
    addExposing(app, command->exposing);
    app->add_option("--layout", command->layout, "Beads, fluorocut/beads/1, or a phantom built in by name")->required();
    CLI::Option* pose = app->add_option("--pose", command->pose, "Pose imager from the layout's frame");
    app->add_option("--depth-mm", command->depth_mm, "Instead: from the source to the layout's origin, on the axis")
        ->check(between(1, 10000))
        ->excludes(pose);
    app->add_option("--turn-deg", command->turn_deg, "and its twist, roll, pitch about x, y, z")
        ->expected(3)
        ->check(between(-360, 360))
        ->default_str("0 0 0")
        ->excludes(pose);
    app->add_option("--truth", command->exposing.truth, "Bead centres, .csv: u_px,v_px,x_mm,y_mm,z_mm,name");
    app->footer(
        "Example: fluorocut-cli phantom beads --layout beads.json --depth-mm 850 --turn-deg 20 0 0 -o beads.png");
    return {app, [command](Progress& progress) { return runBeads(*command, progress); }};
}

}  // namespace fluorocut::cli
