#include "core/fiducial/corkscrew_refinement/row_kernels.h"

#include "core/base/instruction_set.h"

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
    if (instructionSet() >= InstructionSet::avx2) sets[count++] = &avx2::kKernels;
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
