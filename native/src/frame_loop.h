/// What the skinning methods share: shapes, the walk over frames and vertices, scratch memory.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "blocked_skin.h"
#include "check.h"
#include "parallel.h"
#include "sinew/skin.h"

namespace sinew {

/// A range of work for one thread: its vertices and their weights fit the second-level cache, so
/// that the frames of a clip that follow each other there read them from it.
constexpr std::ptrdiff_t kBlocksPerTask = 4096 / kBlock;

// Waking a sleeping thread costs more than skinning this many vertices: on two cores of a virtual
// machine, AVX2, 240,000 vertices take 0.27 ms on one thread, 0.26 ms on two that are awake and
// 0.42 ms on two that slept; 1.9 million take 4.1, 2.4 and 2.2 ms.
constexpr std::ptrdiff_t kSerialVertices = 1 << 18;

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

// A long clip is skinned in parts whose prepared matrices stay within some megabytes.
constexpr std::ptrdiff_t kMatricesAtOnce = 1 << 16;

/// `count` elements that this thread keeps from call to call, so that a frame allocates nothing.
/// Only one span of a type is alive a thread: what runs in parallel_for must not call this.
template <class Element>
std::span<Element> scratch(std::size_t count) {
  thread_local std::vector<Element> memory;
  if (memory.size() < count) memory.resize(count);
  return {memory.data(), count};
}

/// Calls prepare(matrices of one frame, that frame's place in the palette) for each frame, then
/// run(frame's palette, begin, end, frame's positions) for ranges of the skin's blocks, at once.
/// palette_size: elements a frame. `run` writes every vertex of its blocks.
template <class Element, class Prepare, class Run>
void skin_frames(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions,
                 std::ptrdiff_t palette_size, const Prepare& prepare, const Run& run) {
  check_shapes(skin, matrices, positions);
  const std::ptrdiff_t vertices = skin.vertex_count();
  const auto blocks = static_cast<std::ptrdiff_t>(skin.blocked().blocks.size());
  const std::ptrdiff_t tasks = (blocks + kBlocksPerTask - 1) / kBlocksPerTask;
  if (vertices == 0 || matrices.frames == 0) return;

  const auto at_once =
      std::clamp<std::ptrdiff_t>(kMatricesAtOnce / (matrices.joints + 1), 1, matrices.frames);
  const std::span<Element> palette = scratch<Element>(at_once * palette_size);
  for (std::ptrdiff_t done = 0; done < matrices.frames; done += at_once) {
    MatrixStack<const float> part = matrices;
    part.data += done * matrices.frame_stride;
    part.frames = std::min(at_once, matrices.frames - done);
    for (std::ptrdiff_t frame = 0; frame < part.frames; ++frame) {
      prepare(part, frame, palette.data() + frame * palette_size);
    }
    // All frames of one range of blocks come first, then the next range.
    const std::ptrdiff_t total = tasks * part.frames;
    const bool serial = vertices * part.frames < kSerialVertices;
    parallel_for(total, serial ? total : 1, [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
      for (std::ptrdiff_t i = begin; i < end; ++i) {
        const std::ptrdiff_t task = i / part.frames, frame = i % part.frames;
        run(palette.data() + frame * palette_size, task * kBlocksPerTask,
            std::min(blocks, (task + 1) * kBlocksPerTask),
            positions.data() + 3 * (done + frame) * vertices);
      }
    });
  }
}

}  // namespace sinew
