#include "decompose/check_clip.h"

#include <cmath>
#include <mutex>
#include <optional>

#include "base/offsets.h"
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

void check_given_weights(const DecompositionStart& start, std::ptrdiff_t vertices) {
  if (std::ssize(start.offsets) != vertices + 1) {
    fail("the weights are those of ", plural(std::ssize(start.offsets) - 1, "vertex"), "; rest has ",
         plural(vertices, "vertex"));
  }
  if (start.joints.size() != start.weights.size()) {
    fail("joints has ", plural(std::ssize(start.joints), "number"), ", weights ", grouped(std::ssize(start.weights)));
  }
  check_offsets<std::int64_t>("offsets", start.offsets, std::ssize(start.joints), "joints");
  for (std::size_t v = 0; v + 1 < start.offsets.size(); ++v) {
    double sum = 0;
    for (auto i = start.offsets[v]; i < start.offsets[v + 1]; ++i) {
      if (start.joints[i] < 0 || start.joints[i] >= start.weighted_joints) {
        fail("vertex ", v, " follows joint ", start.joints[i], "; there are ", plural(start.weighted_joints, "joint"));
      }
      if (!(std::isfinite(start.weights[i]) && start.weights[i] >= 0)) {
        fail("vertex ", v, " has the weight ", start.weights[i], "; expected 0 or more");
      }
      sum += start.weights[i];
    }
    if (!(sum > 0)) fail("vertex ", v, " has no weight above 0; expected one at least");
  }
}

}  // namespace

void check_decomposition(const DeformedMesh& mesh, const DecompositionStart& start,
                         const DecompositionSettings& settings) {
  check_mesh(mesh);
  const std::ptrdiff_t vertices = std::ssize(mesh.rest) / 3, frames = std::ssize(mesh.frames) / std::ssize(mesh.rest);
  const bool has_weights = !start.offsets.empty(), has_matrices = !start.matrices.empty();
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
    check_given_weights(start, vertices);
    if (start.weighted_joints > kMostFound) {
      fail("weights has ", grouped(start.weighted_joints), " joints; expected ", grouped(kMostFound), " at most");
    }
    if (heads && heads != start.weighted_joints) {
      fail("heads has ", plural(heads, "joint"), ", weights ", plural(start.weighted_joints, "joint"));
    }
  }
  const auto check_range = [](const char* name, double value, double low, double high) {
    if (!(value >= low && value <= high)) fail(name, " is ", value, "; expected ", low, " to ", high);
  };
  check_range("max_influences", settings.max_influences, 1, 64);
  check_range("iterations", settings.iterations, 1, 10000);
  check_range("smoothing", settings.smoothing, 0, 1);
  check_range("tolerance", settings.tolerance, 0, 1);
}

}  // namespace sinew
