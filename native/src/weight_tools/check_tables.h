/// Checks of what the weight tools are given.
#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "base/check.h"
#include "mesh/faces.h"

namespace sinew {

inline void check_positions(const char* name, std::span<const float> positions, std::ptrdiff_t vertices) {
  if (std::ssize(positions) != 3 * vertices) {
    fail(name, " has ", plural(std::ssize(positions) / 3, "vertex"), "; the weights are those of ",
         plural(vertices, "vertex"));
  }
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (!std::isfinite(positions[i])) fail(name, " is not finite at vertex ", i / 3);
  }
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

/// Returns which bones are locked.
inline std::vector<std::uint8_t> checked_locked(std::span<const std::int32_t> locked, std::ptrdiff_t bones) {
  std::vector<std::uint8_t> is_locked(static_cast<std::size_t>(bones));
  for (const std::int32_t bone : locked) {
    if (bone < 0 || bone >= bones) fail("locked names bone ", bone, "; there are ", plural(bones, "bone"));
    is_locked[bone] = 1;
  }
  return is_locked;
}

}  // namespace sinew
