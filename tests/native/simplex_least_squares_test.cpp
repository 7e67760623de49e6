#include "decompose/simplex_least_squares.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <bit>
#include <limits>
#include <random>

namespace sinew {
namespace {

double sum_of(const Eigen::MatrixXd& g, const Eigen::VectorXd& b, const Eigen::VectorXd& x) {
  return 0.5 * x.dot(g * x) - b.dot(x);
}

/// The least sum over all supports of at most `most` unknowns, each solved alone.
double best_of_all(const Eigen::MatrixXd& g, const Eigen::VectorXd& b, int most) {
  const int n = static_cast<int>(b.size());
  double best = std::numeric_limits<double>::infinity();
  for (unsigned support = 1; support < 1u << n; ++support) {
    const int count = std::popcount(support);
    if (count > most) continue;
    std::vector<int> used;
    for (int i = 0; i < n; ++i) {
      if (support >> i & 1) used.push_back(i);
    }
    Eigen::MatrixXd system = Eigen::MatrixXd::Zero(count + 1, count + 1);
    Eigen::VectorXd right = Eigen::VectorXd::Ones(count + 1);
    for (int i = 0; i < count; ++i) {
      for (int k = 0; k < count; ++k) system(i, k) = g(used[i], used[k]);
      system(i, count) = system(count, i) = 1;
      right[i] = b[used[i]];
    }
    const Eigen::VectorXd solution = system.fullPivLu().solve(right);
    if (solution.head(count).minCoeff() < -1e-12) continue;
    Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
    for (int i = 0; i < count; ++i) x[used[i]] = solution[i];
    best = std::min(best, sum_of(g, b, x));
  }
  return best;
}

struct Problem {
  Eigen::MatrixXd g;
  Eigen::VectorXd b;
};

Problem random_problem(std::mt19937& random, int n) {
  std::normal_distribution<double> normal;
  const Eigen::MatrixXd a = Eigen::MatrixXd::NullaryExpr(n + 2, n, [&] { return normal(random); });
  const Eigen::VectorXd target = Eigen::VectorXd::NullaryExpr(n + 2, [&] { return normal(random); });
  return {a.transpose() * a, a.transpose() * target};
}

void expect_on_simplex(const Eigen::VectorXd& x) {
  EXPECT_GE(x.minCoeff(), 0);
  EXPECT_NEAR(x.sum(), 1, 1e-12);
}

TEST(SimplexLeastSquares, FindsTheBestOfAllSupports) {
  std::mt19937 random(1);
  SimplexLeastSquares solver;
  for (int trial = 0; trial < 200; ++trial) {
    const int n = 1 + trial % 7;
    const auto [g, b] = random_problem(random, n);
    Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
    WholeGram whole(g);
    solver.solve(whole, b, x);
    expect_on_simplex(x);
    EXPECT_NEAR(sum_of(g, b, x), best_of_all(g, b, n), 1e-9) << "trial " << trial;
  }
}

TEST(SimplexLeastSquares, TheStartDoesNotMatter) {
  std::mt19937 random(2);
  SimplexLeastSquares solver;
  for (int trial = 0; trial < 50; ++trial) {
    const auto [g, b] = random_problem(random, 6);
    Eigen::VectorXd first = Eigen::VectorXd::Zero(6);
    Eigen::VectorXd second = Eigen::VectorXd::Constant(6, 1.0 / 6);
    WholeGram whole(g);
    solver.solve(whole, b, first);
    solver.solve(whole, b, second);
    EXPECT_LT((first - second).norm(), 1e-8);
  }
}

TEST(SimplexLeastSquares, WithFewerUnknownsItIsNearTheBest) {
  std::mt19937 random(3);
  SimplexLeastSquares solver;
  int same = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const auto [g, b] = random_problem(random, 6);
    Eigen::VectorXd x = Eigen::VectorXd::Zero(6);
    WholeGram whole(g);
    solver.solve_sparse(whole, b, 2, x);
    expect_on_simplex(x);
    EXPECT_LE((x.array() > 0).count(), 2);
    const double best = best_of_all(g, b, 2);
    EXPECT_GE(sum_of(g, b, x), best - 1e-9);
    same += sum_of(g, b, x) < best + 1e-9;
  }
  EXPECT_GT(same, 70);
}

/// The least sum without an unknown, of those that sum to 1; infinite if one of them is below 0 for it.
double best_without(const Eigen::MatrixXd& g, const Eigen::VectorXd& b, int out) {
  const auto n = b.size();
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(n + 1, n + 1);
  system.topLeftCorner(n, n) = g;
  system.row(n).head(n).setOnes();
  system.col(n).head(n).setOnes();
  system.row(out).setZero();
  system(out, out) = 1;
  Eigen::VectorXd right(n + 1);
  right << b, 1;
  right[out] = 0;
  const Eigen::VectorXd x = system.fullPivLu().solve(right).head(n);
  return x.minCoeff() < -1e-12 ? std::numeric_limits<double>::infinity() : sum_of(g, b, x);
}

TEST(SimplexLeastSquares, TheUnknownThatIsMissedLeastLeaves) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  SimplexLeastSquares solver;
  int tried = 0;
  for (int trial = 0; trial < 300; ++trial) {
    constexpr int kCount = 4;
    const Eigen::MatrixXd a = Eigen::MatrixXd::NullaryExpr(6, kCount, [&] { return 2 + normal(random); });
    const Eigen::MatrixXd g = a.transpose() * a;
    const Eigen::VectorXd b = a.transpose() * a.rowwise().mean();  // equal shares leave nothing
    Eigen::VectorXd rises(kCount);
    for (int out = 0; out < kCount; ++out) rises[out] = best_without(g, b, out);
    if (!rises.allFinite()) continue;
    ++tried;
    Eigen::VectorXd x = Eigen::VectorXd::Zero(kCount);
    WholeGram whole(g);
    solver.solve_sparse(whole, b, kCount - 1, x);
    EXPECT_NEAR(sum_of(g, b, x), rises.minCoeff(), 1e-9) << "trial " << trial;
  }
  EXPECT_GT(tried, 50);
}

TEST(SimplexLeastSquares, EqualColumnsEndWithAShare) {
  SimplexLeastSquares solver;
  Eigen::VectorXd x = Eigen::VectorXd::Zero(3);
  const Eigen::MatrixXd ones = Eigen::MatrixXd::Ones(3, 3);
  WholeGram whole(ones);
  solver.solve_sparse(whole, Eigen::VectorXd::Ones(3), 2, x);
  expect_on_simplex(x);
  EXPECT_LE((x.array() > 0).count(), 2);
}

}  // namespace
}  // namespace sinew
