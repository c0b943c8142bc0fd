// Scenario: everything that the virtual operating room hides and everything that the plan asks for. Files:
// fluorocut/scenario/1, JSON; unknown fields are an error; a field that is left out has the default that stands here.
//
//     {"schema": "fluorocut/scenario/1", "name": "demo", "seed": 1,
//      "patient": {"name": "Built-in femur", "side": "left", "kind": "femur", "ct": null, "phantom_seed": 1,
//                  "voxel_mm": 0.8, "block_mm": [50, 50, 90], "soft_tissue": true, "bone_above_hu": 250},
//      "implant": {"stem": "straight", "size": null, "cuboid_mm": null, "mesh": null},
//      "placement": {"femur_from_cavity": null, "axis_mm": null, "below_resection_mm": 0, "open_wound_mm": 45},
//      "cut": {"cutter_radius_mm": 3, "cutter_length_mm": 200, "stages": 3, "insets_mm": null,
//              "most_cusp_mm": 0.02, "offset_mm": 0, "fill_hu": -1000},
//      "views": [{"name": "oblique right", "orbital_deg": -30, "angulation_deg": 0}, ...],
//      "carm": {"columns": 768, "pixel_mm": 0.4, "focal_length_mm": 1000, "source_to_isocentre_mm": 700,
//               "focal_length_error_mm": 3, "focal_length_sag_mm": 2, "principal_point_error_px": 5,
//               "pincushion_mm": 2.5, "s_shape_rad": 0.02, "field_shift_mm": 0.8, "round_field": true,
//               "return_offset_mm": 16, "return_rotation_deg": 3, "photons": 20000, "blur_px": 0.7, "scatter": true,
//               "exact_projection": false},
//      "calibration": {"pictures": true, "focal_length_sigma_mm": 0.3, "principal_point_sigma_mm": 0.1,
//                      "hand_eye_place_sigma_mm": 0.03, "hand_eye_rotation_sigma_deg": 0.02},
//      "corkscrew": {"layout": "corkscrew", "above_mm": 33, "knock_place_sigma_mm": 0.15,
//                    "knock_rotation_sigma_deg": 0.1, "knock": null},
//      "robot": {"offset_mm": 5, "rotation_deg": 3, "calibration_mm": 0.016, "calibration_deg": 0.008},
//      "beads": {"count": 8, "diameter_mm": 2, "error_mm": 0.03},
//      "patient_offset_mm": 3, "patient_rotation_deg": 3}
//
// Lengths in mm, angles in degrees in the file; radians nowhere but s_shape_rad. Paths are relative to the file.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"
#include "core/planning/implant.h"
#include "core/planning/templating.h"

