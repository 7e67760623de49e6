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

/// Puts positions into the order of BlockedSkin::points.
/// positions  vertices x 3.
/// points     out, kBlockFloats a block, of which the last may hold fewer vertices than 16.
void pack_points(const float* positions, std::size_t vertices, float* points);

/// Linear blend skinning of one tile.
/// palette    J + 1, the last the identity.
void linear_blocks(const BlockedSkin& skin, const Tile& tile, const MatrixRows* palette);

/// Linear blend skinning of one vertex at p: matrices blended first. Without influences it stays.
void linear_vertex(const Influences& influences, const float* p, const MatrixRows* palette, float* out);

/// Dual quaternion skinning, signs already chosen: within a block every two joints lie on one side.
/// Blocks of sets with skip[set] != 0 are left for the caller, as are those without a set.
/// palette    J + 1, the last the identity.
void dual_quaternion_blocks(const BlockedSkin& skin, const Tile& tile, const DualQuaternion* palette,
                            const std::uint8_t* skip);

}  // namespace sinew
