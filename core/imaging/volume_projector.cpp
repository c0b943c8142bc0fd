#include "core/imaging/volume_projector.h"

#include <atomic>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/imaging/exact_projection.h"
#include "core/imaging/projection_geometry.h"
#include "core/imaging/slab/slab_projector.h"

namespace fluorocut {
namespace {

void requireBinning(const CArm& carm, int binning) {
    if ((binning != 1 && binning != 2 && binning != 4 && binning != 8) || carm.columns < binning ||
        carm.rows < binning) {
        throw std::logic_error(
            fmt::format("ProjectionOptions::binning is {}, not 1, 2, 4 or 8 within the image", binning));
    }
}

Image averaged(const Image& image, int binning) {
    if (binning == 1) return image;
    Image result(image.width() / binning, image.height() / binning);
    for (int y = 0; y < result.height(); ++y) {
        for (int x = 0; x < result.width(); ++x) {
            double sum = 0;
            for (int dy = 0; dy < binning; ++dy) {
                for (int dx = 0; dx < binning; ++dx)
                    sum += image(x * binning + dx, y * binning + dy);
            }
            result(x, y) = static_cast<float>(sum / (binning * binning));
        }
    }
    return result;
}

// How the view moves, in index coordinates, with each parameter of Rigid3::perturbed(imager_from_volume): a point p
// fixed in the imager moves in the volume by R^T (-dr x (p - t) - dt).
std::array<GeometryChange, 6> geometryChanges(const CArm& carm, const Rigid3& imager_from_volume,
                                              const VolumeGrid& grid) {
    const Matrix3 index_from_imager_direction = grid.spacing_mm.cwiseInverse().asDiagonal() *
                                                grid.direction.transpose() *
                                                imager_from_volume.rotationMatrix().transpose();
    const CArm ideal = carm.ideal();
    const Vector3 corner = ideal.detectorPoint({0, 0});
    const Vector3 step_column = ideal.detectorPoint({1, 0}) - corner, step_row = ideal.detectorPoint({0, 1}) - corner;
    std::array<GeometryChange, 6> changes;
    for (int k = 0; k < 3; ++k) {
        const Vector3 axis = Vector3::Unit(k);
        changes[static_cast<std::size_t>(k)] = {-index_from_imager_direction * axis, Vector3::Zero(), Vector3::Zero(),
                                                Vector3::Zero()};
        changes[static_cast<std::size_t>(k + 3)] = {
            index_from_imager_direction * axis.cross(imager_from_volume.translation()),
            -index_from_imager_direction * axis.cross(corner), -index_from_imager_direction * axis.cross(step_column),
            -index_from_imager_direction * axis.cross(step_row)};
    }
    return changes;
}

}  // namespace

Result<void> AttenuationOptions::validate() const {
    return requireRanges(
        {{"mu_water_per_mm", mu_water_per_mm, 1e-9, 10, "per mm"}, {"air_below_hu", air_below_hu, -1000, 10000, "HU"}});
}

struct VolumeProjector::Prepared {
    Prepared(std::shared_ptr<const Volume> volume, const AttenuationOptions& options)
        : hounsfield(std::move(volume)),
          air_below_hu(static_cast<float>(options.air_below_hu)),
          scale_per_hu(options.mu_water_per_mm / 1000),
          blocks(*hounsfield, air_below_hu),
          slabs(*hounsfield, air_below_hu) {}