namespace fluorocut {

enum class PatientKind { femur, acrylic, ct };

struct ScenarioPatient {
    std::string name = "Built-in femur";  // as the time-out confirms it
    Side side = Side::left;
    PatientKind kind = PatientKind::femur;
    std::filesystem::path ct;        // of `ct`: a file or a DICOM folder
    std::uint64_t phantom_seed = 1;  // of the femur's texture
    double voxel_mm = 0.8;           // of what is generated
    Vector3 block_mm{50, 50, 90};    // of the acrylic
    bool soft_tissue = true;         // of the femur, and its pelvis
    double bone_above_hu = 250;      // where beads may be driven in (acrylic: 80)
};

// One of stem, cuboid and mesh.
struct ScenarioImplant {
    std::string stem = "straight";  // a family of the library, or a file of fluorocut/implant/1
    std::string size;               // empty: what templating proposes, else the middle one
    std::optional<Vector3> cuboid_mm;
    std::filesystem::path mesh;  // frame `cavity`, mm, top at its highest point
};

struct ScenarioPlacement {
    // Unset: a stem is templated (core/planning/templating.h); anything else goes into the middle of the block's upper
    // face, or along the femur's canal from the resection down.
    std::optional<Rigid3> femur_from_cavity;
    std::optional<std::array<Vector3, 2>> axis_mm;  // resection, and a point in the canal below: where it is not found
    double below_resection_mm = 0;                  // deeper along the axis by this
    // Above the resection the wound is open: what lies within this of the axis has been taken away (head, neck), in
    // the patient and, as planned, in the CT. 0: nothing.
    double open_wound_mm = 45;
};

struct ScenarioCut {
    double cutter_radius_mm = 3;
    double cutter_length_mm = 200;
    int stages = 3;
    std::vector<double> insets_mm;  // of each stage; empty: by the registration's uncertainty
    double most_cusp_mm = 0.02;     // between passes: what is left makes a tapered cavity look higher than it lies
    double offset_mm = 0;           // + cement mantle, - press fit
    double fill_hu = -1000;         // of the cavity: air; 0 to 50 for irrigation fluid and blood
};

struct ScenarioView {
    std::string name;
    double orbital_deg = 0, angulation_deg = 0;
};

struct ScenarioCarm {
    int columns = 768;  // and rows
    double pixel_mm = 0.4;
    double focal_length_mm = 1000;  // of the data sheet
    double source_to_isocentre_mm = 700;
    // How the true one differs (core/simulation/virtual_operating_room.h).
    double focal_length_error_mm = 3, focal_length_sag_mm = 2, principal_point_error_px = 5;
    double pincushion_mm = 2.5, s_shape_rad = 0.02, field_shift_mm = 0.8;  // at the rim; all 0: straight
    bool round_field = true;
    double return_offset_mm = 16, return_rotation_deg = 3;  // between any two visits to a view
    double photons = 20000;
    double blur_px = 0.7;
    bool scatter = true;            // and veiling glare
    bool exact_projection = false;  // rays instead of slices: slow
};

struct ScenarioCalibration {
    // From pictures of plate, bead phantom and corkscrew, by the estimators. False: the truth with errors drawn by the
    // standard deviations below (which are stated, and are the stated ones of the maps' and views' in either case).
    bool pictures = true;
    double focal_length_sigma_mm = 0.3;
    double principal_point_sigma_mm = 0.1;
    double hand_eye_place_sigma_mm = 0.03, hand_eye_rotation_sigma_deg = 0.02;
    // Left by the maps where the C-arm comes back a little turned, rms, at the detector.
    double local_distortion_mm = 0.02;
};

struct ScenarioCorkscrew {
    std::string layout = "corkscrew";  // a file, or one of resources/fiducials
    double above_mm = 33;              // of its middle above the cavity's top, while pictures are taken
    // A knock after the calibration: its standard deviations per axis, which technician and setup know of ...
    double knock_place_sigma_mm = 0.15, knock_rotation_sigma_deg = 0.1;
    // ... and what it was: x, y, z mm, rotation vector in degrees, as Rigid3::perturbed has it in the flange's frame.
    // Unset: drawn.
    std::optional<Vector6> knock;
};

struct ScenarioRobot {
    double offset_mm = 5, rotation_deg = 3;  // from where it was planned to stand, at most
    double calibration_mm = 0.016, calibration_deg = 0.008;
};

struct ScenarioBeads {
    int count = 8;
    double diameter_mm = 2;
    double error_mm = 0.03;  // of their known places, standard deviation per axis
};

struct Scenario {
    std::string name = "demo";
    std::uint64_t seed = 1;
    ScenarioPatient patient;
    ScenarioImplant implant;
    ScenarioPlacement placement;
    ScenarioCut cut;
    std::vector<ScenarioView> views{{"oblique right", -30, 0}, {"oblique left", 30, 0}};
    ScenarioCarm carm;
    ScenarioCalibration calibration;
    ScenarioCorkscrew corkscrew;
    ScenarioRobot robot;
    ScenarioBeads beads;
    double patient_offset_mm = 3, patient_rotation_deg = 3;  // from where the patient was planned to lie, at most

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

inline constexpr std::string_view kScenarioSchema = "fluorocut/scenario/1";

// A file, or one of resources/scenarios by name. Relative paths in it become paths from here.
Result<Scenario> readScenario(const std::string& name);
// `path`: what messages call it, and what paths in it are relative to.
Result<Scenario> parseScenario(std::string_view text, const std::filesystem::path& path);

// Every field, in one spelling: equal texts are equal scenarios.
std::string textOf(const Scenario& scenario);

}  // namespace fluorocut
