/// A skin as the SIMD kernels read it.
#pragma once

#include <hwy/aligned_allocator.h>

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace sinew {

/// Vertices that are computed together. Sixteen fill one AVX-512 register, two of AVX2, four of
/// SSE.
constexpr int kBlock = 16;

/// Sixteen *consecutive* vertices, so that results are written in full lines, in the caller's
/// order. Its joints are the union of its vertices' joints, with weight zero where a vertex lacks
/// one: few more than one vertex has, since neighbours share theirs.
struct Block {
  std::uint64_t data;          ///< in BlockedSkin::data: 16 x, 16 y, 16 z; 16 weights a joint
  std::uint32_t first_vertex;  ///< the last block of a mesh may hold fewer than 16
  std::uint32_t joint_set;     ///< in BlockedSkin::sets
};

/// The joints of one or more blocks: joints[begin] up to joints[begin + count]. A count of zero
/// marks blocks whose vertices have so little in common that they are blended one by one.
struct JointSet {
  std::uint32_t begin;
  std::uint32_t count : 31;
  /// One joint moves all vertices of the block with weight 1; the weights are left out.
  std::uint32_t is_rigid : 1;
};

using JointPair = std::pair<std::uint32_t, std::uint32_t>;

/// Blocks in the order in which they are processed. Immutable once built, but for the positions.
struct BlockedSkin {
  /// rest (V, 3), offsets (V + 1), joints and weights (N) as in Skin; joint_count J.
  /// lanes: of the kernel's registers. Within each group of so many vertices, vertex i lies in lane
  /// 3 i mod lanes, from where three registers x, y, z become x y z x y z ... by two rotations and
  /// six blends.
  BlockedSkin(std::span<const float> rest, std::span<const std::int64_t> offsets,
              std::span<const std::int32_t> joints, std::span<const float> weights,
              std::ptrdiff_t joint_count, int lanes);

  /// The joints of sets[set].
  std::span<const std::uint32_t> joints_of(std::uint32_t set) const {
    return {joints.data() + sets[set].begin, sets[set].count};
  }

  /// Copies `rest`, whose numbers were changed, into the blocks.
  void take_rest_positions();

  int lanes;
  /// A vertex that nothing moves hangs on this joint, one past the skin's: its matrix is the
  /// identity.
  std::uint32_t identity_joint;
  std::vector<Block> blocks;
  std::vector<JointSet> sets;
  std::vector<std::uint32_t> joints;
  /// Every two joints that some block has together, each pair once.
  std::vector<JointPair> neighbours;
  /// Those of them that span the graph of neighbours: each second joint is reached from a first
  /// that came before.
  std::vector<JointPair> spanning;
  bool has_negative_weights = false;
  hwy::AlignedFreeUniquePtr<float[]> data;
  // The skin's own influences, for blocks that are blended vertex by vertex.
  std::span<const float> rest;
  std::span<const std::int64_t> offsets;
  std::span<const std::int32_t> influence_joints;
  std::span<const float> weights;
};

}  // namespace sinew
