#include "smoothing/neighbourhood.h"

#include <algorithm>
#include <cstring>
#include <tuple>

namespace sinew {
namespace {

constexpr std::uint32_t kNone = ~std::uint32_t{0};

constexpr std::size_t kPiece = kBlocksPerPiece * kBlock;

}  // namespace

Neighbourhood::Neighbourhood(const Topology& topology, std::vector<float> all_weights)
    : vertex_count(static_cast<std::size_t>(topology.vertex_count())) {
  for (std::size_t v = 0; v < vertex_count; ++v) {
    if (all_weights[v] != 0) vertices.push_back(static_cast<std::uint32_t>(v));
  }
  worked_on = vertices.size();
  const auto sizes = [&](std::uint32_t v) {
    return std::tuple(topology.corners(v).size(), topology.neighbours(v).size());
  };
  for (std::size_t first = 0; first < worked_on; first += kPiece) {
    const auto piece = std::span(vertices).subspan(first, std::min(kPiece, worked_on - first));
    std::ranges::stable_sort(piece, {}, sizes);
  }
  while (vertices.size() % kBlock != 0) vertices.push_back(vertices[worked_on - 1]);
  const std::size_t lanes = vertices.size(), blocks = lanes / kBlock;

  for (const std::uint32_t v : vertices) {
    weights.push_back(all_weights[v]);
    counts.push_back(static_cast<float>(topology.neighbours(v).size()));
  }

  std::vector<std::uint32_t> point_of(vertex_count, kNone);
  for (std::size_t i = worked_on; i-- > 0;) point_of[vertices[i]] = static_cast<std::uint32_t>(i);
  const auto place = [&](std::uint32_t v) {
    if (point_of[v] == kNone) {
      point_of[v] = static_cast<std::uint32_t>(vertices.size());
      vertices.push_back(v);
    }
    return 4 * point_of[v];
  };

  neighbour_begin.push_back(0);
  corner_begin.push_back(0);
  for (std::size_t b = 0; b < blocks; ++b) {
    std::size_t most_neighbours = 0, most_corners = 0;
    for (std::size_t i = b * kBlock; i < (b + 1) * kBlock; ++i) {
      most_neighbours = std::max(most_neighbours, topology.neighbours(vertices[i]).size());
      most_corners = std::max(most_corners, topology.corners(vertices[i]).size());
    }
    neighbour_begin.push_back(static_cast<std::uint32_t>(neighbour_begin.back() + most_neighbours));
    corner_begin.push_back(static_cast<std::uint32_t>(corner_begin.back() + most_corners));
  }
  neighbours = aligned<Entry>(neighbour_begin.back());
  corners = aligned<CornerEntry>(corner_begin.back());
  for (std::size_t i = 0; i < lanes; ++i) {
    const std::size_t b = i / kBlock, lane = i % kBlock;
    const std::uint32_t v = vertices[i], own = static_cast<std::uint32_t>(4 * i);
    const auto around = topology.neighbours(v);
    for (std::uint32_t k = neighbour_begin[b]; k < neighbour_begin[b + 1]; ++k) {
      const std::uint32_t n = k - neighbour_begin[b];
      neighbours[k][lane] = n < around.size() ? place(around[n]) : own;
    }
    const auto faces = topology.corners(v);
    for (std::uint32_t k = corner_begin[b]; k < corner_begin[b + 1]; ++k) {
      const std::uint32_t n = k - corner_begin[b];
      corners[k].previous[lane] = n < faces.size() ? place(faces[n].previous) : own;
      corners[k].next[lane] = n < faces.size() ? place(faces[n].next) : own;
    }
  }
}

void Neighbourhood::gather(const float* positions, std::size_t begin, std::size_t end, float* points) const {
  for (std::size_t i = begin; i < end; ++i) {
    const std::size_t v = vertices[i];
    // The fourth number is the next vertex's, if there is one.
    std::memcpy(points + 4 * i, positions + 3 * v, (v + 1 < vertex_count ? 4 : 3) * sizeof(float));
  }
}

void Neighbourhood::scatter(const float* points, std::size_t begin, std::size_t end, float* positions) const {
  for (std::size_t i = begin * kBlock; i < std::min(end * kBlock, worked_on); ++i) {
    std::copy_n(points + 4 * i, 3, positions + 3 * std::size_t{vertices[i]});
  }
}

}  // namespace sinew
