/// The cells of a solid and the ways between them, with smaller cells where parts are close.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/cancelled.h"
#include "weights/voxel_solid.h"

namespace sinew {

/// The solid's own cells are nodes 0 up to solid.size(). A divided cell is replaced by cubes, an odd number along each
/// axis, so that a plane of symmetry is still in the middle of cells. Cubes that are not solid are closed: no way leads
/// through them.
class SolidGraph {
 public:
  SolidGraph() = default;
  explicit SolidGraph(const VoxelSolid& solid);

  /// Divides the wanted cells that the surface meets, as finely as their number allows. tree  of the solid's triangles.
  /// is_wanted  of each cell of the solid.
  void divide(std::span<const Eigen::Vector3d> points, std::span<const Triangle> triangles, const TriangleTree& tree,
              std::span<const std::uint8_t> is_wanted, const Progress* progress);
  /// Opens cubes so that all that is open is connected with the given nodes, by the shortest ways. To be called once,
  /// after divide().
  void connect(std::span<const std::uint32_t> seeds);

  std::size_t size() const { return is_open_.size(); }
  bool is_divided() const { return !cells_.empty(); }
  bool is_open(std::size_t node) const { return is_open_[node] != 0; }
  /// Cubes along an axis of a divided cell; 1: none is divided.
  int factor() const { return factor_; }
  Eigen::Vector3d centre(std::uint32_t node) const;
  /// Returns the open node that holds a point of the grid's coordinates, or -1.
  std::int32_t open_at(const Eigen::Vector3d& coordinates) const;
  /// Returns the node for a place: the one that holds it, in a divided cell the closest open one; -1: none is solid.
  std::int32_t node_of(const Eigen::Vector3d& point) const;

  /// Calls visit(node, weight) for the open ones of the eight cells or cubes around a point, with the weights of trilinear
  /// interpolation between their centres.
  template <class Visit>
  void around(const Eigen::Vector3d& point, const Visit& visit) const {
    const std::int32_t own = is_divided() ? solid_->index_of(solid_->grid().cell_at(point)) : -1;
    if (own < 0 || block_of_[own] < 0) {
      solid_->around(point, [&](std::int32_t index, double weight) {
        if (is_open_[index]) visit(index, weight);
      });
      return;
    }
    const Eigen::Vector3d at = solid_->grid().coordinates(point) * factor_ - Eigen::Vector3d::Constant(0.5);
    const Eigen::Vector3d low = at.array().floor(), high = at - low;
    for (int corner = 0; corner < 8; ++corner) {
      const int i = corner & 1, j = corner >> 1 & 1, k = corner >> 2;
      const std::int32_t node = open_at((low + Eigen::Vector3d(i + 0.5, j + 0.5, k + 0.5)) / factor_);
      if (node < 0) continue;
      visit(node, (i ? high.x() : 1 - high.x()) * (j ? high.y() : 1 - high.y()) * (k ? high.z() : 1 - high.z()));
    }
  }

  /// Calls visit(node, length) for the open neighbours of an open node, with lengths in units of voxel / kStepsPerVoxel.
  template <class Visit>
  void neighbours(std::uint32_t node, const Visit& visit) const {
    const std::int32_t row = row_of_.empty() ? -1 : row_of_[node];
    if (row >= 0) {
      for (std::uint32_t i = row_begin_[row]; i < row_begin_[row + 1]; ++i) visit(ways_[i].node, ways_[i].length);
      return;
    }
    const std::int32_t cell = solid_->cells()[node];
    for (const GridStep& step : steps_) {
      const std::int32_t other = solid_->index_of(cell + step.offset);
      if (other >= 0) visit(static_cast<std::uint32_t>(other), step.length);
    }
  }

 private:
  struct Way {
    std::uint32_t node, length;
  };
  struct Direction {
    std::array<int, 3> by;
    std::int32_t offset;
  };
  struct Block;
  int cubes() const { return factor_ * factor_ * factor_; }
  std::uint32_t cube(std::int32_t block, int i, int j, int k) const;
  /// The middle of a cube, from that of its cell, in voxels.
  Eigen::Vector3d within_cell(int cube) const;
  void open_cubes(std::int32_t block, const std::vector<std::uint32_t>& surface,
                  std::span<const Eigen::Vector3d> points, std::span<const Triangle> triangles,
                  const TriangleTree& tree);
  void open_inside(std::int32_t block, std::span<const std::uint8_t> is_surface, const TriangleTree& tree);
  /// Also those that are closed, unless their cell is divided. Adds to `ways`.
  void all_ways(std::uint32_t node, std::vector<Way>& ways) const;
  void ways_of_cell(std::uint32_t node, std::vector<Way>& ways) const;
  void ways_of_cube(std::uint32_t node, std::vector<Way>& ways) const;
  void list_ways();

  const VoxelSolid* solid_ = nullptr;
  std::array<GridStep, 26> steps_;
  std::vector<Direction> directions_;
  int factor_ = 1;
  std::vector<std::int32_t> block_of_;  // of each cell, or -1; empty: none is divided
  std::vector<std::int32_t> cells_;     // of each block, the index of its cell
  std::vector<std::uint8_t> is_open_;
  std::vector<std::int32_t> row_of_;  // of nodes whose ways are listed; -1: those of a cell among cells
  std::vector<std::uint32_t> row_begin_;
  std::vector<Way> ways_;
};

}  // namespace sinew
