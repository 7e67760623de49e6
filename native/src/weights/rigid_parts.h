/// Parts that keep their shape: all of their vertices have the same weights.
#pragma once

#include <cstdint>
#include <vector>

#include "weights/point_weights.h"
#include "weights/welded_mesh.h"

namespace sinew {

/// Returns the diagonals of the bounding boxes of the connected parts.
std::vector<double> part_diagonals(const WeldedMesh& mesh);

class RigidRows {
 public:
  /// is_fixed  of each point: these keep their own weights.
  RigidRows(const WeldedMesh& mesh, const PointRows& rows, std::int32_t joint_count, const WeightSettings& settings,
            const std::vector<std::uint8_t>& is_fixed);

  /// Returns the weights of a vertex, or null if it is not in a rigid part.
  const WeightRow* of(std::size_t vertex) const {
    return group_of_.empty() || group_of_[vertex] < 0 ? nullptr : &rows_[group_of_[vertex]];
  }

 private:
  std::vector<std::int32_t> group_of_;  // of each vertex, or -1; empty if there are no groups
  std::vector<WeightRow> rows_;
};

}  // namespace sinew
