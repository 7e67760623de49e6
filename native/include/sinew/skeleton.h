/// The tree of joints and its rest pose.
#pragma once

#include <span>
#include <vector>

#include "sinew/types.h"

namespace sinew {

/// Immutable. Joints keep the caller's numbering, in which a parent may come after its child; the
/// order in which they must be visited is computed once, by the constructor.
class Skeleton {
 public:
  /// parents  J, the parent of each joint or -1 for a root.
  /// rest     J, R(j): each joint's rest transform relative to its parent (a root's: to the world).
  /// Throws InputError, naming the joint, for: a parent outside -1..J-1, a cycle, sizes that
  /// differ, a number that is not finite, a rest transform that cannot be inverted.
  Skeleton(std::span<const std::int32_t> parents, std::span<const Matrix4<double>> rest);

  std::ptrdiff_t joint_count() const { return static_cast<std::ptrdiff_t>(parents_.size()); }
  std::span<const std::int32_t> parents() const { return parents_; }

  /// R(j), in the scalar type of the computation.
  template <class T>
  std::span<const Matrix4<T>> rest() const;

  /// A(j), rest transform of each joint relative to the world.
  std::span<const Matrix4<double>> rest_world() const { return rest_world_; }

  /// A(j)^-1.
  std::span<const Matrix4<double>> inverse_rest() const { return inverse_rest_; }

  /// All joints, parents before children; in order of their numbers if that is possible.
  std::span<const std::int32_t> order() const { return order_; }

  /// Another such order, for threads: first the trunk, whose joints each have more descendants than
  /// a group holds, then groups of whole subtrees. No joint of a group has its parent in another
  /// group, so all groups can be posed in parallel once the trunk is done. Group g is
  /// grouped_order()[group_begin()[g]] up to grouped_order()[group_begin()[g + 1]]; the trunk comes
  /// before group 0.
  std::span<const std::int32_t> grouped_order() const { return grouped_order_; }
  std::span<const std::int32_t> group_begin() const { return group_begin_; }

  /// The most joints in a group: about ten microseconds of work.
  static constexpr std::int32_t kLargestGroup = 512;

 private:
  void put_in_order();

  std::vector<std::int32_t> parents_;
  std::vector<std::int32_t> order_;
  std::vector<std::int32_t> grouped_order_;
  std::vector<std::int32_t> group_begin_;
  std::vector<Matrix4<double>> rest_;
  std::vector<Matrix4<float>> rest_float_;
  std::vector<Matrix4<double>> rest_world_;
  std::vector<Matrix4<double>> inverse_rest_;
};

template <>
inline std::span<const Matrix4<double>> Skeleton::rest<double>() const {
  return rest_;
}
template <>
inline std::span<const Matrix4<float>> Skeleton::rest<float>() const {
  return rest_float_;
}

}  // namespace sinew
