#include "sinew/stencils.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "failures.h"

namespace sinew {
namespace {

struct Rows {
  std::vector<std::int64_t> offsets{0};
  std::vector<std::int32_t> vertices;
  std::vector<float> weights;
};

Rows random_rows(std::size_t count, int vertex_count, std::mt19937& random) {
  Rows rows;
  for (std::size_t r = 0; r < count; ++r) {
    const int length = static_cast<int>(random() % 9), kind = static_cast<int>(random() % 5);
    for (int k = 0; k < length; ++k) {
      rows.vertices.push_back(static_cast<std::int32_t>(random() % vertex_count));
      rows.weights.push_back(std::ldexp(1.0f, -1 - kind - k));  // exact products: it does not matter who fuses them
    }
    rows.offsets.push_back(std::ssize(rows.vertices));
  }
  return rows;
}

std::vector<float> random_positions(int count, std::mt19937& random) {
  std::uniform_real_distribution<float> anywhere(-3, 3);
  std::vector<float> positions(3 * static_cast<std::size_t>(count));
  for (float& number : positions) number = anywhere(random);
  return positions;
}

TEST(Stencils, VerticesAreWeightedSumsInTheOrderOfTheEntries) {
  std::mt19937 random(1);
  const Rows rows = random_rows(500, 40, random);
  const Stencils stencils(rows.offsets, rows.vertices, rows.weights, 40);
  const std::vector<float> positions = random_positions(40, random);
  std::vector<float> out(3 * 500), expected;
  stencils.apply(positions, out);
  for (std::size_t r = 0; r < 500; ++r) {
    for (int axis = 0; axis < 3; ++axis) {
      float sum = 0;
      for (std::int64_t k = rows.offsets[r]; k < rows.offsets[r + 1]; ++k) {
        sum += rows.weights[k] * positions[3 * static_cast<std::size_t>(rows.vertices[k]) + axis];
      }
      expected.push_back(sum);
    }
  }
  EXPECT_EQ(out, expected);
  EXPECT_EQ(stencils.entry_count(), std::ssize(rows.vertices));
}

TEST(Stencils, EqualRowsOfWeightsAreStoredOnce) {
  std::mt19937 random(2);
  const Rows rows = random_rows(2000, 10, random);
  std::set<std::vector<float>> kinds;
  for (std::size_t r = 0; r < 2000; ++r) {
    kinds.emplace(rows.weights.begin() + rows.offsets[r], rows.weights.begin() + rows.offsets[r + 1]);
  }
  EXPECT_EQ(Stencils(rows.offsets, rows.vertices, rows.weights, 10).pattern_count(), std::ssize(kinds));
}

TEST(Stencils, SumsAreScaledAndShifted) {
  std::mt19937 random(4);
  const Rows rows = random_rows(300, 40, random);
  const std::vector<float> positions = random_positions(40, random);
  std::vector<float> scales, shifts, sums(3 * 300), out(sums), expected;
  for (int i = 0; i < 3 * 300; ++i) {
    scales.push_back(random() % 2 ? -1.0f : 1.0f);
    shifts.push_back(static_cast<float>(random() % 8));
  }
  Stencils(rows.offsets, rows.vertices, rows.weights, 40).apply(positions, sums);
  for (std::size_t i = 0; i < sums.size(); ++i) expected.push_back(scales[i] * sums[i] + shifts[i]);
  Stencils(rows.offsets, rows.vertices, rows.weights, 40, scales, shifts).apply(positions, out);
  EXPECT_EQ(out, expected);
  const std::vector<float> ones(3 * 300, 1), zeros(3 * 300, 0);
  for (std::size_t i = 0; i < sums.size(); ++i) expected[i] = scales[i] * sums[i];
  Stencils(rows.offsets, rows.vertices, rows.weights, 40, scales).apply(positions, out);
  EXPECT_EQ(out, expected);
  Stencils(rows.offsets, rows.vertices, rows.weights, 40, ones, zeros).apply(positions, out);
  EXPECT_EQ(out, sums);
}

TEST(Stencils, CopiesOfARowAreStoredOnceForEachPlace) {
  const std::vector<std::int64_t> offsets{0, 1, 2, 3, 4};
  const std::vector<std::int32_t> vertices{0, 1, 2, 3};
  const std::vector<float> weights(4, 1), shifts{0, 0, 0, 0, 0, 0, 5, 0, 0, 5, 0, 0};
  EXPECT_EQ(Stencils(offsets, vertices, weights, 4).pattern_count(), 1);
  EXPECT_EQ(Stencils(offsets, vertices, weights, 4, {}, shifts).pattern_count(), 2);
}

TEST(Stencils, AnyNumberOfThreadsGivesTheSameBits) {
  std::mt19937 random(3);
  const Rows rows = random_rows(30'000, 900, random);
  const Stencils stencils(rows.offsets, rows.vertices, rows.weights, 900);
  const std::vector<float> positions = random_positions(900, random);
  std::vector<float> one(3 * 30'000), many(one);
  const ThreadsOfATest threads;
  set_thread_count(1);
  stencils.apply(positions, one);
  set_thread_count(0);
  stencils.apply(positions, many);
  EXPECT_EQ(one, many);
}

TEST(Stencils, WithoutRowsNothingIsWritten) {
  const Stencils stencils(std::vector<std::int64_t>{0}, {}, {}, 0);
  stencils.apply({}, {});
  EXPECT_EQ(stencils.count(), 0);
}

TEST(Stencils, WhatDoesNotFitIsRefused) {
  const auto make = [](std::vector<std::int64_t> offsets, std::vector<std::int32_t> vertices,
                       std::vector<float> weights) {
    return complaint([&] { Stencils(offsets, vertices, weights, 4); });
  };
  EXPECT_EQ(make({0, 2}, {0, 4}, {1, 1}), "vertices names vertex 4; the mesh has 4 vertices");
  EXPECT_EQ(make({0, 2}, {0, 1}, {1}), "weights has 1 number; expected 2, one for each of vertices");
  EXPECT_EQ(make({0, 2, 1, 2}, {0, 1}, {1, 1}), "offsets[2] is 1, below the one before");
  EXPECT_EQ(make({0, 1}, {0, 1}, {1, 1}), "offsets goes from 0 to 1; expected 0 to 2, the number of entries");
  EXPECT_EQ(make({0, 1}, {0}, {NAN}), "weights[0] is nan; expected a finite number");
  const auto place = [](std::vector<float> scales, std::vector<float> shifts) {
    return complaint([&] {
      Stencils(std::vector<std::int64_t>{0, 1}, std::vector<std::int32_t>{2}, std::vector<float>{1}, 4, scales, shifts);
    });
  };
  EXPECT_EQ(place({1, 1, 1, 1, 1, 1}, {}), "scales has 2 rows; expected 1");
  EXPECT_EQ(place({}, {0, INFINITY, 0}), "shifts[1] is inf; expected a finite number");
  const Stencils stencils(std::vector<std::int64_t>{0, 1}, std::vector<std::int32_t>{2}, std::vector<float>{1}, 4);
  std::vector<float> few(9), right(12), out(3), more(6);
  EXPECT_EQ(complaint([&] { stencils.apply(few, out); }), "positions has 3 vertices; expected 4");
  EXPECT_EQ(complaint([&] { stencils.apply(right, more); }), "out has 2 vertices; expected 1");
}

/// A grid of squares, and a tail of edges.
struct Grid {
  explicit Grid(int width) : side(width) {
    const auto at = [&](int x, int y) { return y * width + x; };
    for (int y = 0; y + 1 < width; ++y) {
      for (int x = 0; x + 1 < width; ++x) {
        for (const int v : {at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)}) corners.push_back(v);
        offsets.push_back(static_cast<std::int32_t>(corners.size()));
      }
    }
    for (int v = width * width; v < width * width + 6; ++v) edges.insert(edges.end(), {v - 1, v});
  }
  int vertex_count() const { return side * side + 6; }

  int side;
  std::vector<std::int32_t> offsets{0}, corners, edges;
};

TEST(ColoursApart, VerticesOfOneColourAreFarApart) {
  const Grid grid(12);
  for (const int steps : {0, 1, 2, 3}) {
    const auto colours = *colours_apart(grid.vertex_count(), grid.edges, {grid.offsets, grid.corners}, steps, 256);
    ASSERT_EQ(std::ssize(colours), grid.vertex_count());
    for (int a = 0; a < grid.side * grid.side; ++a) {
      for (int b = 0; b < a; ++b) {
        const int apart = std::max(std::abs(a % 12 - b % 12), std::abs(a / 12 - b / 12));
        EXPECT_FALSE(apart <= steps && colours[a] == colours[b]) << a << " and " << b << " within " << steps;
      }
    }
    for (int a = grid.side * grid.side; a < grid.vertex_count(); ++a) {
      for (int b = a - 1; b >= a - steps && b >= grid.side * grid.side; --b) EXPECT_NE(colours[a], colours[b]);
    }
    EXPECT_EQ(*std::ranges::max_element(colours) + 1, (steps + 1) * (steps + 1)) << "a grid needs no more";
  }
}

TEST(ColoursApart, MoreThanTheMostAreNotMade) {
  const Grid grid(12);
  EXPECT_EQ(colours_apart(grid.vertex_count(), grid.edges, {grid.offsets, grid.corners}, 2, 8), std::nullopt);
  EXPECT_TRUE(colours_apart(grid.vertex_count(), grid.edges, {grid.offsets, grid.corners}, 2, 9));
}

}  // namespace
}  // namespace sinew
