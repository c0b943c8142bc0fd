#include "core/simulation/virtual_operating_room.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/random.h"
#include "core/simulation/truth.h"

namespace fluorocut {
namespace {

// One stream of random numbers for each thing that is drawn, so that a change of one leaves the others.
enum class Stream : std::uint64_t { patient, robot, carm, visits, exposures };

Random streamOf(std::uint64_t seed, Stream stream) {
    return Random(seed).fork(static_cast<std::uint64_t>(stream));
}

// Beyond any number of visits and exposures: streams of occasions are named from here on.
constexpr std::uint64_t kOccasions = std::uint64_t{1} << 40;

// Through a metre of steel comes less; its logarithm stays finite.
constexpr float kDarkestBeam = 1e-30F;

// Uniform in the ball.
Vector3 inBall(double radius, Random& random) {
    Vector3 point;
    do {
        point = {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
    } while (point.squaredNorm() > 1);
    return radius * point;
}

// Moves by up to `offset_mm` and turns by up to `rotation_rad`, about a point.
Rigid3 randomMotion(double offset_mm, double rotation_rad, const Vector3& center, Random& random) {
    const Vector3 offset = inBall(offset_mm, random);
    const Rigid3 turn = Rigid3::fromRotationVector(inBall(rotation_rad, random));
    return Rigid3::fromTranslation(center + offset) * turn * Rigid3::fromTranslation(-center);
}

// Where the C-arm stands since it was last sent somewhere.
struct Standing {
    CArmPosition position;
    CArm carm;
    Rigid3 imager_from_room;
};

}  // namespace

Result<void> OperatingRoomOptions::validate() const {
    if (auto ok = nominal_carm.validate(); !ok) return ok;
    if (nominal_carm.distortion) {
        return invalidOption("nominal_carm.distortion", "a distortion", "none: describe it in `intensifier`");
    }
    if (auto ok = intensifier.validate(); !ok) return ok;
    if (constant_bending) {
        if (auto ok = constant_bending->validate(); !ok) return ok;
    }
    if (auto ok = xray.validate(); !ok) return ok;
    if (!(source_to_isocentre_mm >= 10 && source_to_isocentre_mm <= nominal_carm.focal_length_mm - 20)) {
        return invalidOption("source_to_isocentre_mm", fmt::format("{}", source_to_isocentre_mm),
                             fmt::format("10 to {} mm (the focal length less 20)", nominal_carm.focal_length_mm - 20));
    }
    return requireRanges({
        {"focal_length_error_mm", focal_length_error_mm, 0, 9, "mm"},
        {"focal_length_sag_mm", focal_length_sag_mm, -9, 9, "mm"},
        {"principal_point_error_px", principal_point_error_px, 0, 1000, "px"},
        {"return_offset_mm", return_offset_mm, 0, 500, "mm"},
        {"return_rotation_rad", return_rotation_rad, 0, 3, "rad"},
        {"patient_offset_mm", patient_offset_mm, 0, 500, "mm"},
        {"patient_rotation_rad", patient_rotation_rad, 0, 3, "rad"},
        {"robot_offset_mm", robot_offset_mm, 0, 500, "mm"},
        {"robot_rotation_rad", robot_rotation_rad, 0, 3, "rad"},
        {"energy_kev", energy_kev, kLowestEnergyKev, kHighestEnergyKev, "keV"},
        {"samples_per_axis", static_cast<double>(samples_per_axis), 1, 16, ""},
    });
}

OperatingRoomOptions OperatingRoomOptions::withoutErrors() const {
    OperatingRoomOptions options = *this;
    options.focal_length_error_mm = options.focal_length_sag_mm = options.principal_point_error_px = 0;
    options.intensifier = IntensifierOptions::none();
    options.constant_bending.reset();
    options.return_offset_mm = options.return_rotation_rad = 0;
    options.patient_offset_mm = options.patient_rotation_rad = 0;
    options.robot_offset_mm = options.robot_rotation_rad = 0;
    options.xray = XrayOptions::ideal();
    return options;
}

struct VirtualOperatingRoom::Hidden {
    OperatingRoomOptions options;
    Truth truth;
    std::optional<VolumeProjector> patient;
    std::vector<PathLengths> objects;  // as truth.objects
    double focal_length_error_mm = 0;
    Vector2 principal_point_error_px = Vector2::Zero();
    std::uint64_t occasion = 0;
    std::uint64_t visits = 0, exposures = 0;  // on this occasion
    Standing standing;

