#include "sinew/topology.h"

#include <algorithm>

#include "base/check.h"
#include "mesh/faces.h"

namespace sinew {
namespace {

// A point's index in floats, four per point, has to fit in 32 bits; some points are padding.
constexpr std::ptrdiff_t kMostVertices = std::ptrdiff_t{1} << 29;

/// Returns where the entries of each of `vertices` vertices begin: running sums of how often each number occurs.
std::vector<std::uint32_t> beginnings(std::span<const std::int32_t> numbers, std::ptrdiff_t vertices) {
  std::vector<std::uint32_t> begin(static_cast<std::size_t>(vertices) + 1);
  for (const std::int32_t v : numbers) ++begin[v + 1];
  for (std::size_t v = 1; v < begin.size(); ++v) begin[v] += begin[v - 1];
  return begin;
}

/// Calls visit(corner, next corner) for each corner of a face.
template <class Visit>
void around(std::size_t first, std::size_t end, const Visit& visit) {
  for (std::size_t corner = first; corner < end; ++corner) {
    visit(corner, corner + 1 < end ? corner + 1 : first);
  }
}

}  // namespace

Topology::Topology(std::ptrdiff_t vertex_count, std::span<const std::int32_t> edges,
                   std::span<const std::int32_t> face_offsets, std::span<const std::int32_t> corner_vertices) {
  if (vertex_count < 0) fail("the vertex count is ", vertex_count, "; expected 0 or more");
  if (vertex_count > kMostVertices) {
    fail("there are ", plural(vertex_count, "vertex"), "; expected ", grouped(kMostVertices), " at most");
  }
  if (edges.size() % 2 != 0) {
    fail("edges has ", plural(std::ssize(edges), "number"), "; expected two per edge");
  }
  check_vertices("edges", edges, vertex_count);
  check_vertices("corner_vertices", corner_vertices, vertex_count);
  check_face_offsets(face_offsets, std::ssize(corner_vertices));
  neighbour_begin_ = beginnings(edges, vertex_count);
  corner_begin_ = beginnings(corner_vertices, vertex_count);
  add_edges(edges);
  add_faces(face_offsets, corner_vertices);
  find_boundary(edges, face_offsets, corner_vertices);
}

void Topology::add_edges(std::span<const std::int32_t> edges) {
  neighbours_.resize(edges.size());
  std::vector<std::uint32_t> at(neighbour_begin_.begin(), neighbour_begin_.end() - 1);
  for (std::size_t i = 0; i < edges.size(); i += 2) {
    neighbours_[at[edges[i]]++] = edges[i + 1];
    neighbours_[at[edges[i + 1]]++] = edges[i];
  }
}

void Topology::add_faces(std::span<const std::int32_t> face_offsets, std::span<const std::int32_t> corner_vertices) {
  corners_.resize(corner_vertices.size());
  std::vector<std::uint32_t> at(corner_begin_.begin(), corner_begin_.end() - 1);
  for (std::size_t f = 0; f + 1 < face_offsets.size(); ++f) {
    std::int32_t previous = corner_vertices[face_offsets[f + 1] - 1];
    around(face_offsets[f], face_offsets[f + 1], [&](std::size_t corner, std::size_t next) {
      const std::int32_t v = corner_vertices[corner];
      corners_[at[v]++] = {static_cast<std::uint32_t>(previous), static_cast<std::uint32_t>(corner_vertices[next])};
      previous = v;
    });
  }
}

void Topology::find_boundary(std::span<const std::int32_t> edges, std::span<const std::int32_t> face_offsets,
                             std::span<const std::int32_t> corner_vertices) {
  // An edge is looked up at the end that has fewer edges.
  std::vector<std::uint32_t> edge_at(edges.size());  // parallel to neighbours_
  std::vector<std::uint32_t> at(neighbour_begin_.begin(), neighbour_begin_.end() - 1);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    edge_at[at[edges[i]]++] = static_cast<std::uint32_t>(i / 2);
  }
  std::vector<std::uint8_t> faces_of(edges.size() / 2);  // 2: two or more
  for (std::size_t f = 0; f + 1 < face_offsets.size(); ++f) {
    around(face_offsets[f], face_offsets[f + 1], [&](std::size_t corner, std::size_t next) {
      std::uint32_t from = corner_vertices[corner], to = corner_vertices[next];
      if (neighbours(from).size() > neighbours(to).size()) std::swap(from, to);
      const auto found = std::ranges::find(neighbours(from), to);
      if (found == neighbours(from).end()) {
        fail("face ", f, " has a side from vertex ", corner_vertices[corner], " to vertex ", corner_vertices[next],
             ", which is not one of the edges");
      }
      auto& count = faces_of[edge_at[neighbour_begin_[from] + (found - neighbours(from).begin())]];
      count = std::min(count + 1, 2);
    });
  }
  is_boundary_.assign(static_cast<std::size_t>(vertex_count()), false);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (faces_of[i / 2] == 1) is_boundary_[edges[i]] = true;
  }
}

}  // namespace sinew
