/// Which points faces join.
#pragma once

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>
#include <vector>

#include "mesh/faces.h"
#include "sinew/lists.h"

namespace sinew {

/// Returns the points that sides of faces join to each point, ascending, each once. point_of  of each vertex;
/// points  how many there are.
Lists<std::uint32_t> neighbours_by_sides(const Faces& faces, std::span<const std::uint32_t> point_of,
                                         std::size_t points);

/// The same where each vertex is its own point.
inline Lists<std::uint32_t> neighbours_by_sides(const Faces& faces, std::size_t vertices) {
  std::vector<std::uint32_t> each(vertices);
  std::iota(each.begin(), each.end(), 0u);
  return neighbours_by_sides(faces, each, vertices);
}

/// Calls visit(vertices) for the vertices at each place, exactly: ascending numbers, one at least.
template <class Visit>
void for_coincident(std::span<const float> positions, const Visit& visit) {
  std::vector<std::uint32_t> order(positions.size() / 3);
  std::iota(order.begin(), order.end(), 0u);
  const auto place = [&](std::uint32_t v) {
    return std::array{positions[3 * v], positions[3 * v + 1], positions[3 * v + 2]};
  };
  std::ranges::stable_sort(order, [&](std::uint32_t a, std::uint32_t b) { return place(a) < place(b); });
  for (std::size_t begin = 0, end = 0; begin < order.size(); begin = end) {
    while (end < order.size() && place(order[end]) == place(order[begin])) ++end;
    visit(std::span<const std::uint32_t>(order).subspan(begin, end - begin));
  }
}

/// Numbers points by their first vertices. first_of  V: the first of the vertices that are one point. Returns the point
/// of each vertex, and how many there are.
inline std::pair<std::vector<std::uint32_t>, std::size_t> points_of(std::span<const std::uint32_t> first_of) {
  std::vector<std::uint32_t> point_of(first_of.size());
  std::size_t count = 0;
  for (std::uint32_t v = 0; v < first_of.size(); ++v) {
    point_of[v] = first_of[v] == v ? static_cast<std::uint32_t>(count++) : point_of[first_of[v]];
  }
  return {std::move(point_of), count};
}

}  // namespace sinew
