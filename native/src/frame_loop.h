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

// A long clip is skinned in blocks whose prepared matrices stay within some megabytes.
constexpr std::ptrdiff_t kMatricesAtOnce = 1 << 16;

/// `count` elements that this thread keeps from call to call, so that a frame allocates nothing.
/// Only one span is alive a thread: what runs in parallel_for must not call this.
template <class Element>
std::span<Element> scratch(std::size_t count) {
  thread_local std::vector<Element> memory;
  if (memory.size() < count) memory.resize(count);
  return {memory.data(), count};
}

/// skin_frames on as many frames as are done at once; `positions` begins with the first of them.
template <class Element, class Prepare, class Blend>
void skin_block(const Skin& skin, MatrixStack<const float> matrices, float* positions,
                const Prepare& prepare, const Blend& blend) {
  const std::ptrdiff_t joints = matrices.joints;
  const std::span<Element> palette = scratch<Element>(matrices.frames * joints);
  for (std::ptrdiff_t frame = 0; frame < matrices.frames; ++frame) {
    for (std::ptrdiff_t j = 0; j < joints; ++j) {
      palette[frame * joints + j] = prepare(matrices.at(frame, j));
    }
  }

  const std::ptrdiff_t vertices = skin.vertex_count();
  const auto offsets = skin.offsets();
  const float* rest = skin.rest_positions().data();
  parallel_for(matrices.frames * vertices, kVerticesPerTask, [&](auto begin, auto end) {
    while (begin < end) {
      const std::ptrdiff_t frame = begin / vertices, first = begin % vertices;
      const auto last = std::min<std::ptrdiff_t>(vertices, first + (end - begin));
      const Element* frame_palette = palette.data() + frame * joints;
      for (std::ptrdiff_t v = first; v < last; ++v) {
        Eigen::Map<Eigen::Vector3f> out(positions + 3 * (frame * vertices + v));
        const bool moved = offsets[v] != offsets[v + 1];
        out = moved ? blend(frame_palette, v)
                    : Eigen::Vector3f(Eigen::Map<const Eigen::Vector3f>(rest + 3 * v));
      }
      begin += last - first;
    }
  });
}

/// Prepares each joint's matrix once with `prepare(matrix) -> Element`, then calls
/// `blend(palette of its frame, vertex) -> Vector3f` for every vertex that something moves, and
/// writes what it returns; the others get their rest position.
template <class Element, class Prepare, class Blend>
void skin_frames(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions,
                 const Prepare& prepare, const Blend& blend) {
  check_shapes(skin, matrices, positions);
  const std::ptrdiff_t frames = matrices.frames;
  if (skin.vertex_count() == 0 || frames == 0) return;

  const std::ptrdiff_t joints = std::max<std::ptrdiff_t>(1, matrices.joints);
  const auto at_once = std::clamp<std::ptrdiff_t>(kMatricesAtOnce / joints, 1, frames);
  for (std::ptrdiff_t first = 0; first < frames; first += at_once) {
    MatrixStack<const float> block = matrices;
    block.data += first * matrices.frame_stride;
    block.frames = std::min(at_once, frames - first);
    skin_block<Element>(skin, block, positions.data() + 3 * first * skin.vertex_count(), prepare,
                        blend);
  }
}

}  // namespace sinew
