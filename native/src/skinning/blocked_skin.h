/// A skin in the form that the SIMD kernels read.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "base/aligned.h"
#include "skinning/tile.h"

namespace sinew {

/// Sixteen *consecutive* vertices, so that results are written as full cache lines, in the caller's
/// order; the last block of a mesh may hold fewer. Its joints are the union of its vertices'
/// joints, with weight zero where a vertex lacks one: few more than a single vertex has, since
/// neighbours share theirs.
struct Block {
  std::uint64_t weights;    ///< in BlockedSkin::packed_weights: 16 per joint
  std::uint32_t joint_set;  ///< in BlockedSkin::sets
};

/// The joints of one or more blocks: joints[begin] up to joints[begin + count]. A count of zero
/// marks blocks whose vertices share so few joints that they are blended one by one.
struct JointSet {
  std::uint32_t begin;
  std::uint32_t count : 31;
  /// One joint moves all vertices of the block with weight 1; the weights are left out.
  std::uint32_t is_rigid : 1;
};

/// The joints that move one vertex, with their weights, in stored order.
struct Influences {
  std::span<const std::int32_t> joints;
  std::span<const float> weights;
};

using JointPair = std::pair<std::uint32_t, std::uint32_t>;

/// Block b holds vertices 16 b to 16 b + 15. Immutable once built, except for the positions.
///
/// Points and weights are separate, so that the same weights can move other points, packed by
/// `pack_points`. Within each group of `lanes` vertices, vertex i is in lane 3 i mod lanes, so that
/// three registers x, y, z become x y z x y z ... by two rotations and six blends.
struct BlockedSkin {
  /// rest (V, 3), offsets (V + 1), joints and weights (N) as in Skin; joint_count J. Packed for the
  /// instruction set in use.
  BlockedSkin(std::span<const float> rest, std::span<const std::int64_t> offsets, std::span<const std::int32_t> joints,
              std::span<const float> weights, std::ptrdiff_t joint_count);

  std::size_t vertex_count() const { return offsets.size() - 1; }

  /// The joints of sets[set].
  std::span<const std::uint32_t> joints_of(std::uint32_t set) const {
    return {joints.data() + sets[set].begin, sets[set].count};
  }

  /// The skin's own influences of vertex v.
  Influences influences_of(std::size_t v) const {
    const auto first = static_cast<std::size_t>(offsets[v]);
    const auto count = static_cast<std::size_t>(offsets[v + 1]) - first;
    return {influence_joints.subspan(first, count), weights.subspan(first, count)};
  }

  /// One more than the last vertex of the blocks before block `end`.
  std::size_t vertex_after(std::size_t end) const { return std::min(vertex_count(), end * kBlock); }

  /// Packs `rest` again after its numbers have changed. Only with the instruction set that the skin was
  /// packed for, or one with the same number of lanes.
  void pack_rest_positions();

  int lanes;  ///< of the kernel's registers
  /// The joint of vertices that no joint moves: one past the skin's last, with the identity as its
  /// matrix.
  std::uint32_t identity_joint;
  std::vector<Block> blocks;
  std::vector<JointSet> sets;
  std::vector<std::uint32_t> joints;
  /// All pairs of joints that occur together in a block, each pair once.
  std::vector<JointPair> neighbours;
  /// A spanning forest of the graph of neighbours: each pair leads from a joint already reached to a new
  /// one.
  std::vector<JointPair> spanning;
  bool has_negative_weights = false;
  Aligned<float> points;  ///< kBlockFloats per block
  Aligned<float> packed_weights;
  // The skin's own influences, for blocks that are blended vertex by vertex.
  std::span<const float> rest;
  std::span<const std::int64_t> offsets;
  std::span<const std::int32_t> influence_joints;
  std::span<const float> weights;
};

}  // namespace sinew