    std::shared_ptr<const Volume> hounsfield;
    float air_below_hu;
    double scale_per_hu;  // mu = scale_per_hu (HU + 1000)
    OccupiedBlocks blocks;
    SlabVolume slabs;
};

VolumeProjector::VolumeProjector(std::unique_ptr<const Prepared> prepared) : prepared_(std::move(prepared)) {}
VolumeProjector::VolumeProjector(VolumeProjector&&) noexcept = default;
VolumeProjector& VolumeProjector::operator=(VolumeProjector&&) noexcept = default;
VolumeProjector::~VolumeProjector() = default;

Result<VolumeProjector> VolumeProjector::prepare(std::shared_ptr<const Volume> hounsfield,
                                                 const AttenuationOptions& options) {
    if (!hounsfield || hounsfield->empty()) throw std::logic_error("VolumeProjector::prepare: no volume");
    const Result<void> valid = options.validate();
    if (!valid) return valid.error();
    std::atomic<bool> finite = true;
    const std::vector<float>& voxels = hounsfield->voxels();
    parallelFor(voxels.size(), 1 << 20, [&](std::size_t begin, std::size_t end) {
        float worst = 0;  // 0 * x is 0 for every finite x, NaN otherwise
        for (std::size_t i = begin; i < end; ++i)
            worst += 0 * voxels[i];
        if (!(worst == 0)) finite = false;
    });
    if (!finite) {
        return invalidInput("the CT", "voxels that are not finite numbers", "Hounsfield units in every voxel",
                            "replace them by -1000 (air)");
    }
    return VolumeProjector(std::make_unique<const Prepared>(std::move(hounsfield), options));
}

const VolumeGrid& VolumeProjector::grid() const {
    return prepared_->hounsfield->grid();
}

int VolumeProjector::mainAxis(const CArm& carm, const Rigid3& imager_from_volume) const {
    return nearestAxis(projectionGeometry(carm.ideal(), imager_from_volume, grid()));
}

Image VolumeProjector::project(const CArm& carm, const Rigid3& imager_from_volume,
                               const ProjectionOptions& options) const {
    requireBinning(carm, options.binning);
    const ProjectionGeometry geometry = projectionGeometry(carm, imager_from_volume, grid());
    const int axis = options.main_axis.value_or(nearestAxis(geometry));
    if (options.method == ProjectionMethod::exact || !slabCanProject(prepared_->slabs, geometry, axis)) {
        return averaged(projectExactly(*prepared_->hounsfield, prepared_->blocks, prepared_->air_below_hu,
                                       prepared_->scale_per_hu, geometry),
                        options.binning);
    }
    // A distorted imager's samples are at its pixel centres: project all of them, then average.
    const int binning = carm.distortion ? 1 : options.binning;
    const Image image = projectSlab(prepared_->slabs, geometry, axis, prepared_->scale_per_hu, binning, slabKernels());
    return averaged(image, options.binning / binning);
}

ProjectionWithGradient VolumeProjector::projectWithGradient(const CArm& carm, const Rigid3& imager_from_volume,
                                                            const ProjectionOptions& options) const {
    requireBinning(carm, options.binning);
    const ProjectionGeometry geometry = projectionGeometry(carm, imager_from_volume, grid());
    const int axis = options.main_axis.value_or(nearestAxis(geometry));
    const int binning = carm.distortion ? 1 : options.binning;
    ProjectionWithGradient result;
    if (slabCanProject(prepared_->slabs, geometry, axis) && options.method == ProjectionMethod::fast) {
        result.image =
            projectSlabWithGradient(prepared_->slabs, geometry, axis, prepared_->scale_per_hu, binning,
                                    geometryChanges(carm, imager_from_volume, grid()), slabKernels(), result.gradient);
        result.image = averaged(result.image, options.binning / binning);
        for (Image& derivative : result.gradient)
            derivative = averaged(derivative, options.binning / binning);
        return result;
    }
    // Central differences of the exact projection; a tenth of a voxel at the volume's distance.
    result.image = project(carm, imager_from_volume, options);
    const double step_mm = 0.1 * grid().spacing_mm.minCoeff();
    const double distance_mm = std::max((imager_from_volume * grid().center()).norm(), 1.0);
    for (int k = 0; k < 6; ++k) {
        const double step = k < 3 ? step_mm : step_mm / distance_mm;
        const Vector6 delta = step * Vector6::Unit(k);
        const Image ahead = project(carm, imager_from_volume.perturbed(delta), options);
        const Image behind = project(carm, imager_from_volume.perturbed(-delta), options);
        Image& derivative = result.gradient[static_cast<std::size_t>(k)];
        derivative = Image(result.image.width(), result.image.height());
        for (std::size_t i = 0; i < derivative.size(); ++i) {
            derivative.pixels()[i] = static_cast<float>((ahead.pixels()[i] - behind.pixels()[i]) / (2 * step));
        }
    }
    return result;
}

}  // namespace fluorocut
