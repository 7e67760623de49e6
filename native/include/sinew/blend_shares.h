/// How much of dual quaternion skinning each vertex has.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sinew/skinning_method.h"

namespace sinew {

/// What the method `blended` has for each vertex. Immutable.
class BlendShares final : public MethodData {
 public:
  /// shares  V, each from 0, linear skinning, to 1, dual quaternion skinning. Copied.
  /// Throws InputError, naming the vertex, for a share that is not.
  explicit BlendShares(std::span<const float> shares);

  SkinningMethod method() const override { return SkinningMethod::blended; }
  std::ptrdiff_t vertex_count() const override { return vertex_count_; }
  /// V.
  std::span<const float> shares() const { return {shares_.data(), static_cast<std::size_t>(vertex_count_)}; }

  /// Those of 16 consecutive vertices, b being the first one's number divided by 16. Behind the last
  /// vertex they are repeated.
  const float* of_block(std::size_t b) const;
  /// The method that all vertices of the block share: linear, dual_quaternion or, where they do not,
  /// blended.
  SkinningMethod method_of_block(std::size_t b) const { return methods_[b]; }

 private:
  std::ptrdiff_t vertex_count_;
  std::vector<float> shares_;            // whole blocks
  std::vector<SkinningMethod> methods_;  // one a block
};

}  // namespace sinew
