#define FLUOROCUT_ISA baseline
#define FLUOROCUT_ISA_NAME "baseline"
#include "core/fiducial/corkscrew_refinement/row_kernels_impl.h"
