#include "core/fiducial/corkscrew_refinement/row_kernels.h"

namespace fluorocut::corkscrew {

namespace baseline {
extern const RowKernels kKernels;
}
namespace avx2 {
extern const RowKernels kKernels;
}

int rowKernelSets(const RowKernels* sets[2]) {
    int count = 0;
    sets[count++] = &baseline::kKernels;
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) sets[count++] = &avx2::kKernels;
    return count;
}

const RowKernels& rowKernels() {
    static const RowKernels& best = []() -> const RowKernels& {
        const RowKernels* sets[2];
        return *sets[rowKernelSets(sets) - 1];
    }();
    return best;
}

}  // namespace fluorocut::corkscrew
