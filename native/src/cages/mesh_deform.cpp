#include "sinew/mesh_deform.h"

#include "base/parallel.h"
#include "base/vertex_numbers.h"

// CMakeLists.txt has this file compiled without fused multiply-adds: Blender rounds in between.

namespace sinew {
namespace {

// The approximate cost of an influence on one thread.
constexpr double kMicroseconds = 1.5e-3;

constexpr std::size_t kPiece = 512;

using Four = Eigen::Array4f;

}  // namespace

MeshDeform::MeshDeform(const Binding& binding, const VertexGroup& group)
    : vertex_count_(std::ssize(binding.offsets) - 1),
      bound_(binding.cage_positions.begin(), binding.cage_positions.end()) {
  if (vertex_count_ < 0) fail("offsets is empty; expected one number more than there are vertices");
  const std::ptrdiff_t cage_vertices = cage_vertex_count();
  check_vertex_numbers("cage_positions", binding.cage_positions, 3 * cage_vertices, "the cage");
  const std::ptrdiff_t count = std::ssize(binding.weights);
  if (std::ssize(binding.cage_vertices) != count) {
    fail("cage_vertices has ", plural(std::ssize(binding.cage_vertices), "number"), "; weights has ", count);
  }
  const std::vector<float> weights = weights_of(group, vertex_count_);
  first_.push_back(0);
  for (std::ptrdiff_t v = 0; v < vertex_count_; ++v) {
    const std::int32_t begin = binding.offsets[v], end = binding.offsets[v + 1];
    if (begin < 0 || end < begin || end > count) {
      fail("offsets goes from ", begin, " to ", end, " at vertex ", v, "; there are ", plural(count, "influence"));
    }
    float sum = 0;
    for (std::int32_t i = begin; i < end; ++i) {
      const std::int32_t own = binding.cage_vertices[i];
      if (own < 0 || own >= cage_vertices) {
        fail("vertex ", v, " follows vertex ", own, " of a cage that has ", plural(cage_vertices, "vertex"));
      }
      if (!std::isfinite(binding.weights[i])) fail("weights is not finite at influence ", i);
      sum += binding.weights[i];
    }
    if (weights[v] <= 0 || !(sum > 0)) continue;
    vertices_.push_back(static_cast<std::uint32_t>(v));
    shares_.push_back(weights[v] / sum);
    for (std::int32_t i = begin; i < end; ++i) {
      influences_.push_back({static_cast<std::uint32_t>(binding.cage_vertices[i]), binding.weights[i]});
    }
    first_.push_back(influences_.size());
  }
}

std::shared_ptr<const std::vector<float>> MeshDeform::differences(std::span<const float> cage,
                                                                  const Matrix4<float>& bound_from_cage) const {
  check_position_count("cage", cage, cage_vertex_count());
  const auto& m = bound_from_cage;
  auto found = std::make_shared<std::vector<float>>(4 * static_cast<std::size_t>(cage_vertex_count()));
  for (std::size_t c = 0; c < cage.size() / 3; ++c) {
    const float* const p = cage.data() + 3 * c;
    for (int row = 0; row < 3; ++row) {
      (*found)[4 * c + row] = p[0] * m(row, 0) + p[1] * m(row, 1) + m(row, 2) * p[2] + m(row, 3) - bound_[3 * c + row];
    }
  }
  return found;
}

void MeshDeform::check(const Settings& settings) const {
  if (!settings.mesh_from_bound.allFinite()) fail("the matrix is not finite");
  const std::ptrdiff_t count = settings.differences ? std::ssize(*settings.differences) / 4 : 0;
  if (!settings.differences || count != cage_vertex_count()) {
    fail("the cage has ", plural(count, "vertex"), "; the mesh was bound to ", cage_vertex_count());
  }
}

void MeshDeform::apply(const Settings& settings, std::span<float> positions) const {
  check_position_count("positions", positions, vertex_count());
  check(settings);
  const float* const moved = settings.differences->data();
  const auto& m = settings.mesh_from_bound;
  const bool threads = threads_pay(kMicroseconds * static_cast<double>(influences_.size()));
  parallel_for(vertices_.size(), threads ? kPiece : vertices_.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      // Four sums, so that an addition need not wait for the one before.
      Four sums[4] = {Four::Zero(), Four::Zero(), Four::Zero(), Four::Zero()};
      for (std::size_t k = first_[i]; k < first_[i + 1]; ++k) {
        const Influence& own = influences_[k];
        sums[k % 4] += own.weight * Eigen::Map<const Four>(moved + 4 * std::size_t{own.cage_vertex});
      }
      const Four way = ((sums[0] + sums[1]) + (sums[2] + sums[3])) * shares_[i];
      float* const point = positions.data() + 3 * std::size_t{vertices_[i]};
      for (int row = 0; row < 3; ++row) point[row] += m(row, 0) * way[0] + m(row, 1) * way[1] + m(row, 2) * way[2];
    }
  });
}

}  // namespace sinew
