#include "sinew/lattice.h"

#include <gtest/gtest.h>

#include <limits>

#include "each_instruction_set.h"
#include "failures.h"
#include "meshes.h"

namespace sinew {
namespace {

using meshes::Floats;

constexpr Spline kSplines[] = {Spline::linear, Spline::cardinal, Spline::catmull_rom, Spline::b_spline};

/// The weight of a point at distance d, in points, from the place.
double weight(Spline spline, double d) {
  const double x = std::abs(d);
  if (x >= 2) return 0;
  switch (spline) {
    case Spline::linear:
      return x < 1 ? 1 - x : 0;
    case Spline::b_spline:
      return x < 1 ? 2.0 / 3 - x * x + x * x * x / 2 : std::pow(2 - x, 3) / 6;
    default: {
      const double c = spline == Spline::cardinal ? 0.71 : 0.5;
      return x < 1 ? (2 - c) * x * x * x + (c - 3) * x * x + 1 : c * (-x * x * x + 5 * x * x - 8 * x + 4);
    }
  }
}

struct Cage {
  Cage(rigs::Random& random, const std::array<std::int32_t, 3>& counts, const std::array<Spline, 3>& interpolation)
      : grid{counts, {-0.5f, -1, 0.1f}, {0.4f, 1, 0.3f}, interpolation} {
    matrix = rigs::random_rigid(random).cast<float>();
    matrix.topLeftCorner<3, 3>() *= 1.3f;
    const std::int32_t count = counts[0] * counts[1] * counts[2];
    points = meshes::random_positions(random, count);
    weights = meshes::some_weights(random, count);
  }

  Eigen::Vector3d moved(const Eigen::Vector3d& p, double share, bool by_weights) const {
    const Matrix4<double> m = matrix.cast<double>();
    const Eigen::Vector3d there = (m * p.homogeneous()).head<3>();
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double kept = 0;
    for (int w = -1; w <= 2; ++w) {
      for (int v = -1; v <= 2; ++v) {
        for (int u = -1; u <= 2; ++u) {
          const int from_cell[] = {u, v, w};
          double part = share;
          std::int32_t index = 0, stride = 1;
          Eigen::Vector3d rest;
          for (int axis = 0; axis < 3; ++axis) {
            const std::int32_t last = grid.counts[axis] - 1;
            const double place = (there[axis] - grid.first[axis]) / grid.step[axis];
            const double at = std::floor(place) + from_cell[axis];
            const auto own = static_cast<std::int32_t>(std::clamp<double>(at, 0, last));
            part *= last == 0 ? from_cell[axis] == 0 : weight(grid.interpolation[axis], place - at);
            rest[axis] = grid.first[axis] + own * double(grid.step[axis]);
            index += stride * own;
            stride *= grid.counts[axis];
          }
          const Eigen::Vector3d point = Eigen::Vector3f(points.data() + 3 * index).cast<double>();
          sum += part * (m.topLeftCorner<3, 3>().inverse() * (point - rest));
          kept += part * weights[index];
        }
      }
    }
    return by_weights ? Eigen::Vector3d(p + kept * sum) : Eigen::Vector3d(p + sum);
  }

  Lattice::Settings settings(float strength, bool by_weights) const {
    return {std::make_shared<LatticePoints>(grid, points, matrix, by_weights ? weights : Floats()), strength};
  }

