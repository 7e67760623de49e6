#include "sinew/smooth.h"

#include <gtest/gtest.h>

#include <limits>

#include "failures.h"
#include "meshes.h"

namespace sinew {
namespace {

using meshes::Floats;

TEST(Smooth, IsTheSlowFormula) {
  rigs::Random random(1);
  for (const std::int32_t size : {2, 9, 31}) {
    const meshes::Mesh mesh = meshes::sheet(random, size, size);
    const auto topology = mesh.topology();
    const Floats positions = meshes::random_positions(random, mesh.vertices);
    const Floats ones(mesh.vertices, 1.0f), weights = meshes::some_weights(random, mesh.vertices);
    Floats inverted;
    for (const float weight : weights) inverted.push_back(1 - weight);
    const std::pair<VertexGroup, Floats> groups[] = {
        {{}, ones}, {{{}, true}, ones}, {{weights}, weights}, {{weights, true}, inverted}};
    for (const auto& [group, effective] : groups) {
      const Smooth smooth(topology, group);
      EXPECT_EQ(smooth.vertex_count(), mesh.vertices);
      for (const Smooth::Settings& settings :
           {Smooth::Settings{}, Smooth::Settings{0.3f, 7}, Smooth::Settings{-0.4f, 2},
            Smooth::Settings{1.5f, 3, true, false, true}, Smooth::Settings{1, 2, false, true, false}}) {
        Floats own = positions;
        smooth.apply(settings, own);
        const auto expected = meshes::meant(mesh, meshes::points_of(positions), effective, settings);
        EXPECT_LT(meshes::largest_difference(own, expected), 2e-6);
      }
    }
  }
}

TEST(Smooth, PullsWhatHasNoEdgesToTheOriginAsBlenderDoes) {
  const Smooth smooth(std::make_shared<Topology>(1, std::span<const std::int32_t>{}));
  Floats positions{2, 4, 8};
  smooth.apply({0.25f, 1}, positions);
  EXPECT_EQ(positions, (Floats{1.5f, 3, 6}));
}

TEST(Smooth, LeavesAloneWhatItDoesNotMove) {
  rigs::Random random(2);
  const meshes::Mesh mesh = meshes::sheet(random, 9, 9);
  const Floats positions = meshes::random_positions(random, mesh.vertices);
  const Smooth all(mesh.topology());
  for (const Smooth::Settings& settings : {Smooth::Settings{0, 3}, Smooth::Settings{1, 0}, Smooth::Settings{1, -5},
                                           Smooth::Settings{1, 3, false, false, false}}) {
    Floats own = positions;
    all.apply(settings, own);
    EXPECT_EQ(own, positions);
  }
  Floats weights(mesh.vertices, -0.5f);
  weights[7] = 1;
  Floats own = positions;
  Smooth(mesh.topology(), {weights}).apply({}, own);
  for (std::size_t i = 0; i < own.size(); ++i) EXPECT_EQ(own[i] != positions[i], i / 3 == 7);
}

TEST(Smooth, OfNoVertices) {
  Floats none;
  Smooth(std::make_shared<Topology>(0, std::span<const std::int32_t>{})).apply({}, none);
}

TEST(Smooth, RefusesWhatIsWrong) {
  const auto topology = std::make_shared<Topology>(3, std::span<const std::int32_t>{});
  const Floats two(2, 1.0f), bad{0, 1, std::numeric_limits<float>::infinity()};
  EXPECT_EQ(complaint([&] { Smooth(topology, {two}); }), "weights has 2 numbers; the mesh has 3 vertices");
  EXPECT_EQ(complaint([&] { Smooth(topology, {bad}); }), "weights is not finite at vertex 2");
  Floats positions(6);
  EXPECT_EQ(complaint([&] { Smooth(topology).apply({}, positions); }), "positions has 6 numbers; expected 9 (3 x 3)");
  positions.resize(9);
  EXPECT_EQ(complaint([&] { Smooth(topology).apply({std::numeric_limits<float>::quiet_NaN()}, positions); }),
            "factor is nan; expected a finite number");
}

}  // namespace
}  // namespace sinew
