/// Which points of a clip are near each other on the surface, and how rigidly they move together.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "decompose/clip.h"
#include "sinew/lists.h"

namespace sinew {

struct Neighbour {
  std::uint32_t point;
  float share;  ///< those of a point's neighbours sum to 1
};

/// Of each point, ascending.
using Neighbours = Lists<Neighbour>;

/// Pairs of points that tie unconnected parts to each other: each part by its shortest way to another one until all are
/// connected, and every point to the nearest of another part that is no farther than twice the mean edge. Without faces,
/// every point is a part. edges  pairs of points; those that are too many are ignored.
std::vector<std::pair<std::uint32_t, std::uint32_t>> ties_between_parts(
    std::span<const Eigen::Vector4d> points, std::span<const std::pair<std::uint32_t, std::uint32_t>> edges,
    const Progress* progress = nullptr);

/// The neighbours by faces and by ties. A neighbour's share is inverse to how much the distance to it changes over the
/// frames.
Neighbours neighbours_of(const Clip& clip, std::span<const std::int32_t> face_offsets,
                         std::span<const std::int32_t> face_vertices, const Progress* progress = nullptr);

}  // namespace sinew
