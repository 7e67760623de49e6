/// How much each vertex takes part in something.
#pragma once

#include <optional>
#include <span>

namespace sinew {

struct VertexGroup {
  /// V; nothing: all take part fully.
  std::optional<std::span<const float>> weights{};
  /// 1 - weight in place of each weight. Without weights it has no effect.
  bool invert = false;
};

}  // namespace sinew
