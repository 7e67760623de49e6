/// The inner loops, compiled for several instruction sets; the best that the machine has is taken
/// at run time.
#pragma once

#include <cstddef>
#include <cstdint>

#include "blocked_skin.h"

namespace sinew {

/// A joint's skinning matrix as the linear kernel reads it: the upper three rows.
struct MatrixRows {
  float row[3][4];
};

/// A joint's unit dual quaternion, each part w x y z.
struct DualQuaternion {
  float real[4];
  float dual[4];
};

/// Lanes of a register in the instruction set that is in use: which BlockedSkin the kernels take.
int kernel_lanes();

/// Linear blend skinning of blocks begin..end of one frame.
/// palette    J + 1, the last the identity.
/// positions  V x 3, out: the whole frame's.
void linear_blocks(const BlockedSkin& skin, std::size_t begin, std::size_t end,
                   const MatrixRows* palette, float* positions);

/// Dual quaternion skinning, signs already chosen: within a block every two joints lie on one side.
/// Blocks of sets with skip[set] != 0 are left for the caller, as are those without a set.
/// palette    J + 1, the last the identity.
void dual_quaternion_blocks(const BlockedSkin& skin, std::size_t begin, std::size_t end,
                            const DualQuaternion* palette, const std::uint8_t* skip,
                            float* positions);

}  // namespace sinew
