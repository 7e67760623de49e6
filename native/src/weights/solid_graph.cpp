#include "weights/solid_graph.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/parallel.h"

namespace sinew {
namespace {

// Cubes along a side of a divided cell, if there are not more of them in all than kMostCubes.
constexpr std::array kFactors{5, 3};
constexpr std::size_t kMostCubes = 250'000;
constexpr std::uint32_t kUnreached = std::numeric_limits<std::uint32_t>::max();

std::uint32_t length_of(const Eigen::Vector3d& voxels) {
  return static_cast<std::uint32_t>(std::lround(kStepsPerVoxel * voxels.norm()));
}

}  // namespace

SolidGraph::SolidGraph(const VoxelSolid& solid)
    : solid_(&solid), steps_(grid_steps(solid.grid())), is_open_(solid.size(), 1) {
  for (int k = -1; k <= 1; ++k) {
    for (int j = -1; j <= 1; ++j) {
      for (int i = -1; i <= 1; ++i) {
        if (i != 0 || j != 0 || k != 0) directions_.push_back({{i, j, k}, solid.grid().cell(i, j, k)});
      }
    }
  }
}

std::uint32_t SolidGraph::cube(std::int32_t block, int i, int j, int k) const {
  const std::size_t own = (static_cast<std::size_t>(k) * factor_ + j) * factor_ + i;
  return static_cast<std::uint32_t>(solid_->size() + static_cast<std::size_t>(block) * cubes() + own);
}

Eigen::Vector3d SolidGraph::within_cell(int cube) const {
  const Eigen::Vector3i at(cube % factor_, cube / factor_ % factor_, cube / factor_ / factor_);
  return (at.cast<double>() + Eigen::Vector3d::Constant(0.5)) / factor_ - Eigen::Vector3d::Constant(0.5);
}

Eigen::Vector3d SolidGraph::centre(std::uint32_t node) const {
  if (node < solid_->size()) return solid_->grid().centre(solid_->cells()[node]);
  const auto own = static_cast<int>(node - solid_->size());
  return solid_->grid().centre(solid_->cells()[cells_[own / cubes()]]) +
         solid_->grid().voxel() * within_cell(own % cubes());
}

std::int32_t SolidGraph::open_at(const Eigen::Vector3d& coordinates) const {
  const VoxelGrid& grid = solid_->grid();
  std::array<int, 3> at, within;
  for (int axis = 0; axis < 3; ++axis) {
    if (!(coordinates[axis] >= 0 && coordinates[axis] < grid.counts()[axis])) return -1;
    at[axis] = static_cast<int>(coordinates[axis]);
    within[axis] = std::min(factor_ - 1, static_cast<int>((coordinates[axis] - at[axis]) * factor_));
  }
  const std::int32_t index = solid_->index_of(grid.cell(at[0], at[1], at[2]));
  if (index < 0 || !is_divided() || block_of_[index] < 0) return index;
  const std::uint32_t node = cube(block_of_[index], within[0], within[1], within[2]);
  return is_open_[node] ? static_cast<std::int32_t>(node) : -1;
}

std::int32_t SolidGraph::node_of(const Eigen::Vector3d& point) const {
  const VoxelGrid& grid = solid_->grid();
  const std::int32_t cell = grid.cell_at(point), index = solid_->index_of(cell);
  if (index < 0 || !is_divided() || block_of_[index] < 0) return index;
  const std::uint32_t first = cube(block_of_[index], 0, 0, 0);
  const Eigen::Vector3d at = (point - grid.centre(cell)) / grid.voxel();
  std::int32_t best = -1;
  double nearest = std::numeric_limits<double>::infinity();
  for (int own = 0; own < cubes(); ++own) {
    const double squared = (within_cell(own) - at).squaredNorm();
    if (!is_open_[first + own] || squared >= nearest) continue;
    nearest = squared;
    best = static_cast<std::int32_t>(first) + own;
  }
  return best;
}

void SolidGraph::divide(std::span<const Eigen::Vector3d> points, std::span<const Triangle> triangles,
                        const TriangleTree& tree, std::span<const std::uint8_t> is_wanted, const Progress* progress) {
  std::vector<std::int32_t> wanted;
  for (std::size_t index = 0; index < is_wanted.size(); ++index) {
    if (is_wanted[index]) wanted.push_back(static_cast<std::int32_t>(index));
  }
  const VoxelGrid& grid = solid_->grid();
  std::vector<std::vector<std::uint32_t>> surface(wanted.size());
  parallel_for(wanted.size(), 64, [&](std::size_t begin, std::size_t end) {
    stop_if_cancelled(progress);
    for (std::size_t w = begin; w < end; ++w) {
      const Eigen::Vector3d centre = grid.centre(solid_->cells()[wanted[w]]);
      const Eigen::Vector3d half = Eigen::Vector3d::Constant((0.5 + 1e-6) * grid.voxel());
      tree.in_box(centre - half, centre + half, surface[w]);
      std::erase_if(surface[w], [&](std::uint32_t t) {
        const auto corner = [&](int i) -> Eigen::Vector3d { return (points[triangles[t][i]] - centre) / grid.voxel(); };
        return !meets_cube(corner(0), corner(1), corner(2));
      });
    }
  });
  std::vector<std::vector<std::uint32_t>> of_block;
  for (std::size_t w = 0; w < wanted.size(); ++w) {
    if (surface[w].empty()) continue;
    cells_.push_back(wanted[w]);
    of_block.push_back(std::move(surface[w]));
  }
  for (const int factor : kFactors) {
    if (cells_.size() * factor * factor * factor <= kMostCubes) {
      factor_ = factor;
      break;
    }
  }
  if (factor_ == 1) cells_.clear();
  if (cells_.empty()) return;
  block_of_.assign(solid_->size(), -1);
  for (std::size_t block = 0; block < cells_.size(); ++block) {
    block_of_[cells_[block]] = static_cast<std::int32_t>(block);
    is_open_[cells_[block]] = 0;
  }
  is_open_.resize(solid_->size() + cells_.size() * cubes());
  parallel_for(cells_.size(), 16, [&](std::size_t begin, std::size_t end) {
    stop_if_cancelled(progress);
    for (std::size_t block = begin; block < end; ++block) {
      open_cubes(static_cast<std::int32_t>(block), of_block[block], points, triangles, tree);
    }
  });
}

void SolidGraph::open_cubes(std::int32_t block, const std::vector<std::uint32_t>& surface,
                            std::span<const Eigen::Vector3d> points, std::span<const Triangle> triangles,
                            const TriangleTree& tree) {
  const VoxelGrid& grid = solid_->grid();
  const Eigen::Vector3d low = grid.centre(solid_->cells()[cells_[block]]) - Eigen::Vector3d::Constant(grid.voxel() / 2);
  std::vector<std::uint8_t> is_surface(cubes());
  for (const std::uint32_t t : surface) {
    std::array<Eigen::Vector3d, 3> corners;  // in cubes, from the cell's corner
    for (int i = 0; i < 3; ++i) corners[i] = (points[triangles[t][i]] - low) * factor_ / grid.voxel();
    const Eigen::Vector3d least = corners[0].cwiseMin(corners[1]).cwiseMin(corners[2]),
                          most = corners[0].cwiseMax(corners[1]).cwiseMax(corners[2]);
    std::array<int, 3> first, last;
    for (int axis = 0; axis < 3; ++axis) {
      first[axis] = static_cast<int>(std::clamp(std::floor(least[axis]), 0.0, factor_ - 1.0));
      last[axis] = static_cast<int>(std::clamp(std::floor(most[axis]), 0.0, factor_ - 1.0));
    }
    const bool is_one = first == last;
    for (int k = first[2]; k <= last[2]; ++k) {
      for (int j = first[1]; j <= last[1]; ++j) {
        for (int i = first[0]; i <= last[0]; ++i) {
          auto& own = is_surface[(k * factor_ + j) * factor_ + i];
          const Eigen::Vector3d centre(i + 0.5, j + 0.5, k + 0.5);
          if (!own && (is_one || meets_cube(corners[0] - centre, corners[1] - centre, corners[2] - centre))) own = 1;
        }
      }
    }
  }
  const std::uint32_t first = cube(block, 0, 0, 0);
  for (int own = 0; own < cubes(); ++own) is_open_[first + own] = is_surface[own];
  open_inside(block, is_surface, tree);
  if (std::ranges::none_of(std::span(is_open_).subspan(first, cubes()), [](auto is_open) { return is_open != 0; })) {
    is_open_[first + cubes() / 2] = 1;  // so that no cell is lost by rounding
  }
}

/// The winding number is the same in all cubes that are connected without the surface, except where there are holes.
void SolidGraph::open_inside(std::int32_t block, std::span<const std::uint8_t> is_surface, const TriangleTree& tree) {
  constexpr double kUnsure = 0.25;
  const std::uint32_t first = cube(block, 0, 0, 0);
  std::vector<std::uint8_t> is_seen(is_surface.begin(), is_surface.end());
  std::vector<int> group;
  for (int from = 0; from < cubes(); ++from) {
    if (is_seen[from]) continue;
    group.assign(1, from);
    is_seen[from] = 1;
    for (std::size_t next = 0; next < group.size(); ++next) {
      int stride = 1;
      for (int axis = 0; axis < 3; ++axis, stride *= factor_) {
        const int at = group[next] / stride % factor_;
        for (const int by : {-1, 1}) {
          if (at + by < 0 || at + by >= factor_ || is_seen[group[next] + by * stride]) continue;
          is_seen[group[next] + by * stride] = 1;
          group.push_back(group[next] + by * stride);
        }
      }
    }
    double winding = 0;
    bool is_sure = false;
    for (const int own : group) {
      if (!is_sure) {
        winding = std::abs(tree.winding_number(centre(first + own)));
        is_sure = std::abs(winding - 0.5) > kUnsure;
      }
      if (winding > 0.5) is_open_[first + own] = 1;
    }
  }
}

void SolidGraph::ways_of_cell(std::uint32_t node, std::vector<Way>& ways) const {
  for (const Direction& direction : directions_) {
    const std::int32_t other = solid_->index_of(solid_->cells()[node] + direction.offset);
    if (other < 0) continue;
    const auto& by = direction.by;
    const Eigen::Vector3d away(by[0], by[1], by[2]);
    if (block_of_[other] < 0) {
      ways.push_back({static_cast<std::uint32_t>(other), length_of(away)});
      continue;
    }
    std::array<int, 3> first, last;  // the cubes that touch
    for (int axis = 0; axis < 3; ++axis) {
      first[axis] = by[axis] < 0 ? factor_ - 1 : 0;
      last[axis] = by[axis] > 0 ? 0 : factor_ - 1;
    }
    for (int k = first[2]; k <= last[2]; ++k) {
      for (int j = first[1]; j <= last[1]; ++j) {
        for (int i = first[0]; i <= last[0]; ++i) {
          const int own = (k * factor_ + j) * factor_ + i;
          ways.push_back({cube(block_of_[other], i, j, k), length_of(away + within_cell(own))});
        }
      }
    }
  }
}

void SolidGraph::ways_of_cube(std::uint32_t node, std::vector<Way>& ways) const {
  const auto number = static_cast<int>(node - solid_->size());
  const int block = number / cubes(), own = number % cubes();
  const std::array<int, 3> at{own % factor_, own / factor_ % factor_, own / factor_ / factor_};
  for (const Direction& direction : directions_) {
    std::array<int, 3> to, cell_by;
    for (int axis = 0; axis < 3; ++axis) {
      to[axis] = at[axis] + direction.by[axis];
      cell_by[axis] = to[axis] < 0 ? -1 : to[axis] >= factor_ ? 1 : 0;
      to[axis] -= cell_by[axis] * factor_;
    }
    const std::int32_t cell = solid_->cells()[cells_[block]];
    const std::int32_t other = solid_->index_of(cell + solid_->grid().cell(cell_by[0], cell_by[1], cell_by[2]));
    if (other < 0) continue;
    if (block_of_[other] >= 0) {
      const Eigen::Vector3d away(direction.by[0], direction.by[1], direction.by[2]);
      ways.push_back({cube(block_of_[other], to[0], to[1], to[2]), length_of(away / factor_)});
      continue;
    }
    const Eigen::Vector3d away(cell_by[0], cell_by[1], cell_by[2]);
    ways.push_back({static_cast<std::uint32_t>(other), length_of(away - within_cell(own))});
  }
}

void SolidGraph::all_ways(std::uint32_t node, std::vector<Way>& ways) const {
  node < solid_->size() ? ways_of_cell(node, ways) : ways_of_cube(node, ways);
}

void SolidGraph::list_ways() {
  row_of_.assign(size(), -1);
  row_begin_.assign(1, 0);
  std::vector<Way> own;
  for (std::uint32_t node = 0; node < size(); ++node) {
    if (!is_open_[node]) continue;
    if (node < solid_->size() && std::ranges::none_of(directions_, [&](const Direction& direction) {
          const std::int32_t other = solid_->index_of(solid_->cells()[node] + direction.offset);
          return other >= 0 && block_of_[other] >= 0;
        })) {
      continue;
    }
    own.clear();
    all_ways(node, own);
    row_of_[node] = static_cast<std::int32_t>(row_begin_.size()) - 1;
    std::ranges::copy_if(own, std::back_inserter(ways_), [&](const Way& way) { return is_open_[way.node] != 0; });
    row_begin_.push_back(static_cast<std::uint32_t>(ways_.size()));
  }
}

void SolidGraph::connect(std::span<const std::uint32_t> seeds) {
  if (!is_divided()) return;
  list_ways();
  std::vector<std::uint8_t> is_reached(size());
  std::vector<std::uint32_t> reached;
  for (const std::uint32_t seed : seeds) {
    if (!is_reached[seed]) reached.push_back(seed);
    is_reached[seed] = 1;
  }
  for (std::size_t next = 0; next < reached.size(); ++next) {
    neighbours(reached[next], [&](std::uint32_t other, std::uint32_t) {
      if (is_reached[other]) return;
      is_reached[other] = 1;
      reached.push_back(other);
    });
  }
  if (reached.size() == static_cast<std::size_t>(std::ranges::count(is_open_, 1)) || reached.empty()) return;

  std::vector<std::uint32_t> distance(size(), kUnreached), back(size(), kUnreached);
  std::vector<BucketQueue::Seed> from;
  for (const std::uint32_t node : reached) {
    distance[node] = 0;
    from.push_back({0, node});
  }
  std::vector<Way> own;
  BucketQueue().run(std::move(from), [&](std::uint32_t now, std::uint32_t node, const auto& push) {
    if (distance[node] != now) return;
    own.clear();
    all_ways(node, own);
    for (const Way& way : own) {
      if (distance[way.node] <= now + way.length) continue;
      distance[way.node] = now + way.length;
      back[way.node] = node;
      push(distance[way.node], way.node);
    }
  });
  for (std::uint32_t node = 0; node < size(); ++node) {
    if (!is_open_[node] || is_reached[node]) continue;
    for (std::uint32_t at = node; back[at] != kUnreached; at = back[at]) is_open_[at] = 1;
  }
  ways_.clear();
  list_ways();
}

}  // namespace sinew
