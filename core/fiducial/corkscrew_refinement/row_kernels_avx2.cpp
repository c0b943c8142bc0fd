#define FLUOROCUT_ISA avx2
#define FLUOROCUT_ISA_NAME "avx2"
#include "core/fiducial/corkscrew_refinement/row_kernels_impl.h"
