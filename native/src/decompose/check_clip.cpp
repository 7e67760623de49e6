#include "decompose/check_clip.h"

#include <cmath>
#include <mutex>
#include <optional>

#include "base/check.h"
#include "base/parallel.h"
#include "mesh/faces.h"

namespace sinew {
namespace {

/// Joints take 200 bytes a pair, and every vertex four for each.
constexpr std::int32_t kMostFound = 2048;

void check_mesh(const DeformedMesh& mesh) {
  const std::ptrdiff_t numbers = std::ssize(mesh.rest), vertices = numbers / 3;
  if (vertices == 0) fail("rest has no vertices; expected one at least");
  if (numbers % 3 != 0) fail("rest has ", plural(numbers, "number"), "; expected three for each vertex");
  if (mesh.frames.empty()) fail("frames has no frames; expected one at least");
  if (std::ssize(mesh.frames) % numbers != 0) {
    fail("frames has ", plural(std::ssize(mesh.frames), "number"), "; expected a multiple of ", grouped(numbers),
         ", three for each of the ", plural(vertices, "vertex"), " of rest, in every frame");
  }
  for (std::size_t i = 0; i < mesh.rest.size(); ++i) {
    if (!std::isfinite(mesh.rest[i])) fail("rest is not finite at vertex ", i / 3);
  }
  const std::size_t frames = mesh.frames.size() / mesh.rest.size();
  std::mutex mutex;
  std::optional<std::size_t> first;
  parallel_for(frames, 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin * mesh.rest.size(); i < end * mesh.rest.size(); ++i) {
      if (std::isfinite(mesh.frames[i])) continue;
      const std::lock_guard lock(mutex);
      if (!first || i < *first) first = i;
      return;
    }
  });
  if (first) {
    fail("frames is not finite in frame ", *first / mesh.rest.size(), " at vertex ", *first % mesh.rest.size() / 3);
  }
  check_faces({mesh.face_offsets, mesh.face_vertices}, vertices);
}

void check_given_weights(const WeightTable& weights, std::ptrdiff_t vertices) {
  if (weights.vertices() != vertices) {
    fail("weights has ", plural(weights.vertices(), "row"), "; rest has ", plural(vertices, "vertex"));
  }
  for (std::ptrdiff_t v = 0; v < vertices; ++v) {
    if (weights.row(v).empty()) fail("weights has none above 0 at vertex ", v, "; expected one at least");
  }
  if (weights.bones() > kMostFound) {
    fail("weights has ", grouped(weights.bones()), " joints; expected ", grouped(kMostFound), " at most");
  }
}

}  // namespace

void check_decomposition(const DeformedMesh& mesh, const DecompositionStart& start,
                         const DecompositionSettings& settings) {
  check_mesh(mesh);
  const std::ptrdiff_t vertices = std::ssize(mesh.rest) / 3, frames = std::ssize(mesh.frames) / std::ssize(mesh.rest);
  const bool has_weights = start.weights.bones() > 0, has_matrices = !start.matrices.empty();
  const int given = (start.joint_count != 0) + has_weights + has_matrices;
  if (given > 1) fail("bones, matrices and weights exclude each other; expected one of them");
  if (given == 0 && start.heads.empty()) fail("nothing is known; expected bones, heads, matrices or weights");
  if (start.joint_count != 0 && !start.heads.empty()) fail("bones and heads exclude each other; expected one of them");
  const std::ptrdiff_t heads = std::ssize(start.heads) / 3;
  if (std::ssize(start.heads) % 3 != 0)
    fail("heads has ", std::ssize(start.heads), " numbers; expected three for each");
  for (std::size_t i = 0; i < start.heads.size(); ++i) {
    if (!std::isfinite(start.heads[i])) fail("heads is not finite at joint ", i / 3);
  }
  const std::ptrdiff_t found = given ? start.joint_count : heads;
  if (!has_weights && !has_matrices && (found < 1 || found > kMostFound)) {
    fail(given ? "bones is " : "heads has this many joints: ", found, "; expected 1 to ", grouped(kMostFound));
  }
  if (has_matrices) {
    if (std::ssize(start.matrices) % frames != 0) {
      fail("there are ", plural(std::ssize(start.matrices), "matrix"), " for ", plural(frames, "frame"),
           "; expected as many in every frame");
    }
    const std::ptrdiff_t joints = std::ssize(start.matrices) / frames;
    if (joints > kMostFound)
      fail("matrices has ", grouped(joints), " joints; expected ", grouped(kMostFound), " at most");
    for (std::size_t i = 0; i < start.matrices.size(); ++i) {
      if (!start.matrices[i].allFinite()) {
        fail("matrices is not finite in frame ", i / joints, " at joint ", i % joints);
      }
    }
    if (heads && heads != joints) fail("heads has ", plural(heads, "joint"), ", matrices ", plural(joints, "joint"));
  }
  if (has_weights) {
    check_given_weights(start.weights, vertices);
    if (heads && heads != start.weights.bones()) {
      fail("heads has ", plural(heads, "joint"), ", weights ", plural(start.weights.bones(), "joint"));
    }
  }
  check_range("max_influences", settings.max_influences, 1, 64);
  check_range("iterations", settings.iterations, 1, 10000);
  check_range("smoothing", settings.smoothing, 0, 1);
  check_range("tolerance", settings.tolerance, 0, 1);
}

}  // namespace sinew
