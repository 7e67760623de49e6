#include "sinew/topology.h"

#include <algorithm>

#include "base/vertex_numbers.h"
#include "mesh/faces.h"

namespace sinew {

Topology::Topology(std::ptrdiff_t vertex_count, std::span<const std::int32_t> edges,
                   std::span<const std::int32_t> face_offsets, std::span<const std::int32_t> corner_vertices) {
  check_vertex_count(vertex_count);
  if (edges.size() % 2 != 0) {
    fail("edges has ", plural(std::ssize(edges), "number"), "; expected two per edge");
  }
  check_vertices("edges", edges, vertex_count);
  const Faces faces{face_offsets, corner_vertices};
  check_faces(faces, vertex_count, "corner_vertices");
  const auto count = static_cast<std::size_t>(vertex_count);
  neighbours_ = {count, [&](const auto& add) {
                   for (std::size_t i = 0; i < edges.size(); i += 2) {
                     add(edges[i], edges[i + 1]);
                     add(edges[i + 1], edges[i]);
                   }
                 }};
  corners_ = {count, [&](const auto& add) {
                for (std::size_t f = 0; f < faces.count(); ++f) {
                  const std::int32_t begin = face_offsets[f], end = face_offsets[f + 1];
                  for (std::int32_t i = begin; i < end; ++i) {
                    const std::int32_t previous = corner_vertices[i > begin ? i - 1 : end - 1],
                                       next = corner_vertices[i + 1 < end ? i + 1 : begin];
                    add(corner_vertices[i], {static_cast<std::uint32_t>(previous), static_cast<std::uint32_t>(next)});
                  }
                }
              }};
  find_boundary(edges, faces);
}

void Topology::find_boundary(std::span<const std::int32_t> edges, const Faces& faces) {
  // An edge is looked up at the end that has fewer edges.
  const Lists<std::uint32_t> edges_at(static_cast<std::size_t>(vertex_count()), [&](const auto& add) {
    for (std::size_t i = 0; i < edges.size(); ++i) add(edges[i], static_cast<std::uint32_t>(i / 2));
  });
  std::vector<std::uint8_t> faces_of(edges.size() / 2);  // 2: two or more
  for_sides(faces, [&](std::size_t f, std::int32_t a, std::int32_t b) {
    std::uint32_t from = a, to = b;
    if (neighbours(from).size() > neighbours(to).size()) std::swap(from, to);
    const auto found = std::ranges::find(neighbours(from), to);
    if (found == neighbours(from).end()) {
      fail("face ", f, " has a side from vertex ", a, " to vertex ", b, ", which is not one of the edges");
    }
    auto& count = faces_of[edges_at[from][found - neighbours(from).begin()]];
    count = std::min(count + 1, 2);
  });
  is_boundary_.assign(static_cast<std::size_t>(vertex_count()), false);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (faces_of[i / 2] == 1) is_boundary_[edges[i]] = true;
  }
}

}  // namespace sinew
