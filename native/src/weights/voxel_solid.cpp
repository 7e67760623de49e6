#include "weights/voxel_solid.h"

#include <cmath>
#include <limits>

#include "base/parallel.h"

namespace sinew {
namespace {

constexpr int kBrick = 8;
constexpr int kMargin = 2;
// The longest side of the mesh is not a whole number of voxels, so that a surface at a simple fraction of it is not in
// between two.
constexpr double kOdd = 0.382;
constexpr std::uint32_t kFarCell = std::numeric_limits<std::uint32_t>::max();

}  // namespace

bool meets_cube(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  constexpr double kHalf = 0.5 + 1e-9;
  if ((a.cwiseMin(b).cwiseMin(c).array() > kHalf).any()) return false;
  if ((a.cwiseMax(b).cwiseMax(c).array() < -kHalf).any()) return false;
  const std::array<Eigen::Vector3d, 3> sides{b - a, c - b, a - c};
  const auto is_apart = [&](const Eigen::Vector3d& axis) {
    const double x = axis.dot(a), y = axis.dot(b), z = axis.dot(c), radius = kHalf * axis.cwiseAbs().sum();
    return std::min({x, y, z}) > radius || std::max({x, y, z}) < -radius;
  };
  if (is_apart(sides[0].cross(sides[1]))) return false;
  for (const Eigen::Vector3d& side : sides) {
    if (is_apart({0, -side.z(), side.y()})) return false;
    if (is_apart({side.z(), 0, -side.x()})) return false;
    if (is_apart({-side.y(), side.x(), 0})) return false;
  }
  return true;
}

VoxelGrid::VoxelGrid(std::span<const Eigen::Vector3d> points, int resolution) : voxel_(1 / (resolution - kOdd)) {
  Eigen::Vector3d half = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) half = half.cwiseMax(point.cwiseAbs());
  for (int axis = 0; axis < 3; ++axis) {
    counts_[axis] = 2 * (static_cast<int>(std::ceil(std::min(half[axis], 0.5) / voxel_)) + kMargin) + 1;
    half_[axis] = counts_[axis] / 2.0;
  }
  strides_ = {1, counts_[0], counts_[0] * counts_[1]};
}

Eigen::Vector3d VoxelGrid::between_centres(const Eigen::Vector3d& point) const {
  Eigen::Vector3d at = coordinates(point).array() - 0.5;
  for (int axis = 0; axis < 3; ++axis) at[axis] = std::clamp(at[axis], 0.0 + kMargin, counts_[axis] - 1.0 - kMargin);
  return at;
}

std::int32_t VoxelGrid::cell_at(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d at = coordinates(point);
  std::int32_t cell = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double index = std::clamp(std::floor(at[axis]), 0.0 + kMargin, counts_[axis] - 1.0 - kMargin);
    cell += static_cast<std::int32_t>(index) * strides_[axis];
  }
  return cell;
}

std::array<int, 3> VoxelGrid::place_of(std::int32_t cell) const {
  return {cell % counts_[0], cell / strides_[1] % counts_[1], cell / strides_[2]};
}

Eigen::Vector3d VoxelGrid::centre(std::int32_t cell) const {
  const auto [i, j, k] = place_of(cell);
  return point({i + 0.5, j + 0.5, k + 0.5});
}

std::array<GridStep, 26> grid_steps(const VoxelGrid& grid) {
  constexpr std::array<std::uint32_t, 4> kLengths{0, kStepsPerVoxel, kDiagonalStep, kLongestStep};
  std::array<GridStep, 26> steps;
  std::size_t count = 0;
  for (int k = -1; k <= 1; ++k) {
    for (int j = -1; j <= 1; ++j) {
      for (int i = -1; i <= 1; ++i) {
        if (const int axes = i * i + j * j + k * k) steps[count++] = {grid.cell(i, j, k), kLengths[axes]};
      }
    }
  }
  return steps;
}