    // Of what differs from occasion to occasion.
    Random streamNow(Stream stream) const {
        const Random random = streamOf(options.seed, stream);
        return occasion == 0 ? random : random.fork(kOccasions + occasion);
    }

    static Rigid3 imagerFrom(HeldBy holder, const ViewTruth& view) {
        switch (holder) {
            case HeldBy::patient:
                return view.imager_from_femur;
            case HeldBy::robot:
                return view.imager_from_robot;
            case HeldBy::room:
                return view.imager_from_room;
            case HeldBy::imager:
                return Rigid3::fromTranslation({0, 0, view.carm.focal_length_mm});
        }
        throw std::logic_error("HeldBy outside its enumeration");
    }

    Result<void> goTo(const CArmPosition& position) {
        Random random = streamNow(Stream::visits).fork(visits++);
        const Rigid3 nominal = nominalImagerFromRoom(position, options.source_to_isocentre_mm);
        // Half the spread about the nominal pose keeps any two visits within the whole of it.
        const Rigid3 error = randomMotion(0.5 * options.return_offset_mm, 0.5 * options.return_rotation_rad,
                                          position.isocentre_in_room, random);
        standing.position = position;
        standing.imager_from_room = nominal * error.inverse();
        const double gravity_along_beam = standing.imager_from_room.rotate(Vector3::UnitY()).z();
        standing.carm = options.nominal_carm;
        standing.carm.focal_length_mm += focal_length_error_mm + options.focal_length_sag_mm * gravity_along_beam;
        standing.carm.principal_point_px += principal_point_error_px;

        const auto bending =
            options.constant_bending.value_or(disturbed(intensifierAt(options.intensifier, standing.imager_from_room),
                                                        options.intensifier.repeatability_mm, random));
        const auto distortion = IntensifierDistortion::create(bending);
        if (!distortion) return distortion.error();
        if (!bending.isIdentity()) standing.carm.distortion = *distortion;
        return {};
    }

    // nullopt: cancelled. Line integrals whose beam already has its penumbra, so that it must not be blurred again,
    // when `focused` comes back true.
    std::optional<Image> lineIntegrals(const ViewTruth& view, Progress& progress, bool& focused) const {
        Image sum(view.carm.columns, view.carm.rows);
        if (patient) {
            ProjectionOptions how;
            how.method = options.projection;
            sum = patient->project(view.carm, view.imager_from_femur, how);
        }
        std::size_t done = 0;
        // False: cancelled.
        const auto add = [&](bool on_detector) {
            for (std::size_t n = 0; n < objects.size(); ++n) {
                const HeldObject& object = truth.objects[n];
                if ((object.holder == HeldBy::imager) != on_detector) continue;
                if (progress.isCancelled()) return false;
                progress.report(0.5 + 0.4 * static_cast<double>(done++) / static_cast<double>(objects.size()),
                                "exposing");
                double mu = attenuationPerMm(object.material, options.energy_kev);
                if (object.displaces) mu -= attenuationPerMm(*object.displaces, options.energy_kev);
                const Rigid3 pose = imagerFrom(object.holder, view) * object.holder_from_object;
                const Image path = objects[n](view.carm, pose, {options.samples_per_axis});
                for (std::size_t i = 0; i < sum.size(); ++i)
                    sum.pixels()[i] += static_cast<float>(mu) * path.pixels()[i];
            }
            return true;
        };
        if (!add(false)) return std::nullopt;
        focused = std::any_of(truth.objects.begin(), truth.objects.end(),
                              [](const HeldObject& object) { return object.holder == HeldBy::imager; });
        if (focused) {
            for (float& t : sum.pixels())
                t = std::exp(-t);
            sum = penumbraBlurred(sum, view.carm, view.xray);
            for (float& beam : sum.pixels())
                beam = -std::log(std::max(beam, kDarkestBeam));
        }
        if (!add(true)) return std::nullopt;
        return sum;
    }

