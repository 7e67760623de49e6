/// The inner loops, compiled for several instruction sets; the best one that the machine has is chosen
/// at run time.
#pragma once

#include <cstddef>
#include <cstdint>

#include "skinning/blocked_skin.h"

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

/// The dual part of a joint that stretches, for Stretch::frame_each: w x y z = row . (x y z 1), for the point (x y z)
/// before the joint stretches it.
struct DualPartRows {
  float row[4][4];
};

/// How the vertices of a joint set are blended with dual quaternions in this frame.
enum class SetWay : std::uint8_t {
  rigid,       ///< by the kernel: no joint stretches
  stretched,   ///< by the kernel
  one_by_one,  ///< by the caller: two joints are on different sides, or there is no set
};

/// A frame's joints: J + 1 of each, the last the identity.
struct QuaternionJoints {
  const DualQuaternion* joints;     ///< signs chosen: within a block all are on one side
  const MatrixRows* displacements;  ///< how far each one's stretch moves a point
  const DualPartRows* dual_parts;   ///< with Stretch::frame_each, else null; read for stretched sets
  const SetWay* ways;               ///< one for each joint set
};

/// Returns the lanes of a register in the instruction set in use, for which a BlockedSkin must be packed.
int kernel_lanes();

/// Returns Highway's name of that instruction set.
const char* kernel_target();

/// Puts positions into the order of BlockedSkin::points.
/// positions  vertices x 3.
/// points     out, kBlockFloats per block; the last block may hold fewer than 16 vertices.
void pack_points(const float* positions, std::size_t vertices, float* points);

/// Linear blend skinning of one tile.
/// palette    J + 1, the last the identity.
void linear_blocks(const BlockedSkin& skin, const Tile& tile, const MatrixRows* palette);

/// Linear blend skinning of one vertex at p, blending the matrices first. Without influences it does
/// not move.
void linear_vertex(const Influences& influences, const float* p, const MatrixRows* palette, float* out);

/// Dual quaternion skinning. Blocks whose sets are blended one by one are left to the caller.
void dual_quaternion_blocks(const BlockedSkin& skin, const Tile& tile, const QuaternionJoints& joints);

}  // namespace sinew
