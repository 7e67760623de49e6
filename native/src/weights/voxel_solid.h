/// The inside of a mesh as voxels.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/cancelled.h"
#include "weights/triangle_tree.h"

namespace sinew {

/// A grid of cubes about the origin with an odd number of cells along each axis, so that a symmetric mesh has its plane
/// of symmetry through the middle of cells; the outermost two layers are empty.
class VoxelGrid {
 public:
  /// points  in the unit frame.
  VoxelGrid(std::span<const Eigen::Vector3d> points, int resolution);

  double voxel() const { return voxel_; }
  std::size_t cell_count() const { return static_cast<std::size_t>(strides_[2]) * counts_[2]; }
  const std::array<int, 3>& counts() const { return counts_; }
  /// From a cell to the next along each axis.
  const std::array<std::int32_t, 3>& strides() const { return strides_; }

  /// Coordinates in which cell (i, j, k) is the cube from (i, j, k) to (i + 1, j + 1, k + 1).
  Eigen::Vector3d coordinates(const Eigen::Vector3d& point) const { return point / voxel_ + half_; }
  Eigen::Vector3d point(const Eigen::Vector3d& coordinates) const { return (coordinates - half_) * voxel_; }
  /// Coordinates in which the centre of cell (i, j, k) is (i, j, k), moved to within the grid.
  Eigen::Vector3d between_centres(const Eigen::Vector3d& point) const;
  /// Returns the cell that holds a point, or the closest.
  std::int32_t cell_at(const Eigen::Vector3d& point) const;
  std::array<int, 3> place_of(std::int32_t cell) const;
  Eigen::Vector3d centre(std::int32_t cell) const;
  std::int32_t cell(int i, int j, int k) const { return i + j * strides_[1] + k * strides_[2]; }

 private:
  double voxel_;
  std::array<int, 3> counts_;
  std::array<std::int32_t, 3> strides_;
  Eigen::Vector3d half_;
};

/// A step from a cell to one of its 26 neighbours.
struct GridStep {
  std::int32_t offset;
  std::uint32_t length;  ///< in units of voxel / kStepsPerVoxel
};
// A third and a fifth of a voxel are whole numbers of units.
constexpr std::uint32_t kStepsPerVoxel = 60, kDiagonalStep = 85, kLongestStep = 104;  // 60 sqrt(1, 2, 3)
std::array<GridStep, 26> grid_steps(const VoxelGrid& grid);

/// Whether a triangle meets the cube of half side 1/2 about the origin, by the separating axis theorem.
/// Akenine-Moller, "Fast 3D triangle-box overlap testing", 2001.
bool meets_cube(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// The cells that the surface meets, or whose centres have |winding number| > 1/2.
class VoxelSolid {
 public:
  VoxelSolid(std::span<const Eigen::Vector3d> points, std::span<const Triangle> triangles, const TriangleTree& tree,
             int resolution, const Progress* progress);

  const VoxelGrid& grid() const { return grid_; }
  /// Solid cells, ascending.
  std::span<const std::int32_t> cells() const { return cells_; }
  std::size_t size() const { return cells_.size(); }
  /// Index of a cell in cells(), or -1.
  std::int32_t index_of(std::int32_t cell) const { return index_of_[cell]; }

  /// Calls visit(index, weight) for the solid ones of the eight cells around a point, with the weights of trilinear
  /// interpolation between their centres.
  template <class Visit>
  void around(const Eigen::Vector3d& point, const Visit& visit) const {
    const Eigen::Vector3d at = grid_.between_centres(point);
    const Eigen::Vector3d low = at.array().floor(), high = at - low;
    const std::int32_t first =
        grid_.cell(static_cast<int>(low.x()), static_cast<int>(low.y()), static_cast<int>(low.z()));
    for (int corner = 0; corner < 8; ++corner) {
      const int i = corner & 1, j = corner >> 1 & 1, k = corner >> 2;
      const std::int32_t index = index_of_[first + grid_.cell(i, j, k)];
      if (index < 0) continue;
      visit(index, (i ? high.x() : 1 - high.x()) * (j ? high.y() : 1 - high.y()) * (k ? high.z() : 1 - high.z()));
    }
  }

  /// Makes cells solid so that all are connected with the given ones: from each that was not, a straight way through
  /// the air to the closest that was. seeds  indices of solid cells.
  void connect(std::span<const std::uint32_t> seeds);

 private:
  void mark_triangle(const std::array<Eigen::Vector3d, 3>& corners);
  void fill_brick(std::array<int, 3> first, const TriangleTree& tree);
  void number();

  VoxelGrid grid_;
  std::vector<std::uint8_t> is_solid_;
  std::vector<std::int32_t> index_of_, cells_;
};

/// Items in the order of their distances, which are integers that grow by kLongestStep at most (Dial 1969).
class BucketQueue {
 public:
  struct Seed {
    std::uint32_t distance, item;
  };

  /// Calls visit(distance, item, push) for the seeds and for what is pushed, nearest first; push(distance, item) may
  /// add items at most kLongestStep farther than the visited one. Items that were pushed several times are visited as
  /// often.
  template <class Visit>
  void run(std::vector<Seed> seeds, const Visit& visit) {
    std::ranges::sort(seeds, [](const Seed& a, const Seed& b) {
      return a.distance != b.distance ? a.distance < b.distance : a.item < b.item;
    });
    std::size_t waiting = 0, seed = 0;
    const auto push = [&](std::uint32_t distance, std::uint32_t item) {
      buckets_[distance % kBuckets].push_back(item);
      ++waiting;
    };
    for (std::uint32_t now = 0; waiting > 0 || seed < seeds.size(); ++now) {
      if (waiting == 0) now = seeds[seed].distance;
      for (; seed < seeds.size() && seeds[seed].distance == now; ++seed) push(now, seeds[seed].item);
      auto& bucket = buckets_[now % kBuckets];
      taken_.swap(bucket);
      waiting -= taken_.size();
      for (const std::uint32_t item : taken_) visit(now, item, push);
      taken_.clear();
    }
  }

 private:
  static constexpr std::uint32_t kBuckets = 128;
  static_assert(kBuckets > kLongestStep);
  std::array<std::vector<std::uint32_t>, kBuckets> buckets_;
  std::vector<std::uint32_t> taken_;
};

}  // namespace sinew
