#include "core/imaging/slab/slab_kernels.h"

#include "core/base/instruction_set.h"

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
    const InstructionSet best = instructionSet();
    if (best >= InstructionSet::avx2) sets[count++] = &avx2::kKernels;
    if (best >= InstructionSet::avx512) sets[count++] = &avx512::kKernels;
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
