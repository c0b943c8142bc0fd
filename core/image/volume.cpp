#include "core/image/volume.h"

#include <cmath>

namespace fluorocut {

float sampleLinear(const Volume& volume, const Vector3& index, float outside) {
    int base[3];
    double weight[3];
    for (int axis = 0; axis < 3; ++axis) {
        const int last = volume.size(axis) - 1;
        if (!(index[axis] >= 0 && index[axis] <= last)) return outside;
        base[axis] = std::min(static_cast<int>(index[axis]), std::max(last - 1, 0));
        weight[axis] = index[axis] - base[axis];
    }
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const int di = corner & 1, dj = (corner >> 1) & 1, dk = corner >> 2;
        const double w =
            (di ? weight[0] : 1 - weight[0]) * (dj ? weight[1] : 1 - weight[1]) * (dk ? weight[2] : 1 - weight[2]);
        if (w > 0) sum += w * volume(base[0] + di, base[1] + dj, base[2] + dk);
    }
    return static_cast<float>(sum);
}

}  // namespace fluorocut
