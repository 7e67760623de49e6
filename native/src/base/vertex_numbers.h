/// Checks the numbers that callers pass for each vertex.
#pragma once

#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "base/check.h"
#include "sinew/vertex_group.h"

namespace sinew {

// A vertex's index in floats, four per vertex, has to fit in 32 bits; some vertices are padding.
constexpr std::ptrdiff_t kMostVertices = std::ptrdiff_t{1} << 29;

inline void check_vertex_count(std::ptrdiff_t count) {
  if (count < 0 || count > kMostVertices) {
    fail("vertex_count is ", count, "; expected 0 to ", grouped(kMostVertices));
  }
}

/// Throws InputError unless there is one number per vertex and all are finite. owner  of the vertices: "the skin".
inline void check_vertex_numbers(const char* name, std::span<const float> numbers, std::ptrdiff_t vertices,
                                 const char* owner) {
  if (std::ssize(numbers) != vertices) {
    fail(name, " has ", plural(std::ssize(numbers), "number"), "; ", owner, " has ", plural(vertices, "vertex"));
  }
  for (std::size_t v = 0; v < numbers.size(); ++v) {
    if (!std::isfinite(numbers[v])) fail(name, " is not finite at vertex ", v);
  }
}

/// Throws InputError unless there are V x 3 numbers, whatever their values.
inline void check_position_count(const char* name, std::span<const float> positions, std::ptrdiff_t vertices) {
  if (std::ssize(positions) == 3 * vertices) return;
  fail(name, " has ", plural(std::ssize(positions), "number"), "; expected ", grouped(3 * vertices), " (", vertices,
       " x 3)");
}

inline void check_setting(const char* name, double value) {
  if (!std::isfinite(value)) fail(name, " is ", value, "; expected a finite number");
}

/// Returns V weights, computed as in Blender.
inline std::vector<float> weights_of(const VertexGroup& group, std::ptrdiff_t vertices) {
  if (!group.weights) return std::vector<float>(static_cast<std::size_t>(vertices), 1);
  check_vertex_numbers("weights", *group.weights, vertices, "the mesh");
  std::vector<float> weights(group.weights->begin(), group.weights->end());
  if (group.invert) {
    for (float& weight : weights) weight = 1 - weight;
  }
  return weights;
}

}  // namespace sinew
