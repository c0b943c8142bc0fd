#define FLUOROCUT_ISA avx2
#define FLUOROCUT_ISA_NAME "avx2"
#include "core/imaging/slab/slab_kernels_impl.h"
