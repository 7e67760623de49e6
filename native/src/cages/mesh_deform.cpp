#include "sinew/mesh_deform.h"

#include <algorithm>
#include <array>
#include <limits>

#include "base/aligned.h"
#include "base/offsets.h"
#include "base/parallel.h"
#include "base/vertex_numbers.h"
#include "cages/mesh_deform_kernel.h"

// CMakeLists.txt has this file compiled without fused multiply-adds: Blender rounds in between.

namespace sinew {
namespace {

// The approximate cost of a weight, and of a block besides, on one thread.
constexpr double kMicrosecondsPerWeight = 1e-4, kMicrosecondsOfABlock = 5e-2;

constexpr std::size_t kBlocksPerTask = 32, kVertices = CagedBlock::kVertices;

using Lanes = Eigen::Array<float, kVertices, 1>;

struct Influence {
  std::int32_t cage_vertex;
  float weight;
};

/// A vertex that moves.
struct Caged {
  std::uint32_t vertex;
  float share;          ///< its weight in the group, divided by the sum of its influences
  std::uint32_t place;  ///< near for vertices that are near each other
};

/// Returns a number whose every third bit is one of the lowest ten of i, the first one at bit 0.
std::uint32_t spread(std::uint32_t i) {
  std::uint32_t found = 0;
  for (int bit = 0; bit < 10; ++bit) found |= (i >> bit & 1) << (3 * bit);
  return found;
}

/// The cube around the cage's vertices, in 1024 cells along each axis that are numbered along a Z-order curve.
class Cells {
 public:
  explicit Cells(std::span<const float> points) {
    const Eigen::Map<const Eigen::Array3Xf> all(points.data(), 3, std::ssize(points) / 3);
    if (points.empty()) return;
    low_ = all.rowwise().minCoeff();
    const float size = (all.rowwise().maxCoeff() - low_).maxCoeff();
    if (size > 0 && std::isfinite(1023 / size)) per_cell_ = 1023 / size;
  }

  std::uint32_t number(const Eigen::Array3f& point) const {
    const Eigen::Array3f at = ((point - low_) * per_cell_).max(0).min(1023);  // what is not a number is somewhere
    std::uint32_t found = 0;
    for (int axis = 0; axis < 3; ++axis) {
      found |= spread(std::isfinite(at[axis]) ? static_cast<std::uint32_t>(at[axis]) : 0) << axis;
    }
    return found;
  }

 private:
  Eigen::Array3f low_ = Eigen::Array3f::Zero();
  float per_cell_ = 0;
};

}  // namespace

/// The vertices that move, in blocks of neighbours, which mostly follow the same vertices of the cage.
struct MeshDeform::Blocks {
  std::vector<Caged> vertices;
  std::vector<std::size_t> first{0};  ///< of each block, and the end: where its vertices of the cage begin
  std::vector<std::uint32_t> cage;
  Aligned<float> weights;  ///< kVertices for each in `cage`

  std::size_t count() const { return first.size() - 1; }

  CagedBlock block(std::size_t number) const {
    const std::size_t begin = first[number];
    return {{cage.data() + begin, first[number + 1] - begin}, weights.get() + begin * kVertices};
  }

  /// Makes the blocks of `vertices`.
  void fill(const Binding& binding) {
    std::ranges::stable_sort(vertices, {}, &Caged::place);
    std::vector<float> found;
    std::array<std::vector<Influence>, kVertices> influences;
    for (std::size_t begin = 0; begin < vertices.size(); begin += kVertices) {
      for (std::size_t lane = 0; lane < kVertices; ++lane) {
        auto& own = influences[lane];
        own.clear();
        if (begin + lane >= vertices.size()) continue;
        const std::uint32_t v = vertices[begin + lane].vertex;
        for (std::int32_t i = binding.offsets[v]; i < binding.offsets[v + 1]; ++i) {
          own.push_back({binding.cage_vertices[i], binding.weights[i]});
        }
        std::ranges::stable_sort(own, {}, &Influence::cage_vertex);  // as Blender has them
      }
      add(influences, found);
    }
    weights = aligned<float>(found.size());
    std::ranges::copy(found, weights.get());
  }