VoxelSolid::VoxelSolid(std::span<const Eigen::Vector3d> points, std::span<const Triangle> triangles,
                       const TriangleTree& tree, int resolution, const Progress* progress)
    : grid_(points, resolution), is_solid_(grid_.cell_count()) {
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    if (t % 1024 == 0) stop_if_cancelled(progress);
    std::array<Eigen::Vector3d, 3> corners;
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d& point = points[triangles[t][i]];
      is_solid_[grid_.cell_at(point)] = 1;  // also where it is astray
      corners[i] = grid_.coordinates(point);
    }
    mark_triangle(corners);
  }
  const auto& counts = grid_.counts();
  std::array<int, 3> bricks;
  for (int axis = 0; axis < 3; ++axis) bricks[axis] = (counts[axis] + kBrick - 1) / kBrick;
  parallel_for(
      static_cast<std::size_t>(bricks[0]) * bricks[1] * bricks[2], 16, [&](std::size_t begin, std::size_t end) {
        stop_if_cancelled(progress);
        for (std::size_t brick = begin; brick < end; ++brick) {
          const int b = static_cast<int>(brick);
          fill_brick({b % bricks[0] * kBrick, b / bricks[0] % bricks[1] * kBrick, b / bricks[0] / bricks[1] * kBrick},
                     tree);
        }
      });
  number();
}

