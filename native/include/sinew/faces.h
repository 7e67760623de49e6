/// The faces of a mesh.
#pragma once

#include <cstdint>
#include <span>

namespace sinew {

/// Polygons; both may be empty: there are no faces.
struct Faces {
  std::span<const std::int32_t> offsets;   ///< faces + 1, where the corners of each begin
  std::span<const std::int32_t> vertices;  ///< C, face after face

  std::size_t count() const { return offsets.empty() ? 0 : offsets.size() - 1; }
};

}  // namespace sinew
