#include "core/cavity/removed_bone.h"

#include <algorithm>
#include <utility>

#include "core/image/voxelize.h"

namespace fluorocut::cavity {

Result<Removed> RemovedBone::at(const Rigid3& femur_from_cavity) const {
    Result<VoxelCoverage> coverage = voxelize(mesh_, femur_from_cavity, ct_->grid(), "cavity");
    if (!coverage) return coverage.error();
    if (coverage->fraction.empty()) {
        return noSolution("cavity location", "a cavity that lies outside the CT", "a cavity in the femur of the CT",
                          "see that femur_from_cavity belongs to this CT");
    }
    auto bone = std::make_shared<Volume>(coverage->fraction.grid());
    auto length = std::make_shared<Volume>(std::move(coverage->fraction));
    const auto& [di, dj, dk] = coverage->offset;
    const auto per_mm = static_cast<float>(1000 / attenuation_.mu_water_per_mm);
    for (int k = 0; k < bone->size(2); ++k) {
        for (int j = 0; j < bone->size(1); ++j) {
            float* part = length->row(j, k);
            float* row = bone->row(j, k);
            const float* hu = ct_->row(j + dj, k + dk) + di;
            // mu is linear in HU + 1000, and nothing below air.
            for (int i = 0; i < bone->size(0); ++i) {
                row[i] = part[i] * std::max(0.0f, hu[i] + 1000) - 1000;
                part[i] = part[i] * per_mm - 1000;
            }
        }
    }
    Result<VolumeProjector> of_bone = VolumeProjector::prepare(bone, attenuation_);
    if (!of_bone) return of_bone.error();
    Result<VolumeProjector> of_length = VolumeProjector::prepare(length, attenuation_);
    if (!of_length) return of_length.error();
    return Removed{std::move(*of_bone), std::move(*of_length)};
}

}  // namespace fluorocut::cavity
