#include "core/imaging/slab/slab_kernels.h"

namespace fluorocut {

namespace baseline {
extern const SlabKernels kKernels;
}
namespace avx2 {
extern const SlabKernels kKernels;
}
namespace avx512 {
extern const SlabKernels kKernels;
}

int slabKernelSets(const SlabKernels* sets[3]) {
    int count = 0;
    sets[count++] = &baseline::kKernels;
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
        sets[count++] = &avx2::kKernels;
        if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
            __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")) {
            sets[count++] = &avx512::kKernels;
        }
    }
    return count;
}

const SlabKernels& slabKernels() {
    static const SlabKernels& best = []() -> const SlabKernels& {
        const SlabKernels* sets[3];
        return *sets[slabKernelSets(sets) - 1];
    }();
    return best;
}

}  // namespace fluorocut
