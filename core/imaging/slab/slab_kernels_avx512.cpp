#define FLUOROCUT_ISA avx512
#define FLUOROCUT_ISA_NAME "avx512"
#include "core/imaging/slab/slab_kernels_impl.h"
