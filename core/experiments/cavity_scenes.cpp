#include "core/experiments/cavity_scenes.h"

#include <algorithm>
#include <cmath>

#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/geometry/mesh_properties.h"
#include "core/image/voxelize.h"
#include "core/imaging/standard_views.h"
#include "core/imaging/volume_projector.h"
#include "core/imaging/xray_physics.h"
#include "core/planning/cavity.h"
#include "core/planning/implant_file.h"
#include "core/simulation/femur_phantom.h"

namespace fluorocut {
namespace {

constexpr double kShaftMm = 150;
constexpr double kAboveMm = 25;         // the cavity's top, above the lesser trochanter
constexpr double kCavitySpacingMm = 1;  // of the mesh: its facets lie within 0.05 mm of round walls
constexpr double kMuWater = 0.02;
constexpr double kExactMarginMm = 24;  // around the cavity's shadow, where estimators look

// The femur's part inside the cavity, on half the CT's voxels: the CT between its voxels is what projections take it
// for (linear), the mesh's share of a voxel is exact.
Result<Volume> removedPart(const Volume& ct, const TriangleMesh& mesh, const Rigid3& femur_from_cavity,
                           double fill_hu) {
    VolumeGrid fine = ct.grid();
    for (int axis = 0; axis < 3; ++axis) {
        fine.size[static_cast<std::size_t>(axis)] = 2 * ct.size(axis) - 1;
        fine.spacing_mm[axis] /= 2;
    }
    Result<VoxelCoverage> coverage = voxelize(mesh, femur_from_cavity, fine, "cavity");
    if (!coverage) return coverage.error();
    if (coverage->fraction.empty())
        return noSolution("cavity scene", "a cavity outside the CT", "one inside the femur");
    Volume part = std::move(coverage->fraction);
    const auto& offset = coverage->offset;
    const auto fill = static_cast<float>(fill_hu);
    parallelFor(static_cast<std::size_t>(part.size(2)), 4, [&](std::size_t begin, std::size_t end) {
        for (auto k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
            for (int j = 0; j < part.size(1); ++j) {
                float* row = part.row(j, k);
                for (int i = 0; i < part.size(0); ++i) {
                    if (row[i] == 0) {
                        row[i] = -1000;
                        continue;
                    }
                    const Vector3 index((i + offset[0]) / 2.0, (j + offset[1]) / 2.0, (k + offset[2]) / 2.0);
                    const float hu = std::max(-1000.0f, sampleLinear(ct, index, -1000));
                    row[i] = row[i] * (hu - fill) - 1000;
                }
            }
        }
    });
    return part;
}

// Blurred by 0.6 voxel, 5 % too dense, noisy: a CT from another scanner.
Volume spoilt(const Volume& ct) {
    Volume result = ct;
    const auto side = static_cast<float>(0.6 * 0.6 / 2), middle = 1 - 2 * side;
    for (const auto& step : {std::array<int, 3>{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}) {
        const Volume from = result;
        for (int k = step[2]; k < ct.size(2) - step[2]; ++k)
            for (int j = step[1]; j < ct.size(1) - step[1]; ++j)
                for (int i = step[0]; i < ct.size(0) - step[0]; ++i)
                    result(i, j, k) = middle * from(i, j, k) + side * (from(i - step[0], j - step[1], k - step[2]) +
                                                                       from(i + step[0], j + step[1], k + step[2]));
    }
    Random noise(99);
    for (float& hu : result.voxels())
        hu = static_cast<float>(1.05 * (hu + 1000) - 1000 + 20 * noise.normal());
    return result;
}

Vector3 inBall(Random& random, double radius) {
    const Vector3 direction = Vector3(random.normal(), random.normal(), random.normal()).normalized();
    return radius * std::cbrt(random.uniform()) * direction;
}

struct ShadowBox {
    int x, y, width, height;
};

ShadowBox shadowBox(const CArm& carm, const TriangleMesh& mesh, const Rigid3& imager_from_cavity) {
    Vector2 low = Vector2::Constant(1e9), high = -low;
    for (const Vector3& vertex : mesh.vertices) {
        const Vector2 px = carm.project(imager_from_cavity * vertex);
        low = low.cwiseMin(px);
        high = high.cwiseMax(px);
    }
    const double depth = imager_from_cavity.translation().z();
    const double margin = kExactMarginMm * carm.focal_length_mm / (depth * carm.pixel_mm.x());
    const auto clip = [](double value, int most) { return std::clamp(static_cast<int>(value), 0, most); };
    ShadowBox box{clip(low.x() - margin, carm.columns - 1), clip(low.y() - margin, carm.rows - 1), 0, 0};
    box.width = std::max(1, clip(high.x() + margin, carm.columns) - box.x);
    box.height = std::max(1, clip(high.y() + margin, carm.rows) - box.y);
    return box;
}

CArm imager(double pixel_mm) {
    // A panel of 30 x 20 cm, its long side along the stem.
    CArm carm = standardCArm();
    carm.columns = static_cast<int>(std::lround(200 / pixel_mm));
    carm.rows = static_cast<int>(std::lround(300 / pixel_mm));
    carm.pixel_mm = {pixel_mm, pixel_mm};
    carm.principal_point_px = {(carm.columns - 1) / 2.0, (carm.rows - 1) / 2.0};
    return carm;
}

}  // namespace

Result<void> CavitySceneOptions::validate() const {
    if (const auto ok = pose_error.validate(); !ok) return ok;
    return requireRanges({{"voxel_mm", voxel_mm, 0.4, 2, "mm"},
                          {"pixel_mm", pixel_mm, 0.15, 1, "mm"},
                          {"view_angle_rad", view_angle_rad, 0.1, 2, "rad"},
                          {"pose_way_mm", pose_way_mm, 0, 60, "mm"},
                          {"pose_turn_rad", pose_turn_rad, 0, 0.2, "rad"},
                          {"photons", photons, 10, 1e7, ""},
                          {"fill_hu", fill_hu, -1000, 500, "HU"}});
}

Rigid3 CavityOffset::about(const Vector3& middle) const {
    return Rigid3::fromTranslation(shift_mm + middle) *
           Rigid3::fromTwistRollPitch(roll_pitch_yaw_rad.x(), roll_pitch_yaw_rad.y(), roll_pitch_yaw_rad.z()) *
           Rigid3::fromTranslation(-middle);
}

CavityOffset CavityOffset::from(const Rigid3& planned_from_cut, const Vector3& middle) {
    return {planned_from_cut * middle - middle, planned_from_cut.twistRollPitch()};
}

Result<CavityPatient> makeCavityPatient(const CavitySceneOptions& options, Progress& progress) {
    if (const auto ok = options.validate(); !ok) return ok.error();
    FemurOptions femur_options;
    femur_options.voxel_mm = options.voxel_mm;
    femur_options.shaft_length_mm = kShaftMm;
    const Result<FemurPhantom> femur = generateFemur(femur_options, progress);
    if (!femur) return femur.error();
    const Result<Implant> implant = loadImplant(options.implant);
    if (!implant) return implant.error();
    CavityOptions cavity_options;
    cavity_options.top_mm = implant->resection_z_mm;
    cavity_options.spacing_mm = kCavitySpacingMm;
    const Result<Cavity> cavity = planCavity(implant->in_bone, cavity_options, progress);
    if (!cavity) return cavity.error();
    CavityPatient patient;
    patient.ct = std::make_shared<const Volume>(femur->ct);
    patient.known_ct = options.imperfect_ct ? std::make_shared<const Volume>(spoilt(femur->ct)) : patient.ct;
    patient.cavity = cavity->mesh;
    patient.middle = meshProperties(patient.cavity).centroid;
    const FemurLandmarks& at = femur->landmarks;
    const Vector3 top = at.shaft_axis_mm.front(), low = at.shaft_axis_mm[9];
    Matrix3 axes;
    axes.col(2) = (top - low).normalized();
    const Vector3 neck = at.head_center_mm - at.neck_base_mm;
    axes.col(0) = (neck - neck.dot(axes.col(2)) * axes.col(2)).normalized();
    axes.col(1) = axes.col(2).cross(axes.col(0));
    patient.planned_femur_from_cavity = Rigid3(axes, top + kAboveMm * axes.col(2));
    return patient;
}

Result<CavityScene> makeCavityScene(const CavityPatient& patient, const CavitySceneOptions& options,
                                    const CavityOffset& offset, Random& random) {
    if (const auto ok = options.validate(); !ok) return ok.error();
    const Rigid3& planned = patient.planned_femur_from_cavity;
    CavityScene scene;
    scene.truth_femur_from_cavity = planned * offset.about(patient.middle);
    const Result<Volume> gone =
        removedPart(*patient.ct, patient.cavity, scene.truth_femur_from_cavity, options.fill_hu);
    if (!gone) return gone.error();
    const AttenuationOptions attenuation{kMuWater, -1000};
    const Result<VolumeProjector> whole = VolumeProjector::prepare(patient.ct, attenuation),
                                  removed = VolumeProjector::prepare(std::make_shared<Volume>(*gone), attenuation);
    if (!whole) return whole.error();
    if (!removed) return removed.error();
    const CArm carm = imager(options.pixel_mm);
    const Vector3 middle = planned * patient.middle;
    const Rigid3 to_middle = Rigid3::fromTranslation(middle), from_middle = Rigid3::fromTranslation(-middle);
    ProjectionOptions exact;
    exact.method = ProjectionMethod::exact;
    for (const int side : {-1, 1}) {
        const Rigid3 nominal =
            standardView(StandardView::ap, middle, kStandardObjectDepthMm) * to_middle *
            Rigid3::fromRotationVector({0, 0, side * options.view_angle_rad / 2});  // of `middle` as origin
        CavityView view;
        view.name = side < 0 ? "left" : "right";
        view.carm = carm;
        // The object's motion in the imager, shared by before and after.
        const Vector3 way = inBall(random, options.pose_way_mm), turn = inBall(random, options.pose_turn_rad);
        for (const bool after : {false, true}) {
            const double part = after ? 0.5 : -0.5;
            Vector6 step;
            step << part * way, part * turn;
            const Rigid3 pose = nominal.perturbed(step);
            Image line = whole->project(carm, pose * from_middle);
            const ShadowBox box = shadowBox(carm, patient.cavity, pose * from_middle * planned);
            const CArm part_carm = carm.cropped(box.x, box.y, box.width, box.height);
            Image near = whole->project(part_carm, pose * from_middle, exact);
            if (after) {
                const Image cut = removed->project(part_carm, pose * from_middle, exact);
                for (std::size_t i = 0; i < near.size(); ++i)
                    near.pixels()[i] -= cut.pixels()[i];
            }
            for (int y = 0; y < box.height; ++y)
                for (int x = 0; x < box.width; ++x)
                    line(box.x + x, box.y + y) = near(x, y);
            XrayOptions xray;
            xray.photons_per_pixel = options.photons;
            xray.object_depth_mm = kStandardObjectDepthMm;
            xray.seed = random.bits();
            Result<Exposure> exposure = expose(line, carm, xray);
            if (!exposure) return exposure.error();
            Vector6 error;
            for (int j = 0; j < 6; ++j)
                error[j] = random.normal() * options.pose_error.sigma(j);
            const Rigid3 known = pose.perturbed(error) * from_middle;
            (after ? view.after : view.before) = std::move(exposure->image);
            (after ? view.after_imager_from_femur : view.before_imager_from_femur) = known;
        }
        scene.views.push_back(std::move(view));
    }
    return scene;
}

}  // namespace fluorocut
