/// What the skinning methods share: shapes, the walk over frames and vertices, scratch memory.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "check.h"
#include "parallel.h"
#include "sinew/skin.h"

namespace sinew {

// A vertex costs some 4 ns; a range of this many outweighs handing it to another thread.
constexpr std::ptrdiff_t kVerticesPerTask = 4096;

inline void check_shapes(const Skin& skin, MatrixStack<const float> matrices,
                         std::span<float> positions) {
  if (matrices.joints != skin.joint_count()) {
    fail("there are ", plural(matrices.joints, "matrix"), " a frame; the skin has ",
         plural(skin.joint_count(), "joint"));
  }
  const auto expected = static_cast<std::size_t>(matrices.frames * skin.vertex_count() * 3);
  if (positions.size() != expected) {
    fail("the result holds ", grouped(positions.size()), " numbers; expected ", grouped(expected),
         " (", matrices.frames, " x ", skin.vertex_count(), " x 3)");
  }
}

/// `count` elements that this thread keeps from call to call, so that a frame allocates nothing.
template <class Element>
std::span<Element> scratch(std::size_t count) {
  thread_local std::vector<Element> memory;
  if (memory.size() < count) memory.resize(count);
  return {memory.data(), count};
}

/// Prepares each joint's matrix once with `prepare(matrix) -> Element`, then calls
/// `blend(palette of its frame, vertex) -> Vector3f` for every vertex that something moves, and
/// writes what it returns; the others get their rest position.
template <class Element, class Prepare, class Blend>
void skin_frames(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions,
                 const Prepare& prepare, const Blend& blend) {
  check_shapes(skin, matrices, positions);
  const std::ptrdiff_t vertices = skin.vertex_count();
  if (vertices == 0 || matrices.frames == 0) return;

  const std::ptrdiff_t joints = matrices.joints;
  const std::span<Element> palette = scratch<Element>(matrices.frames * joints);
  for (std::ptrdiff_t frame = 0; frame < matrices.frames; ++frame) {
    for (std::ptrdiff_t j = 0; j < joints; ++j) {
      palette[frame * joints + j] = prepare(matrices.at(frame, j));
    }
  }

  const auto offsets = skin.offsets();
  const float* rest = skin.rest_positions().data();
  parallel_for(matrices.frames * vertices, kVerticesPerTask, [&](auto begin, auto end) {
    while (begin < end) {
      const std::ptrdiff_t frame = begin / vertices, first = begin % vertices;
      const auto last = std::min<std::ptrdiff_t>(vertices, first + (end - begin));
      const Element* frame_palette = palette.data() + frame * joints;
      for (std::ptrdiff_t v = first; v < last; ++v) {
        Eigen::Map<Eigen::Vector3f> out(positions.data() + 3 * (frame * vertices + v));
        const bool moved = offsets[v] != offsets[v + 1];
        out = moved ? blend(frame_palette, v)
                    : Eigen::Vector3f(Eigen::Map<const Eigen::Vector3f>(rest + 3 * v));
      }
      begin += last - first;
    }
  });
}

}  // namespace sinew