void VoxelSolid::mark_triangle(const std::array<Eigen::Vector3d, 3>& corners) {
  const auto& [a, b, c] = corners;
  const Eigen::Vector3d low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
  std::array<int, 3> first, last;
  int cells = 1;
  double around = 1;  // cells, also those outside the grid
  for (int axis = 0; axis < 3; ++axis) {
    const int end = grid_.counts()[axis] - kMargin;  // what is astray is clipped
    if (high[axis] < kMargin || low[axis] >= end) return;
    first[axis] = std::max(kMargin, static_cast<int>(std::floor(std::max(low[axis], 0.0))));
    last[axis] = std::min(end - 1, static_cast<int>(std::floor(std::min(high[axis], 1.0 * end))));
    cells *= last[axis] - first[axis] + 1;
    around *= high[axis] - low[axis] + 1;
  }
  if (cells == 1) {
    is_solid_[grid_.cell(first[0], first[1], first[2])] = 1;
    return;
  }
  if (around > 512) {  // in halves, of which most cells of the whole's box are outside
    const std::array sides{(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()};
    const auto longest = std::ranges::max_element(sides) - sides.begin();
    const Eigen::Vector3d &from = corners[longest], &to = corners[(longest + 1) % 3],
                          &third = corners[(longest + 2) % 3];
    const Eigen::Vector3d middle = (from + to) / 2;
    mark_triangle({from, middle, third});
    mark_triangle({middle, to, third});
    return;
  }
  for (int k = first[2]; k <= last[2]; ++k) {
    for (int j = first[1]; j <= last[1]; ++j) {
      for (int i = first[0]; i <= last[0]; ++i) {
        auto& is_solid = is_solid_[grid_.cell(i, j, k)];
        const Eigen::Vector3d centre(i + 0.5, j + 0.5, k + 0.5);
        if (!is_solid && meets_cube(a - centre, b - centre, c - centre)) is_solid = 1;
      }
    }
  }
}

/// No surface is between the cells of a brick that are connected without those that the surface meets. There the
/// winding number changes only because of holes elsewhere.
void VoxelSolid::fill_brick(std::array<int, 3> first, const TriangleTree& tree) {
  constexpr double kUnsure = 0.25;
  std::array<int, 3> last;
  for (int axis = 0; axis < 3; ++axis) {
    last[axis] = std::min(first[axis] + kBrick, grid_.counts()[axis] - kMargin);
    first[axis] = std::max(first[axis], kMargin);  // also where a part astray is around the whole grid
  }
  std::array<std::uint8_t, kBrick * kBrick * kBrick> is_seen{};
  std::vector<std::array<int, 3>> group;
  const auto visit = [&](const std::array<int, 3>& at) {
    for (int axis = 0; axis < 3; ++axis) {
      if (at[axis] < first[axis] || at[axis] >= last[axis]) return;
    }
    auto& seen = is_seen[((at[2] - first[2]) * kBrick + at[1] - first[1]) * kBrick + at[0] - first[0]];
    if (seen) return;
    seen = 1;
    if (!is_solid_[grid_.cell(at[0], at[1], at[2])]) group.push_back(at);
  };
  std::vector<std::int32_t> inside;
  for (int k = first[2]; k < last[2]; ++k) {
    for (int j = first[1]; j < last[1]; ++j) {
      for (int i = first[0]; i < last[0]; ++i) {
        group.clear();
        visit({i, j, k});
        for (std::size_t next = 0; next < group.size(); ++next) {
          const auto [x, y, z] = group[next];
          visit({x - 1, y, z});
          visit({x + 1, y, z});
          visit({x, y - 1, z});
          visit({x, y + 1, z});
          visit({x, y, z - 1});
          visit({x, y, z + 1});
        }
        double winding = 0;
        bool is_sure = false;
        for (const auto& [x, y, z] : group) {
          const std::int32_t cell = grid_.cell(x, y, z);
          if (!is_sure) {
            winding = std::abs(tree.winding_number(grid_.centre(cell)));
            is_sure = std::abs(winding - 0.5) > kUnsure;
          }
          if (winding > 0.5) inside.push_back(cell);
        }
      }
    }
  }
  for (const std::int32_t cell : inside) is_solid_[cell] = 1;
}

void VoxelSolid::number() {
  index_of_.assign(is_solid_.size(), -1);
  cells_.clear();
  for (std::size_t cell = 0; cell < is_solid_.size(); ++cell) {
    if (!is_solid_[cell]) continue;
    index_of_[cell] = static_cast<std::int32_t>(cells_.size());
    cells_.push_back(static_cast<std::int32_t>(cell));
  }
}

void VoxelSolid::connect(std::span<const std::uint32_t> seeds) {
  const auto steps = grid_steps(grid_);
  std::vector<std::uint8_t> is_reached(size());
  std::vector<std::uint32_t> reached(seeds.begin(), seeds.end());
  for (const std::uint32_t seed : seeds) is_reached[seed] = 1;
  for (std::size_t next = 0; next < reached.size(); ++next) {
    for (const GridStep& step : steps) {
      const std::int32_t other = index_of_[cells_[reached[next]] + step.offset];
      if (other < 0 || is_reached[other]) continue;
      is_reached[other] = 1;
      reached.push_back(static_cast<std::uint32_t>(other));
    }
  }
  if (reached.size() == size() || reached.empty()) return;

  // From all reached cells through all others; the margin is never left, since nothing begins there.
  constexpr std::uint8_t kNoStep = 255;
  std::vector<std::uint32_t> distance(grid_.cell_count(), kFarCell);
  std::vector<std::uint8_t> back(grid_.cell_count(), kNoStep);
  std::vector<BucketQueue::Seed> from;
  for (const std::uint32_t cell : reached) {
    distance[cells_[cell]] = 0;
    from.push_back({0, static_cast<std::uint32_t>(cells_[cell])});
  }
  const auto& counts = grid_.counts();
  std::vector<std::uint8_t> is_margin(grid_.cell_count());
  for (int k = 0; k < counts[2]; ++k) {
    for (int j = 0; j < counts[1]; ++j) {
      const bool edge = k == 0 || j == 0 || k == counts[2] - 1 || j == counts[1] - 1;
      for (int i = 0; i < counts[0]; ++i) {
        if (edge || i == 0 || i == counts[0] - 1) is_margin[grid_.cell(i, j, k)] = 1;
      }
    }
  }
  BucketQueue().run(std::move(from), [&](std::uint32_t now, std::uint32_t cell, const auto& push) {
    if (distance[cell] != now || is_margin[cell]) return;
    for (std::size_t s = 0; s < steps.size(); ++s) {
      const auto other = static_cast<std::uint32_t>(static_cast<std::int32_t>(cell) + steps[s].offset);
      if (distance[other] <= now + steps[s].length) continue;
      distance[other] = now + steps[s].length;
      back[other] = static_cast<std::uint8_t>(s);
      push(distance[other], other);
    }
  });
  for (std::size_t index = 0; index < is_reached.size(); ++index) {
    if (is_reached[index]) continue;
    for (std::int32_t cell = cells_[index]; back[cell] != kNoStep; cell -= steps[back[cell]].offset)
      is_solid_[cell] = 1;
  }
  number();
}

}  // namespace sinew
