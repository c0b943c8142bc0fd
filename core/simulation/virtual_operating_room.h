// VirtualOperatingRoom: a patient, a C-arm and whatever is held in the beam, with a hidden truth. It is an ImageSource:
// it moves the C-arm where it is asked to, roughly, and hands out images with what a real C-arm would know of them, and
// nothing else. What is true (core/simulation/truth.h) is for tests, error reports and simulated adaptors.
//
// Drawn from the seed and never told:
//   the patient      lies up to patient_offset_mm and patient_rotation_rad from where it was planned
//   the robot        stands up to robot_offset_mm and robot_rotation_rad from where it was planned
//   the C-arm        has another focal length and image centre than its data sheet; the focal length sags with gravity
//                    along the beam; the intensifier bends the picture differently at every pose
//   its positioning  two visits to one position differ by up to return_offset_mm and return_rotation_rad
//   the noise        of every exposure
//
// A picture: line integral = CT (mu = mu_water (1 + HU / 1000)) + sum over objects of (mu_object - mu_displaced) *
// path, then core/imaging/xray_physics.h. An object outside the body displaces air and just adds; one inside (a bead in
// bone) displaces what `displaces` says, since the CT was taken without it.
//
// The focal spot blurs the shadows of everything at the isocentre's depth. What the imager carries (the grooved plate)
// lies on the detector, where the spot's penumbra has no width (5 um 4 mm in front of it): its transmission is
// multiplied to the blurred beam, not blurred with it. One width for each of the two is exact for objects at these two
// depths; a bone 100 mm above the isocentre has a penumbra 0.05 mm narrower than it is given.
//
// Frames: `room` of core/imaging/carm_position.h, patient in `femur`, robot base in `robot`. The same requests to a
// room of the same seed give the same images.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "core/base/units.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"
#include "core/imaging/image_source.h"
#include "core/imaging/materials.h"
#include "core/imaging/mesh_projector.h"
#include "core/imaging/volume_projector.h"
#include "core/imaging/xray_physics.h"
#include "core/simulation/intensifier_distortion.h"

namespace fluorocut {

struct OperatingRoomOptions {
    // The C-arm's data sheet; without distortion.
    CArm nominal_carm;
    double source_to_isocentre_mm = 650;

    // How the true C-arm differs. Errors are uniform within plus and minus the value, or in a ball of that radius.
    double focal_length_error_mm = 3;
    double focal_length_sag_mm = 2;  // longer by this with the beam straight down, shorter with it straight up
    double principal_point_error_px = 5;
    IntensifierOptions intensifier;
    // Instead of what `intensifier` says: the same bending at every pose.
    std::optional<IntensifierDistortionParameters> constant_bending;
    // Between any two visits to one position: of the isocentre that the C-arm carries with it, and of its orientation.
    double return_offset_mm = 40;
    double return_rotation_rad = radiansFromDegrees(5);

    // Where patient and robot were planned, and how far off they are. Without a plan the CT's middle lies in the
    // isocentre, its axes along the room's; the robot stands beside the table.
    std::optional<Rigid3> planned_room_from_femur;
    double patient_offset_mm = 20;
    double patient_rotation_rad = radiansFromDegrees(5);
    Rigid3 planned_room_from_robot = Rigid3::fromTranslation({-800, 0, -300});
    double robot_offset_mm = 20;
    double robot_rotation_rad = radiansFromDegrees(5);

    // The beam and the detector; object_depth_mm and seed are the room's.
    double energy_kev = kEffectiveEnergyKev;
    XrayOptions xray;
    ProjectionMethod projection = ProjectionMethod::fast;
    int samples_per_axis = 2;  // rays per pixel through held objects

    std::uint64_t seed = 1;

    // Names the field, the value and the limit.
    Result<void> validate() const;

    // The same without unknowns, distortion, blur and noise: line integrals come out as exp(-t).
    OperatingRoomOptions withoutErrors() const;
};

// `imager`: carried by the C-arm's detector. Its frame is that of the true imager moved along the beam to the detector:
// origin where the principal axis meets it, x along columns, y down the rows, z away from the source. The detector
// plane, z = 0, is the one that pixels and focal length belong to.
enum class HeldBy { patient, robot, room, imager };

// Path lengths (mm) that an object knows in closed form, in the pixels that MeshProjector gives them in.
using PathLengths =
    std::function<Image(const CArm& carm, const Rigid3& imager_from_object, const MeshProjectionOptions& options)>;

struct HeldObject {
    std::string name;   // unique in the room
    TriangleMesh mesh;  // closed, turned outward; in the object's own frame, mm. Not looked at with path_lengths
    Material material = Material::steel;
    std::optional<Material> displaces;  // what is there in the CT; nothing: air
    HeldBy holder = HeldBy::room;
    Rigid3 holder_from_object;
    PathLengths path_lengths;  // instead of those through the mesh
};

class VirtualOperatingRoom final : public ImageSource {
  public:
    // Without a patient (null) the table is empty: for calibration. Fails with invalidOption, or invalidInput when the
    // CT cannot be projected.
    static Result<VirtualOperatingRoom> create(std::shared_ptr<const Volume> patient,
                                               const OperatingRoomOptions& options = {});

    std::string name() const override { return "virtual operating room"; }
    ImageSourceCapabilities capabilities() const override;

    // With a position: the C-arm goes there anew, as well as it can. Without: it stays, and exposes again.
    Result<AcquiredImage> acquire(const ImageRequest& request, Progress& progress) override;

    // Another volume in the same place, on the table as the one before lay: the patient after a cut. invalidInput when
    // it cannot be projected; then the one before stays. Broken contract (std::logic_error): a room without a patient.
    Result<void> setPatient(std::shared_ptr<const Volume> patient);

    // Another time in the same room: all that is hidden stays, what is drawn anew for every visit and every exposure is
    // drawn from another stream, from its beginning. So pictures of one occasion do not depend on how many were taken
    // on another. A new room is at occasion 0.
    void beginOccasion(std::uint64_t occasion);

    // Objects come, move and go between exposures. invalidOption: a name that is taken or unknown; invalidInput: a mesh
    // that is not a solid.
    Result<void> hold(HeldObject object);
    Result<void> move(const std::string& name, const Rigid3& holder_from_object);
    Result<void> release(const std::string& name);

    VirtualOperatingRoom(VirtualOperatingRoom&&) noexcept;
    VirtualOperatingRoom& operator=(VirtualOperatingRoom&&) noexcept;
    ~VirtualOperatingRoom() override;

  private:
    struct Hidden;
    explicit VirtualOperatingRoom(std::unique_ptr<Hidden> hidden);
    friend struct TruthAccess;  // defined beside the truth

    std::unique_ptr<Hidden> hidden_;
};

}  // namespace fluorocut
