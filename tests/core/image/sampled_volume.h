// Volumes from functions of the point, and back.
#pragma once

#include "core/image/volume.h"

namespace fluorocut::test {

// Calls use(point, value) for every voxel centre.
template <class AnyVolume, class Use>
void forEachVoxel(AnyVolume& volume, Use&& use) {
    for (int k = 0; k < volume.size(2); ++k) {
        for (int j = 0; j < volume.size(1); ++j) {
            for (int i = 0; i < volume.size(0); ++i)
                use(volume.grid().pointFromIndex(Vector3(i, j, k)), volume(i, j, k));
        }
    }
}

template <class Function>
Volume sampled(const VolumeGrid& grid, Function&& f) {
    Volume volume(grid);
    forEachVoxel(volume, [&](const Vector3& p, float& value) { value = static_cast<float>(f(p)); });
    return volume;
}

}  // namespace fluorocut::test
