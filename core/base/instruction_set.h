// Which vector instructions the processor has: for kernels that are compiled for several and choose when they run.
#pragma once

namespace fluorocut {

// Each has those before it. avx2: with FMA. avx512: F, BW, DQ and VL.
enum class InstructionSet { baseline, avx2, avx512 };

InstructionSet instructionSet();

}  // namespace fluorocut
