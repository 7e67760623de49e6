#include "decompose/neighbours.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <set>

namespace sinew {
namespace {

using Pair = std::pair<std::uint32_t, std::uint32_t>;

std::vector<Eigen::Vector4d> random_points(std::size_t count) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform;
  std::vector<Eigen::Vector4d> points(count);
  for (auto& point : points) point << uniform(random), uniform(random), uniform(random), 1;
  return points;
}

std::size_t part_count(std::size_t points, std::vector<Pair> edges) {
  std::vector<std::uint32_t> part(points);
  std::iota(part.begin(), part.end(), 0u);
  for (std::size_t round = 0; round < points; ++round) {
    for (const auto& [a, b] : edges) part[a] = part[b] = std::min(part[a], part[b]);
  }
  return std::set(part.begin(), part.end()).size();
}

TEST(TiesBetweenParts, ConnectEverything) {
  const auto points = random_points(100);
  std::vector<Pair> edges;
  for (std::uint32_t i = 0; i + 1 < 100; ++i) {
    if (i % 10 != 9) edges.emplace_back(i, i + 1);
  }
  ASSERT_EQ(part_count(100, edges), 10u);
  const auto ties = ties_between_parts(points, edges);
  edges.insert(edges.end(), ties.begin(), ties.end());
  EXPECT_EQ(part_count(100, edges), 1u);
}

TEST(TiesBetweenParts, OfSinglePointsAreTheShortestTree) {
  const auto points = random_points(60);
  const auto ties = ties_between_parts(points, {});
  double length = 0;
  for (const auto& [a, b] : ties) length += (points[a] - points[b]).norm();
  // Prim's algorithm, the slow way.
  std::set<std::size_t> inside{0};
  double expected = 0;
  while (inside.size() < points.size()) {
    double least = std::numeric_limits<double>::infinity();
    std::size_t next = 0;
    for (const std::size_t a : inside) {
      for (std::size_t b = 0; b < points.size(); ++b) {
        const double distance = (points[a] - points[b]).norm();
        if (!inside.contains(b) && distance < least) least = distance, next = b;
      }
    }
    expected += least;
    inside.insert(next);
  }
  EXPECT_EQ(ties.size(), points.size() - 1);
  EXPECT_NEAR(length, expected, 1e-12);
}

TEST(TiesBetweenParts, AreNotNeededInOnePart) {
  EXPECT_TRUE(ties_between_parts(random_points(2), std::vector<Pair>{{0, 1}}).empty());
  EXPECT_TRUE(ties_between_parts(random_points(1), {}).empty());
}

TEST(TiesBetweenParts, NearPointsAreTiedOneByOne) {
  std::vector<Eigen::Vector4d> points;  // two rails
  std::vector<Pair> edges;
  for (std::uint32_t i = 0; i < 10; ++i) {
    points.emplace_back(i, 0, 0, 1);
    points.emplace_back(i, 0.5, 0, 1);
    if (i > 0) edges.emplace_back(2 * i - 2, 2 * i), edges.emplace_back(2 * i - 1, 2 * i + 1);
  }
  const auto ties = ties_between_parts(points, edges);
  const std::set<Pair> expected_ones(ties.begin(), ties.end());
  for (std::uint32_t i = 0; i < 10; ++i) EXPECT_TRUE(expected_ones.contains({2 * i, 2 * i + 1}));
}

TEST(Neighbours, CountByHowRigidlyTheyMove) {
  // A quad whose corner 2 moves away in the second frame.
  const std::vector<float> rest{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  std::vector<float> frames(rest);
  frames.insert(frames.end(), rest.begin(), rest.end());
  frames[12 + 3 * 2 + 2] = 5;
  const Clip clip(rest, frames, true, nullptr);
  const Neighbours neighbours =
      neighbours_of(clip, std::vector<std::int32_t>{0, 4}, std::vector<std::int32_t>{0, 1, 2, 3});
  ASSERT_EQ(neighbours.size(), 4u);
  for (std::size_t p = 0; p < 4; ++p) {
    double sum = 0;
    for (const Neighbour& other : neighbours[p]) sum += other.share;
    EXPECT_NEAR(sum, 1, 1e-6);
  }
  std::map<std::uint32_t, float> of_one;
  for (const auto& [point, share] : neighbours[1]) of_one[point] = share;
  EXPECT_GT(of_one.at(0), 5 * of_one.at(2));
}

}  // namespace
}  // namespace sinew
