/// Checks and visits the faces that callers pass.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "base/check.h"

namespace sinew {

inline void check_vertices(const char* name, std::span<const std::int32_t> numbers, std::ptrdiff_t vertices) {
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] >= 0 && numbers[i] < vertices) continue;
    fail(name, " names vertex ", numbers[i], "; the mesh has ", plural(vertices, "vertex"));
  }
}

/// Checks where each face's corners begin, and where the last face's end; empty if there are no faces.
inline void check_face_offsets(std::span<const std::int32_t> offsets, std::ptrdiff_t corners) {
  if (offsets.empty() && corners == 0) return;
  if (offsets.empty() || offsets.front() != 0 || offsets.back() != corners) {
    fail("face_offsets goes from ", offsets.empty() ? 0 : offsets.front(), " to ", offsets.empty() ? 0 : offsets.back(),
         "; expected 0 to ", corners, ", the number of corners");
  }
  for (std::size_t f = 0; f + 1 < offsets.size(); ++f) {
    if (offsets[f + 1] - offsets[f] >= 3) continue;
    fail("face ", f, " has ", plural(offsets[f + 1] - offsets[f], "corner"), "; expected three at least");
  }
}

/// Calls visit({a, b, c}) for the triangles of each face, a fan around its first corner.
template <class Visit>
void for_triangles(std::span<const std::int32_t> offsets, std::span<const std::int32_t> vertices, const Visit& visit) {
  for (std::size_t f = 0; f + 1 < offsets.size(); ++f) {
    const std::int32_t first = offsets[f];
    for (std::int32_t corner = first + 1; corner + 1 < offsets[f + 1]; ++corner) {
      visit(std::array{vertices[first], vertices[corner], vertices[corner + 1]});
    }
  }
}

}  // namespace sinew
