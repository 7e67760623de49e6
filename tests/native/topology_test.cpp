#include "sinew/topology.h"

#include <gtest/gtest.h>

#include <limits>

#include "failures.h"
#include "meshes.h"

namespace sinew {
namespace {

using Ints = std::vector<std::int32_t>;

std::vector<std::uint32_t> neighbours(const Topology& topology, std::size_t v) {
  return {topology.neighbours(v).begin(), topology.neighbours(v).end()};
}

// Two triangles side by side, a wire from 3 to 4, and 5 alone.
const Ints kEdges{2, 0, 0, 1, 1, 2, 3, 1, 2, 3, 3, 4};
const Ints kOffsets{0, 3, 6};
const Ints kCorners{0, 1, 2, 2, 1, 3};

TEST(Topology, NeighboursAreInTheOrderOfTheEdges) {
  const Topology topology(6, kEdges, kOffsets, kCorners);
  EXPECT_EQ(topology.vertex_count(), 6);
  EXPECT_EQ(topology.edge_count(), 6);
  EXPECT_EQ(topology.corner_count(), 6);
  EXPECT_EQ(neighbours(topology, 0), (std::vector<std::uint32_t>{2, 1}));
  EXPECT_EQ(neighbours(topology, 1), (std::vector<std::uint32_t>{0, 2, 3}));
  EXPECT_EQ(neighbours(topology, 3), (std::vector<std::uint32_t>{1, 2, 4}));
  EXPECT_TRUE(neighbours(topology, 5).empty());
}

TEST(Topology, CornersAreInTheOrderOfTheFaces) {
  const Topology topology(6, kEdges, kOffsets, kCorners);
  ASSERT_EQ(topology.corners(2).size(), 2u);
  EXPECT_EQ(topology.corners(2)[0].previous, 1u);
  EXPECT_EQ(topology.corners(2)[0].next, 0u);
  EXPECT_EQ(topology.corners(2)[1].previous, 3u);
  EXPECT_EQ(topology.corners(2)[1].next, 1u);
  EXPECT_TRUE(topology.corners(4).empty());
}

TEST(Topology, ABoundaryEdgeHasOneFace) {
  const Topology open(6, kEdges, kOffsets, kCorners);
  for (const std::size_t v : {0, 1, 2, 3}) EXPECT_TRUE(open.is_boundary(v));
  EXPECT_FALSE(open.is_boundary(4));  // a wire
  EXPECT_FALSE(open.is_boundary(5));
  const Ints tetrahedron_edges{0, 1, 0, 2, 0, 3, 1, 2, 2, 3, 3, 1};
  const Topology closed(4, tetrahedron_edges, Ints{0, 3, 6, 9, 12}, Ints{0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2});
  for (std::size_t v = 0; v < 4; ++v) EXPECT_FALSE(closed.is_boundary(v));
  // Three faces on the edge 0-1, and three that are alone on their outer edges.
  const Topology fins(5, Ints{0, 1, 1, 2, 2, 0, 1, 3, 3, 0, 1, 4, 4, 0}, Ints{0, 3, 6, 9},
                      Ints{0, 1, 2, 0, 1, 3, 0, 1, 4});
  EXPECT_TRUE(fins.is_boundary(2));
  rigs::Random random(1);
  const meshes::Mesh mesh = meshes::sheet(random, 12, 15);
  const auto topology = mesh.topology();
  const auto pinned = meshes::pinned(mesh, meshes::Floats(mesh.vertices, 1.0f));
  for (std::int32_t v = 0; v < mesh.vertices; ++v) {
    EXPECT_EQ(topology->is_boundary(v), pinned[v] == 0) << v;
  }
}

TEST(Topology, OfNothing) {
  EXPECT_EQ(Topology(0, {}).vertex_count(), 0);
  EXPECT_EQ(Topology(3, {}).corner_count(), 0);
  EXPECT_EQ(Topology(3, {}, Ints{0}).corner_count(), 0);
}

TEST(Topology, RefusesWhatIsWrong) {
  const auto said = [](std::ptrdiff_t vertices, const Ints& edges, const Ints& offsets, const Ints& corners) {
    return complaint([&] { Topology(vertices, edges, offsets, corners); });
  };
  EXPECT_EQ(said(-1, {}, {}, {}), "vertex_count is -1; expected 0 to 536,870,912");
  EXPECT_EQ(said(1 << 30, {}, {}, {}), "vertex_count is 1073741824; expected 0 to 536,870,912");
  EXPECT_EQ(said(3, {0, 1, 2}, {}, {}), "edges has 3 numbers; expected two per edge");
  EXPECT_EQ(said(3, {0, 3}, {}, {}), "edges names vertex 3; the mesh has 3 vertices");
  EXPECT_EQ(said(3, {0, -1}, {}, {}), "edges names vertex -1; the mesh has 3 vertices");
  EXPECT_EQ(said(3, {}, {0, 3}, {0, 1, 7}), "corner_vertices names vertex 7; the mesh has 3 vertices");
  EXPECT_EQ(said(3, {}, {}, {0, 1, 2}), "face_offsets is empty; expected one number more than there are rows");
  EXPECT_EQ(said(3, {}, {1, 3}, {0, 1, 2}), "face_offsets goes from 1 to 3; expected 0 to 3, the number of corners");
  EXPECT_EQ(said(3, {}, {0, 2, 3}, {0, 1, 2}), "face 0 has 2 corners; expected three at least");
  EXPECT_EQ(said(3, {}, {0, 5, 3}, {0, 1, 2}), "face_offsets[2] is 3, below the one before");
  EXPECT_EQ(said(3, {}, {0, 3, 1, 6}, {0, 1, 2, 0, 1, 2}), "face_offsets[2] is 1, below the one before");
  // Differences of these do not fit in 32 bits.
  EXPECT_EQ(said(3, {}, {0, std::numeric_limits<std::int32_t>::max(), -10, 6}, {0, 1, 2, 0, 1, 2}),
            "face_offsets[2] is -10, below the one before");
  EXPECT_EQ(said(3, {0, 1, 1, 2}, {0, 3}, {0, 1, 2}),
            "face 0 has a side from vertex 2 to vertex 0, which is not one of the edges");
}

}  // namespace
}  // namespace sinew
