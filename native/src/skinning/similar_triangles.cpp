#include "skinning/similar_triangles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

#include "base/per_thread.h"
#include "mesh/faces.h"
#include "skinning/similarity_kernel.h"

namespace sinew {
namespace {

// Triangles whose weights differ by less than this fraction of sigma are treated as one.
constexpr double kCellsASigma = 16;
// What is left out is less than this fraction of the whole.
constexpr double kNegligible = 1e-5;
// Anything less than this counts as 0: exp(-70), or the product of two weights of 1e-15.
constexpr double kLeastSimilarity = 1e-30;

std::uint64_t pair_key(std::int32_t first, std::int32_t second) {
  return static_cast<std::uint64_t>(first) << 32 | static_cast<std::uint32_t>(second);
}

struct Triangle {
  double area;
  Eigen::Vector3d center;
};

Triangle triangle_of(const Skin& skin, const std::array<std::int32_t, 3>& corners) {
  std::array<Eigen::Vector3d, 3> points;
  for (int i = 0; i < 3; ++i) {
    points[i] = Eigen::Map<const Eigen::Vector3f>(skin.rest_positions().data() + 3 * corners[i]).cast<double>();
  }
  return {0.5 * (points[1] - points[0]).cross(points[2] - points[0]).norm(), (points[0] + points[1] + points[2]) / 3};
}

struct CellKey {
  std::uint32_t pair, x, y;
  bool operator==(const CellKey&) const = default;
};

struct CellHash {
  std::size_t operator()(const CellKey& key) const {
    std::uint64_t hash = key.pair;
    for (const std::uint32_t next : {key.x, key.y}) {
      hash = (hash ^ next) * 0x9e3779b97f4a7c15u;  // 2^64 / golden ratio
      hash ^= hash >> 32;
    }
    return hash;
  }
};

/// Sums over the triangles of a cell, each weighted by its mass.
struct Cell {
  std::uint32_t pair;
  double mass = 0, x = 0, y = 0;
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
};

}  // namespace

WeightTable merged_influences(const Skin& skin) {
  WeightTable table(skin.joint_count());
  std::vector<BoneWeight> own;
  for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
    own.clear();
    for (auto i = skin.offsets()[v]; i < skin.offsets()[v + 1]; ++i) {
      own.push_back({skin.joints()[i], skin.weights()[i]});
    }
    merge_bones(own);
    std::erase_if(own, [](const BoneWeight& one) { return !(one.weight > 0); });
    table.add_row(own);
  }
  return table;
}

SimilarTriangles::SimilarTriangles(const Skin& skin, const WeightTable& influences,
                                   std::span<const std::int32_t> face_offsets,
                                   std::span<const std::int32_t> face_vertices, double sigma, Progress& progress)
    : sigma_(sigma) {
  double area = 0;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  for_triangles(face_offsets, face_vertices, [&](const auto& corners) {
    const Triangle triangle = triangle_of(skin, corners);
    area += triangle.area;
    origin += triangle.area * triangle.center;
  });
  if (!(area > 0)) return;
  origin /= area;
  std::ranges::copy(origin, origin_.begin());

  std::vector<Cell> cells;
  std::unordered_map<CellKey, std::uint32_t, CellHash> cell_of_key;
  const double width = sigma / kCellsASigma;
  const auto number = [&](float weight) { return static_cast<std::uint32_t>(std::min(weight / width, 4294967295.0)); };
  std::vector<BoneWeight> own;
  for_triangles(face_offsets, face_vertices, [&](const auto& corners) {
    if (progress.is_cancelled()) return;
    progress.advance(1);
    const Triangle triangle = triangle_of(skin, corners);
    if (!(triangle.area > 0)) return;
    own.clear();
    for (const std::int32_t v : corners) {
      for (const BoneWeight& one : influences.row(v)) own.push_back({one.bone, one.weight / 3});
    }
    merge_bones(own);
    for (std::size_t a = 0; a < own.size(); ++a) {
      for (std::size_t b = a + 1; b < own.size(); ++b) {
        const auto next_pair = static_cast<std::uint32_t>(pairs_.size());
        const auto [pair, is_new_pair] = pair_of_joints_.try_emplace(pair_key(own[a].bone, own[b].bone), next_pair);
        if (is_new_pair) pairs_.push_back({0, 0, 0});
        const auto next_cell = static_cast<std::uint32_t>(cells.size());
        const CellKey key{pair->second, number(own[a].weight), number(own[b].weight)};
        const auto [cell_at, is_new_cell] = cell_of_key.try_emplace(key, next_cell);
        if (is_new_cell) {
          cells.push_back({pair->second});
          ++pairs_[pair->second].length;
        }
        Cell& cell = cells[cell_at->second];
        const double x = own[a].weight, y = own[b].weight, mass = triangle.area / area * x * y;
        cell.mass += mass;
        cell.x += mass * x;
        cell.y += mass * y;
        cell.moment += mass * (triangle.center - origin);
      }
    }
  });

  std::size_t numbers = 0;
  for (Pair& pair : pairs_) {
    pair.begin = numbers;
    pair.length = (pair.length + kCellLanes - 1) / kCellLanes * kCellLanes;
    numbers += 6 * pair.length;
  }
  cells_.assign(numbers, 0);
  std::vector<std::size_t> next(pairs_.size());
  for (const Cell& cell : cells) {
    if (!(cell.mass > 0)) continue;  // underflow
    Pair& pair = pairs_[cell.pair];
    pair.mass += cell.mass;
    float* const at = cells_.data() + pair.begin + next[cell.pair]++;
    const double rows[6] = {cell.x / cell.mass / sigma,
                            cell.y / cell.mass / sigma,
                            cell.mass,
                            cell.moment.x(),
                            cell.moment.y(),
                            cell.moment.z()};
    for (int row = 0; row < 6; ++row) at[row * pair.length] = static_cast<float>(rows[row]);
  }
}

std::array<float, 3> SimilarTriangles::center_of(std::span<const BoneWeight> own) const {
  struct Term {
    const Pair* pair;
    float x, y;
    double most;  ///< the most it can add to the denominator
  };
  auto& terms = per_thread<std::vector<Term>>();  // keeps its memory
  terms.clear();
  double left = 0;
  for (std::size_t a = 0; a < own.size(); ++a) {
    for (std::size_t b = a + 1; b < own.size(); ++b) {
      const auto found = pair_of_joints_.find(pair_key(own[a].bone, own[b].bone));
      if (found == pair_of_joints_.end()) continue;
      const Pair& pair = pairs_[found->second];
      const double most = static_cast<double>(own[a].weight) * own[b].weight * pair.mass;
      terms.push_back({&pair, own[a].weight, own[b].weight, most});
      left += most;
    }
  }
  std::ranges::stable_sort(terms, std::greater<>(), &Term::most);
  double similarity = 0;
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (const Term& term : terms) {
    if (left < kNegligible * similarity) break;
    left -= term.most;
    const auto sums = similar_sum(term.x, term.y, cells_.data() + term.pair->begin, term.pair->length);
    const double weight = static_cast<double>(term.x) * term.y;
    similarity += weight * sums[0];
    moment += weight * Eigen::Vector3d(sums[1], sums[2], sums[3]);
  }
  std::array<float, 3> center;
  center.fill(std::numeric_limits<float>::quiet_NaN());
  if (!(similarity > kLeastSimilarity)) return center;
  for (int axis = 0; axis < 3; ++axis) center[axis] = static_cast<float>(origin_[axis] + moment[axis] / similarity);
  return center;
}

}  // namespace sinew
