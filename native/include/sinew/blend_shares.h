/// The share of dual quaternion skinning of each vertex.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sinew/skinning_method.h"

namespace sinew {

/// The data of the method `blended` for each vertex. Immutable.
class BlendShares final : public MethodData {
 public:
  /// shares  V, each from 0 (linear skinning) to 1 (dual quaternion skinning). Copied.
  /// Throws InputError, naming the vertex, for a share outside of 0 to 1.
  explicit BlendShares(std::span<const float> shares);

  SkinningMethod method() const override { return SkinningMethod::blended; }
  std::ptrdiff_t vertex_count() const override { return vertex_count_; }
  /// V.
  std::span<const float> shares() const { return {shares_.data(), static_cast<std::size_t>(vertex_count_)}; }

  /// The shares of the 16 vertices from 16 b on. After the last vertex, its share repeats.
  const float* of_block(std::size_t b) const;
  /// linear or dual_quaternion if that is the method of every vertex in the block, otherwise blended.
  SkinningMethod method_of_block(std::size_t b) const { return methods_[b]; }

 private:
  std::ptrdiff_t vertex_count_;
  std::vector<float> shares_;            // whole blocks
  std::vector<SkinningMethod> methods_;  // one per block
};

}  // namespace sinew
