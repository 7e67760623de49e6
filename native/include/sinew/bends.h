/// Influences of bones with segments. How they are split between the segments depends on where the vertex is.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "sinew/types.h"

namespace sinew {

/// A bone of n > 1 segments has n + 1 joints, the ends of its segments in order; an ordinary bone has one joint. An
/// influence of a bone with segments is split between the two ends of the segment that the vertex is at. For a vertex
/// at `share` of the bone's length, 0 at the head and 1 at the tail,
///   place = clamp(share, 0, 1) n,  index = min(floor(place), n - 1),  blend = place - index,
/// joint `index` gets 1 - blend of the influence and joint `index + 1` gets blend. Parts that are 0 are left out.
///
/// Lists only the N vertices that have such influences, with M influences of B bones. Immutable.
class Bends {
 public:
  /// vertices      N, ascending: those with an influence of a bone with segments.
  /// offsets       N + 1: the influences of vertices[i] are those from offsets[i] to offsets[i + 1].
  /// bones         M, each in 0..B-1: all influences of these vertices, not yet split, in stored order.
  /// weights       M, finite.
  /// first_joints  B, 0 or more.
  /// segments      B, 1 or more; 1 is an ordinary bone.
  /// axes          B x 4, finite: a point p in armature space is at share a . (p, 1) of the bone's
  ///               length, not yet clamped.
  /// Throws InputError, naming the entry, if any of these conditions is violated. All are copied.
  Bends(std::span<const std::int64_t> vertices, std::span<const std::int64_t> offsets,
        std::span<const std::int32_t> bones, std::span<const float> weights, std::span<const std::int32_t> first_joints,
        std::span<const std::int32_t> segments, std::span<const double> axes);

  /// N.
  std::span<const std::int64_t> vertices() const { return vertices_; }
  /// M.
  std::ptrdiff_t influence_count() const { return std::ssize(bones_); }
  /// Returns the joints that may move the same vertex, wherever that is: those beside each other in a bone, and all of
  /// two bones. Looks at all influences.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> joint_pairs() const;
  /// One more than the last joint of any bone.
  std::ptrdiff_t joint_count() const { return joint_count_; }

  /// The joints that move one vertex, with their weights, in stored order.
  struct Split {
    std::vector<std::int32_t> joints;
    std::vector<float> weights;
  };

  /// For the frame loop: computes the influences of vertices()[i] when it is at `point` in armature
  /// space. Allocates nothing if `split` has been filled by an earlier call on the same object.
  void split(std::size_t i, const Eigen::Vector3d& point, Split& split) const;

 private:
  struct Bone {
    Eigen::RowVector4d axis;
    std::int32_t first_joint;
    std::int32_t segments;
  };

  std::vector<std::int64_t> vertices_;
  std::vector<std::int64_t> offsets_;
  std::vector<std::int32_t> bones_;
  std::vector<float> weights_;
  std::vector<Bone> by_number_;
  std::ptrdiff_t joint_count_ = 0;
  std::size_t most_influences_ = 0;
};

}  // namespace sinew
