/// Checks and visits the faces that callers pass.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "base/offsets.h"
#include "sinew/faces.h"

namespace sinew {

inline void check_vertices(const char* name, std::span<const std::int32_t> numbers, std::ptrdiff_t vertices) {
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] >= 0 && numbers[i] < vertices) continue;
    fail(name, " names vertex ", numbers[i], "; the mesh has ", plural(vertices, "vertex"));
  }
}

/// Checks the vertices of faces, and where each face's corners begin. The names are for messages.
inline void check_faces(const Faces& faces, std::ptrdiff_t vertices, const char* vertices_name = "face_vertices",
                        const char* offsets_name = "face_offsets") {
  check_vertices(vertices_name, faces.vertices, vertices);
  const auto& offsets = faces.offsets;
  if (offsets.empty() && faces.vertices.empty()) return;
  check_offsets<std::int32_t>(offsets_name, offsets, std::ssize(faces.vertices), "corners");
  for (std::size_t f = 0; f + 1 < offsets.size(); ++f) {
    const std::int32_t count = offsets[f + 1] - offsets[f];
    if (count < 3) fail("face ", f, " has ", plural(count, "corner"), "; expected three at least");
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

/// Calls visit(face, a, b) for each side of each face, from a vertex to the next.
template <class Visit>
void for_sides(const Faces& faces, const Visit& visit) {
  for (std::size_t f = 0; f < faces.count(); ++f) {
    const auto begin = static_cast<std::size_t>(faces.offsets[f]), end = static_cast<std::size_t>(faces.offsets[f + 1]);
    for (std::size_t i = begin; i < end; ++i) visit(f, faces.vertices[i], faces.vertices[i + 1 < end ? i + 1 : begin]);
  }
}

}  // namespace sinew
