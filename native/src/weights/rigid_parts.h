/// Parts that keep their shape: all of their vertices have the same weights.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "sinew/automatic_weights.h"
#include "weights/welded_mesh.h"

namespace sinew {

/// Returns the diagonals of the bounding boxes of the connected parts.
std::vector<double> part_diagonals(const WeldedMesh& mesh);

class RigidRows {
 public:
  /// rows, ways  of each point. Fixed ones keep their own weights.
  RigidRows(const WeldedMesh& mesh, const WeightTable& rows, std::span<const WeightWay> ways,
            const WeightSettings& settings);

  /// Returns the weights of a vertex, if it is in a rigid part.
  std::optional<std::span<const BoneWeight>> of(std::size_t vertex) const {
    if (group_of_.empty() || group_of_[vertex] < 0) return std::nullopt;
    return rows_.row(static_cast<std::size_t>(group_of_[vertex]));
  }

 private:
  std::vector<std::int32_t> group_of_;  // of each vertex, or -1; empty if there are no groups
  WeightTable rows_;
};

}  // namespace sinew
