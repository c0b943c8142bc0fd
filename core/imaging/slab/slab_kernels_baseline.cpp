#define FLUOROCUT_ISA baseline
#define FLUOROCUT_ISA_NAME "baseline"
#include "core/imaging/slab/slab_kernels_impl.h"