    std::size_t indexOf(const std::string& name) const {
        const auto found = std::find_if(truth.objects.begin(), truth.objects.end(),
                                        [&](const HeldObject& object) { return object.name == name; });
        return static_cast<std::size_t>(found - truth.objects.begin());
    }
};

namespace {

Error unknownObject(const std::string& name) {
    return invalidOption("object", "\"" + name + "\"", "the name of an object that is held in the room");
}

}  // namespace

Result<VirtualOperatingRoom> VirtualOperatingRoom::create(std::shared_ptr<const Volume> patient,
                                                          const OperatingRoomOptions& options) {
    if (auto ok = options.validate(); !ok) return ok.error();
    auto hidden = std::make_unique<Hidden>();
    hidden->options = options;
    hidden->options.xray.object_depth_mm = options.source_to_isocentre_mm;

    Truth& truth = hidden->truth;
    truth.mu_water_per_mm = attenuationPerMm(Material::water, options.energy_kev);
    Vector3 center_in_femur = Vector3::Zero();
    if (patient) {
        center_in_femur = patient->grid().center();
        auto projector = VolumeProjector::prepare(patient, {truth.mu_water_per_mm});
        if (!projector) return projector.error();
        hidden->patient.emplace(std::move(*projector));
    }
    truth.patient = std::move(patient);

    const Rigid3 planned = options.planned_room_from_femur.value_or(Rigid3::fromTranslation(-center_in_femur));
    Random for_patient = streamOf(options.seed, Stream::patient);
    truth.room_from_femur =
        randomMotion(options.patient_offset_mm, options.patient_rotation_rad, planned * center_in_femur, for_patient) *
        planned;
    Random for_robot = streamOf(options.seed, Stream::robot);
    truth.room_from_robot = randomMotion(options.robot_offset_mm, options.robot_rotation_rad,
                                         options.planned_room_from_robot.translation(), for_robot) *
                            options.planned_room_from_robot;

    Random for_carm = streamOf(options.seed, Stream::carm);
    hidden->focal_length_error_mm = options.focal_length_error_mm * for_carm.uniform(-1, 1);
    for (int axis = 0; axis < 2; ++axis)
        hidden->principal_point_error_px[axis] = options.principal_point_error_px * for_carm.uniform(-1, 1);
    if (auto ok = hidden->goTo({}); !ok) return ok.error();
    return VirtualOperatingRoom(std::move(hidden));
}

ImageSourceCapabilities VirtualOperatingRoom::capabilities() const {
    ImageSourceCapabilities can;
    can.moves = true;
    return can;
}

Result<AcquiredImage> VirtualOperatingRoom::acquire(const ImageRequest& request, Progress& progress) {
    if (auto ok = checkRequest(*this, request); !ok) return ok.error();
    if (progress.isCancelled()) return cancelled(name());
    progress.report(0, "exposing");
    if (request.position) {
        if (auto ok = hidden_->goTo(*request.position); !ok) return ok.error();
    }
    const OperatingRoomOptions& options = hidden_->options;
    const Standing& standing = hidden_->standing;
    Truth& truth = hidden_->truth;
    const std::uint64_t sequence = truth.views.size();

    ViewTruth view;
    view.carm = standing.carm;
    view.imager_from_room = standing.imager_from_room;
    view.imager_from_femur = standing.imager_from_room * truth.room_from_femur;
    view.imager_from_robot = standing.imager_from_room * truth.room_from_robot;
    view.xray = options.xray;
    view.xray.seed = hidden_->streamNow(Stream::exposures).fork(hidden_->exposures).bits();
    bool focused = false;
    const std::optional<Image> line_integrals = hidden_->lineIntegrals(view, progress, focused);
    if (!line_integrals || progress.isCancelled()) return cancelled(name());
    XrayOptions exposing = view.xray;
    if (focused) {
        exposing.focal_spot_mm = 0;
        exposing.focal_kernel.reset();
    }
    auto exposure = expose(*line_integrals, view.carm, exposing);
    if (!exposure) return exposure.error();
    ++hidden_->exposures;
    truth.views.push_back(std::move(view));

    AcquiredImage acquired;
    acquired.image = std::move(exposure->image);
    acquired.nominal_carm = options.nominal_carm;
    acquired.pixel_spacing = PixelSpacing{options.nominal_carm.pixel_mm, SpacingPlane::detector};
    acquired.source_detector_mm = options.nominal_carm.focal_length_mm;
    acquired.nominal_position = standing.position;
    // The room's own clock, so that the same requests give the same answer: a minute per exposure from 2000-01-01.
    acquired.time = std::chrono::sys_days(std::chrono::year(2000) / 1 / 1) + std::chrono::minutes(sequence);
    acquired.provenance.source = name();
    acquired.provenance.identity = fmt::format("simulated exposure {}", sequence + 1);
    acquired.provenance.sequence = sequence;
    progress.report(1, "exposed");
    return acquired;
}

Result<void> VirtualOperatingRoom::setPatient(std::shared_ptr<const Volume> patient) {
    if (!hidden_->patient || !patient) throw std::logic_error("setPatient: a patient takes the place of a patient");
    auto projector = VolumeProjector::prepare(patient, {hidden_->truth.mu_water_per_mm});
    if (!projector) return projector.error();
    hidden_->patient.emplace(std::move(*projector));
    hidden_->truth.patient = std::move(patient);
    return {};
}

void VirtualOperatingRoom::beginOccasion(std::uint64_t occasion) {
    hidden_->occasion = occasion;
    hidden_->visits = 1;  // 0 is where a room's C-arm stands to begin with
    hidden_->exposures = 0;
}

Result<void> VirtualOperatingRoom::hold(HeldObject object) {
    std::vector<HeldObject>& held = hidden_->truth.objects;
    if (object.name.empty() || hidden_->indexOf(object.name) < held.size()) {
        return invalidOption("object", "\"" + object.name + "\"", "a name of its own");
    }
    if (object.path_lengths) {
        hidden_->objects.push_back(object.path_lengths);
    } else {
        auto projector = MeshProjector::prepare(object.mesh, object.name);
        if (!projector) return projector.error();
        hidden_->objects.push_back(
            [shared = std::make_shared<const MeshProjector>(std::move(*projector))](
                const CArm& carm, const Rigid3& imager_from_object, const MeshProjectionOptions& how) {
                return shared->project(carm, imager_from_object, how);
            });
    }
    held.push_back(std::move(object));
    return {};
}

Result<void> VirtualOperatingRoom::move(const std::string& name, const Rigid3& holder_from_object) {
    const std::size_t index = hidden_->indexOf(name);
    if (index == hidden_->objects.size()) return unknownObject(name);
    hidden_->truth.objects[index].holder_from_object = holder_from_object;
    return {};
}

Result<void> VirtualOperatingRoom::release(const std::string& name) {
    const std::size_t index = hidden_->indexOf(name);
    if (index == hidden_->objects.size()) return unknownObject(name);
    const auto n = static_cast<std::ptrdiff_t>(index);
    hidden_->objects.erase(hidden_->objects.begin() + n);
    hidden_->truth.objects.erase(hidden_->truth.objects.begin() + n);
    return {};
}

VirtualOperatingRoom::VirtualOperatingRoom(std::unique_ptr<Hidden> hidden) : hidden_(std::move(hidden)) {}
VirtualOperatingRoom::VirtualOperatingRoom(VirtualOperatingRoom&&) noexcept = default;
VirtualOperatingRoom& VirtualOperatingRoom::operator=(VirtualOperatingRoom&&) noexcept = default;
VirtualOperatingRoom::~VirtualOperatingRoom() = default;

struct TruthAccess {
    static const Truth& of(const VirtualOperatingRoom& room) { return room.hidden_->truth; }
};

const Truth& truthOf(const VirtualOperatingRoom& room) {
    return TruthAccess::of(room);
}

}  // namespace fluorocut
