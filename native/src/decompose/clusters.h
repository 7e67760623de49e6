/// Where a decomposition begins: parts of the mesh that move rigidly.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "decompose/motions.h"
#include "decompose/neighbours.h"

namespace sinew {

/// How far find_clusters advances the progress.
constexpr int kClusterSteps = 8;

/// Returns the cluster of each point, and how many there are: at most `most`. They are split at the point that moves least
/// like the others until there are enough or all move rigidly, and grown from their centres over the surface.
/// heads  one cluster for each, of the points nearest to it; empty: by splitting.
std::pair<std::vector<std::int32_t>, std::int32_t> find_clusters(const Clip& clip, const Neighbours& neighbours,
                                                                 std::int32_t most,
                                                                 std::span<const Eigen::Vector3d> heads,
                                                                 Progress* progress);

}  // namespace sinew
