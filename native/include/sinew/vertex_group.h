/// Weights that scale an effect for each vertex.
#pragma once

#include <optional>
#include <span>

namespace sinew {

struct VertexGroup {
  /// V; nullopt: every vertex has the full effect.
  std::optional<std::span<const float>> weights{};
  /// Uses 1 - weight instead of each weight. Has no effect without weights.
  bool invert = false;
};

}  // namespace sinew
