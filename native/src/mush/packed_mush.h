/// Direct delta mush in the form that its kernels read.
#pragma once

#include <cstdint>
#include <vector>

#include "base/aligned.h"
#include "sinew/direct_delta_mush.h"
#include "skinning/tile.h"

namespace sinew {

/// Vertices in blocks as in BlockedSkin; the same number of a block's sixteen vertices is stored together, in their
/// order.
struct DirectDeltaMush::Packed {
  /// arrays  already checked.
  Packed(const MushArrays& arrays, std::ptrdiff_t joint_count);

  struct Block {
    std::uint64_t omega;        ///< where it begins
    std::uint32_t first_joint;  ///< in joints
    std::uint32_t joint_count;
  };

  MushArrays arrays() const;
  std::size_t bytes() const;
  /// How many numbers of `vertices` a vertex has: center, scale; and with variant 1 the sum of the second moments.
  std::size_t vertex_width() const { return variant == 1 ? 10 : 4; }

  bool blends_quaternions() const { return variant == 2 || variant == 4; }

  int variant;
  std::uint32_t identity_joint;  ///< of vertices that no joint moves
  std::ptrdiff_t vertex_count;
  std::vector<Block> blocks;
  /// Each block's joints, first the one that moves its vertices most: the sums are relative to it.
  std::vector<std::uint32_t> joints;
  Aligned<float> omega;     ///< per block and joint: width_of(variant) x 16
  Aligned<float> vertices;  ///< per block: vertex_width() x 16

 private:
  void take_block(const MushArrays& arrays, std::size_t b);
  std::size_t omega_size_ = 0;
};

}  // namespace sinew
