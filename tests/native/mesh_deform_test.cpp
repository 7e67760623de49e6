#include "sinew/mesh_deform.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "each_instruction_set.h"
#include "failures.h"
#include "meshes.h"

namespace sinew {
namespace {

using meshes::Floats;
using Ints = std::vector<std::int32_t>;

/// Vertices that follow some of a cage.
struct Caged {
  Caged(rigs::Random& random, std::int32_t vertices, std::int32_t cage_vertices)
      : bound(meshes::random_positions(random, cage_vertices)), cage(meshes::random_positions(random, cage_vertices)) {
    for (std::int32_t v = 0; v < vertices; ++v) {
      for (int i = static_cast<int>(random() % 30); i > 0; --i) {
        of_cage.push_back(static_cast<std::int32_t>(random() % cage_vertices));
        weights.push_back(static_cast<float>(rigs::uniform(random, 0.01, 1)));
      }
      offsets.push_back(static_cast<std::int32_t>(of_cage.size()));
    }
    matrix = rigs::random_rigid(random).cast<float>();
    back = 1.3f * rigs::random_rigid(random).cast<float>().topLeftCorner<3, 3>();
  }

  MeshDeform deform(const VertexGroup& group = {}) const {
    return MeshDeform({offsets, of_cage, weights, bound}, group);
  }

  MeshDeform::Settings settings(const MeshDeform& own) const { return {own.differences(cage, matrix), back}; }

  void move(meshes::Points& points, const Floats& group) const {
    for (std::size_t v = 0; v < points.size(); ++v) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      double total = 0;
      for (std::int32_t i = offsets[v]; i < offsets[v + 1]; ++i) {
        const Eigen::Vector3d now = Eigen::Vector3f(cage.data() + 3 * of_cage[i]).cast<double>();
        const Eigen::Vector3d then = Eigen::Vector3f(bound.data() + 3 * of_cage[i]).cast<double>();
        sum += weights[i] * ((matrix.cast<double>() * now.homogeneous()).head<3>() - then);
        total += weights[i];
      }
      if (total > 0 && group[v] > 0) points[v] += group[v] / total * (back.cast<double>() * sum);
    }
  }

  Ints offsets{0}, of_cage;
  Floats weights, bound, cage;
  Matrix4<float> matrix;
  Eigen::Matrix3f back;
};

class MeshDeformOnEachInstructionSet : public OnEachInstructionSet {};

INSTANTIATE_TEST_SUITE_P(Kernels, MeshDeformOnEachInstructionSet, each_instruction_set(), set_name);

TEST_P(MeshDeformOnEachInstructionSet, IsTheSlowFormula) {
  rigs::Random random(1);
  constexpr std::int32_t kVertices = 3000;
  const Caged caged(random, kVertices, 200);
  const Floats group = meshes::some_weights(random, kVertices);
  for (const bool invert : {false, true}) {
    const MeshDeform own = caged.deform({group, invert});
    EXPECT_EQ(own.vertex_count(), kVertices);
    EXPECT_EQ(own.cage_vertex_count(), 200);
    const Floats before = meshes::random_positions(random, kVertices);
    Floats positions = before;
    own.apply(caged.settings(own), positions);
    Floats shares = group;
    for (float& share : shares) share = invert ? 1 - share : share;
    auto expected = meshes::points_of(before);
    caged.move(expected, shares);
    EXPECT_LT(meshes::largest_difference(positions, expected), 5e-6);
  }
}

TEST(MeshDeform, AnyNumberOfThreadsMakesTheSame) {
  const ThreadsOfATest threads_of_a_test;
  rigs::Random random(2);
  const Caged caged(random, 20000, 300);
  const MeshDeform own = caged.deform();
  const auto settings = caged.settings(own);
  const Floats before = meshes::random_positions(random, 20000);
  set_thread_count(1);
  Floats expected = before;
  own.apply(settings, expected);
  EXPECT_NE(expected, before);
  for (const int threads : {2, 8}) {
    set_thread_count(threads);
    Floats positions = before;
    own.apply(settings, positions);
    EXPECT_EQ(positions, expected);
  }
}

TEST(MeshDeform, NothingElseFollowsAVertexOfTheCageThatIsNotANumber) {
  rigs::Random random(5);
  Caged caged(random, 1000, 50);
  const MeshDeform own = caged.deform();
  const Floats before = meshes::random_positions(random, 1000);
  Floats expected = before, positions = before;
  own.apply(caged.settings(own), expected);
  caged.cage[3 * 7] = std::numeric_limits<float>::infinity();
  own.apply(caged.settings(own), positions);
  for (std::size_t v = 0; v < 1000; ++v) {
    const auto begin = caged.of_cage.begin();
    const bool follows =
        std::find(begin + caged.offsets[v], begin + caged.offsets[v + 1], 7) != begin + caged.offsets[v + 1];
    EXPECT_EQ(std::isfinite(positions[3 * v]), !follows);
    if (!follows) {
      EXPECT_EQ(positions[3 * v], expected[3 * v]);
    }
  }
}

TEST(MeshDeform, RefusesWhatIsWrong) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto said = [&](const auto& change) {
    rigs::Random random(3);
    Caged caged(random, 10, 8);
    change(caged);
    return complaint([&] { caged.deform(); });
  };
  EXPECT_EQ(said([](Caged&) {}), "(no complaint)");
  EXPECT_EQ(said([](Caged& c) { c.offsets.clear(); }),
            "offsets is empty; expected one number more than there are rows");
  EXPECT_TRUE(said([](Caged& c) { c.offsets[3] = 5000; }).ends_with(", below the one before"));
  EXPECT_TRUE(said([](Caged& c) { c.of_cage.pop_back(); }).starts_with("cage_vertices has "));
  EXPECT_TRUE(said([](Caged& c) { c.of_cage.back() = 8; }).ends_with("follows vertex 8 of a cage that has 8 vertices"));
  EXPECT_EQ(said([&](Caged& c) { c.weights[0] = nan; }), "weights is not finite at influence 0");
  EXPECT_EQ(said([&](Caged& c) { c.bound[2] = nan; }), "cage_positions is not finite at vertex 2");
  rigs::Random random(4);
  const Caged caged(random, 10, 8);
  EXPECT_EQ(complaint([&] { caged.deform({Floats(2)}); }), "weights has 2 numbers; the mesh has 10 vertices");
  const MeshDeform own = caged.deform();
  EXPECT_EQ(complaint([&] { own.differences(Floats(3), caged.matrix); }), "cage has 3 numbers; expected 24 (8 x 3)");
  Floats positions(6);
  auto settings = caged.settings(own);
  EXPECT_EQ(complaint([&] { own.apply(settings, positions); }), "positions has 6 numbers; expected 30 (10 x 3)");
  positions.resize(30);
  settings.mesh_from_bound(0, 1) = nan;
  EXPECT_EQ(complaint([&] { own.apply(settings, positions); }), "the matrix is not finite");
  EXPECT_EQ(complaint([&] { own.apply({}, positions); }), "the cage has 0 vertices; the mesh was bound to 8");
}

}  // namespace
}  // namespace sinew