  LatticePoints::Grid grid;
  Matrix4<float> matrix;
  Floats points, weights;
};

class LatticeOnEachInstructionSet : public OnEachInstructionSet {};

INSTANTIATE_TEST_SUITE_P(Kernels, LatticeOnEachInstructionSet, each_instruction_set(), set_name);

TEST_P(LatticeOnEachInstructionSet, IsTheSlowFormula) {
  rigs::Random random(1);
  constexpr std::int32_t kVertices = 1007;
  const Floats positions = meshes::random_positions(random, kVertices);
  const Floats group = meshes::some_weights(random, kVertices);
  for (const std::array<std::int32_t, 3>& counts :
       {std::array{2, 2, 2}, std::array{1, 3, 5}, std::array{6, 1, 1}, std::array{4, 5, 6}, std::array{1, 1, 1}}) {
    for (const Spline spline : kSplines) {
      for (const bool by_weights : {false, true}) {
        const Cage cage(random, counts, {spline, Spline::linear, spline});
        const bool invert = by_weights;
        const Lattice lattice(kVertices, {group, invert});
        EXPECT_EQ(lattice.vertex_count(), kVertices);
        Floats own = positions;
        lattice.apply(cage.settings(0.7f, by_weights), own);
        auto expected = meshes::points_of(positions);
        for (std::int32_t v = 0; v < kVertices; ++v) {
          const float share = invert ? 1 - group[v] : group[v];
          if (share > 0) expected[v] = cage.moved(expected[v], 0.7 * share, by_weights);
        }
        EXPECT_LT(meshes::largest_difference(own, expected), 1e-5);
      }
    }
  }
}

TEST_P(LatticeOnEachInstructionSet, AtRestMovesNothing) {
  rigs::Random random(2);
  const Cage cage(random, {2, 2, 2}, {Spline::b_spline, Spline::b_spline, Spline::b_spline});
  Floats rest;
  for (const float z : {0.1f, 0.1f + 0.3f}) {
    for (const float y : {-1.0f, 0.0f}) {
      for (const float x : {-0.5f, -0.5f + 0.4f}) rest.insert(rest.end(), {x, y, z});
    }
  }
  const Floats positions = meshes::random_positions(random, 100);
  Floats own = positions;
  Lattice(100).apply({std::make_shared<LatticePoints>(cage.grid, rest, cage.matrix)}, own);
  EXPECT_EQ(own, positions);
}

TEST_P(LatticeOnEachInstructionSet, FarAwayAndNotANumber) {
  rigs::Random random(3);
  const Cage cage(random, {3, 3, 3}, {Spline::cardinal, Spline::b_spline, Spline::linear});
  Floats own{1e30f, -1e30f, 1e20f, std::numeric_limits<float>::quiet_NaN(), 0, 0, 2e9f, -2e9f, 5};
  const Floats before = own;
  Lattice(3).apply(cage.settings(1, false), own);
  EXPECT_EQ(own[0], before[0]);
  EXPECT_TRUE(std::isnan(own[3]));
  EXPECT_NEAR(own[8], cage.moved({2e9, -2e9, 5}, 1, false)[2], 1e-3);
}

TEST(Lattice, AnyNumberOfThreadsMakesTheSame) {
  const ThreadsOfATest threads_of_a_test;
  rigs::Random random(4);
  const Floats positions = meshes::random_positions(random, 20000);
  const Cage cage(random, {3, 4, 5}, {Spline::b_spline, Spline::cardinal, Spline::linear});
  const Lattice::Settings settings = cage.settings(1, true);
  const Lattice lattice(20000);
  set_thread_count(1);
  Floats expected = positions;
  lattice.apply(settings, expected);
  for (const int threads : {2, 8}) {
    set_thread_count(threads);
    Floats own = positions;
    lattice.apply(settings, own);
    EXPECT_EQ(own, expected);
  }
}

TEST(Lattice, RefusesWhatIsWrong) {
  rigs::Random random(5);
  EXPECT_EQ(complaint([&] { Lattice(-1); }), "vertex_count is -1; expected 0 to 536,870,912");
  EXPECT_EQ(complaint([&] { Lattice(3, {Floats(2)}); }), "weights has 2 numbers; the mesh has 3 vertices");
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto said = [&](const auto& change) {
    Cage cage(random, {2, 1, 2}, {});
    change(cage);
    return complaint([&] { cage.settings(1, true); });
  };
  EXPECT_EQ(said([](Cage&) {}), "(no complaint)");
  EXPECT_EQ(said([](Cage& c) { c.grid.counts[1] = 0; }), "counts has 0 points along an axis; expected 1 or more");
  // Their product is 2^64, which is 0 in 64 bits.
  EXPECT_EQ(said([](Cage& c) {
              c.grid.counts = {1 << 22, 1 << 21, 1 << 21}, c.points.clear();
            }),
            "counts makes more than 536,870,912 points; expected fewer");
  EXPECT_EQ(said([](Cage& c) { c.points.resize(9); }), "points has 9 numbers; expected 12 (4 x 3)");
  EXPECT_EQ(said([](Cage& c) { c.weights.resize(3); }), "weights has 3 numbers; the lattice has 4 vertices");
  EXPECT_EQ(said([&](Cage& c) { c.points[4] = nan; }), "points is not finite at point 1");
  EXPECT_EQ(said([&](Cage& c) { c.weights[1] = nan; }), "weights is not finite at vertex 1");
  EXPECT_EQ(said([&](Cage& c) { c.grid.first[0] = nan; }), "first is nan; expected a finite number");
  EXPECT_EQ(said([&](Cage& c) { c.grid.step[2] = nan; }), "step is nan; expected a finite number");
  EXPECT_EQ(said([](Cage& c) { c.grid.step[2] = 0; }), "step is 0 along an axis with more than one point");
  EXPECT_EQ(said([](Cage& c) { c.grid.step[1] = 0; }), "(no complaint)");
  EXPECT_EQ(said([&](Cage& c) { c.matrix(0, 0) = nan; }), "the matrix is not finite");
  EXPECT_EQ(said([](Cage& c) { c.matrix.setZero(); }), "the matrix has no inverse");
  const Cage cage(random, {2, 2, 2}, {});
  const Lattice lattice(3);
  Floats positions(6);
  EXPECT_EQ(complaint([&] { lattice.apply(cage.settings(1, false), positions); }),
            "positions has 6 numbers; expected 9 (3 x 3)");
  positions.resize(9);
  EXPECT_EQ(complaint([&] { lattice.apply(cage.settings(nan, false), positions); }),
            "strength is nan; expected a finite number");
  EXPECT_EQ(complaint([&] { lattice.apply({}, positions); }), "a lattice has no points");
}

}  // namespace
}  // namespace sinew