  /// Adds a block. influences: of each of its vertices, by the vertex of the cage; found: in and out, `weights`.
  void add(const std::array<std::vector<Influence>, kVertices>& influences, std::vector<float>& found) {
    std::array<std::size_t, kVertices> done{};
    for (;;) {
      constexpr std::int32_t kNone = std::numeric_limits<std::int32_t>::max();
      std::int32_t next = kNone;
      for (std::size_t lane = 0; lane < kVertices; ++lane) {
        if (done[lane] < influences[lane].size()) next = std::min(next, influences[lane][done[lane]].cage_vertex);
      }
      if (next == kNone) break;
      cage.push_back(static_cast<std::uint32_t>(CagedBlock::kNumbers) * static_cast<std::uint32_t>(next));
      for (std::size_t lane = 0; lane < kVertices; ++lane) {
        const bool follows = done[lane] < influences[lane].size() && influences[lane][done[lane]].cage_vertex == next;
        found.push_back(follows ? influences[lane][done[lane]++].weight : 0);
      }
    }
    first.push_back(cage.size());
  }
};

MeshDeform::MeshDeform(const Binding& binding, const VertexGroup& group)
    : vertex_count_(std::ssize(binding.offsets) - 1),
      bound_(binding.cage_positions.begin(), binding.cage_positions.end()) {
  const std::ptrdiff_t cage_vertices = cage_vertex_count();
  check_vertex_numbers("cage_positions", binding.cage_positions, 3 * cage_vertices, "the cage");
  const std::ptrdiff_t count = std::ssize(binding.weights);
  check_offsets("offsets", binding.offsets, count, "influences");
  if (std::ssize(binding.cage_vertices) != count) {
    fail("cage_vertices has ", plural(std::ssize(binding.cage_vertices), "number"), "; weights has ", count);
  }
  const std::vector<float> weights = weights_of(group, vertex_count_);
  const Cells cells(bound_);
  const auto blocks = std::make_shared<Blocks>();
  for (std::ptrdiff_t v = 0; v < vertex_count_; ++v) {
    const std::int32_t begin = binding.offsets[v], end = binding.offsets[v + 1];
    float sum = 0;
    Eigen::Array3f place = Eigen::Array3f::Zero();
    for (std::int32_t i = begin; i < end; ++i) {
      const std::int32_t own = binding.cage_vertices[i];
      if (own < 0 || own >= cage_vertices) {
        fail("vertex ", v, " follows vertex ", own, " of a cage that has ", plural(cage_vertices, "vertex"));
      }
      if (!std::isfinite(binding.weights[i])) fail("weights is not finite at influence ", i);
      sum += binding.weights[i];
      place += binding.weights[i] * Eigen::Map<const Eigen::Array3f>(bound_.data() + 3 * std::size_t(own));
    }
    if (weights[v] <= 0 || !(sum > 0)) continue;
    blocks->vertices.push_back({static_cast<std::uint32_t>(v), weights[v] / sum, cells.number(place / sum)});
  }
  blocks->fill(binding);
  blocks_ = blocks;
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

double MeshDeform::microseconds(const Settings&) const {
  return kMicrosecondsPerWeight * static_cast<double>(blocks_->cage.size() * kVertices) +
         kMicrosecondsOfABlock * static_cast<double>(blocks_->count());
}

void MeshDeform::apply(const Settings& settings, std::span<float> positions) const {
  check_position_count("positions", positions, vertex_count());
  check(settings);
  const std::vector<float>& moved = *settings.differences;
  const bool is_finite = Eigen::Map<const Eigen::ArrayXf>(moved.data(), std::ssize(moved)).isFinite().all();
  const auto& m = settings.mesh_from_bound;
  const Blocks& blocks = *blocks_;
  const std::size_t piece = threads_pay(microseconds(settings)) ? kBlocksPerTask : blocks.count();
  parallel_for(blocks.count(), piece, [&](std::size_t begin, std::size_t end) {
    alignas(64) float sums[3 * kVertices];
    const Eigen::Map<const Lanes, Eigen::Aligned64> x(sums), y(sums + kVertices), z(sums + 2 * kVertices);
    for (std::size_t number = begin; number < end; ++number) {
      sum_influences(blocks.block(number), moved.data(), is_finite, sums);
      const std::size_t first = number * kVertices, count = std::min(kVertices, blocks.vertices.size() - first);
      Lanes shares = Lanes::Zero();
      for (std::size_t lane = 0; lane < count; ++lane) shares[lane] = blocks.vertices[first + lane].share;
      const Lanes sx = x * shares, sy = y * shares, sz = z * shares;
      for (int row = 0; row < 3; ++row) {
        const Lanes way = m(row, 0) * sx + m(row, 1) * sy + m(row, 2) * sz;
        for (std::size_t lane = 0; lane < count; ++lane) {
          positions[3 * std::size_t{blocks.vertices[first + lane].vertex} + row] += way[lane];
        }
      }
    }
  });
}

}  // namespace sinew
