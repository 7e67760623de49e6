/// Checks of what the weight tools are given.
#pragma once

#include <cmath>
#include <span>

#include "base/check.h"
#include "mesh/faces.h"
#include "sinew/weight_tools.h"

namespace sinew {

/// name  of the argument, for messages.
inline void check_table(const char* name, const WeightTable& table) {
  if (table.bones < 1) fail(name, " has no columns; expected one for each bone");
  for (std::size_t i = 0; i < table.numbers.size(); ++i) {
    const float weight = table.numbers[i];
    if (std::isfinite(weight) && weight >= 0) continue;
    fail(name, " is ", weight, " at vertex ", i / table.bones, ", bone ", i % table.bones, "; expected 0 or more");
  }
}

inline void check_positions(const char* name, std::span<const float> positions, std::ptrdiff_t vertices) {
  if (std::ssize(positions) != 3 * vertices) {
    fail(name, " has ", plural(std::ssize(positions) / 3, "vertex"), "; the weights are those of ",
         plural(vertices, "vertex"));
  }
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (!std::isfinite(positions[i])) fail(name, " is not finite at vertex ", i / 3);
  }
}

inline void check_faces(const Faces& faces, std::ptrdiff_t vertices) {
  check_face_offsets(faces.offsets, std::ssize(faces.vertices));
  check_vertices("face_vertices", faces.vertices, vertices);
}

inline void check_mask(std::span<const float> mask, std::ptrdiff_t vertices) {
  if (mask.empty()) return;
  if (std::ssize(mask) != vertices) {
    fail("mask has ", plural(std::ssize(mask), "number"), "; the weights are those of ", plural(vertices, "vertex"));
  }
  for (std::size_t v = 0; v < mask.size(); ++v) {
    if (!(mask[v] >= 0 && mask[v] <= 1)) fail("mask is ", mask[v], " at vertex ", v, "; expected 0 to 1");
  }
}

inline void check_range(const char* name, double value, double low, double high) {
  if (!(value >= low && value <= high)) fail(name, " is ", value, "; expected ", low, " to ", high);
}

}  // namespace sinew
