#include "decompose/simplex_least_squares.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sinew {

bool SimplexLeastSquares::factor(const Matrix& g) {
  const std::size_t n = used_.size();
  lower_.resize(n * n);
  for (std::size_t row = 0; row < n; ++row) {
    for (std::size_t column = 0; column <= row; ++column) {
      double sum = g(used_[row], used_[column]);
      for (std::size_t k = 0; k < column; ++k) sum -= lower(row, k) * lower(column, k);
      if (column < row) {
        lower(row, column) = sum / lower(column, column);
      } else {
        if (!(sum > 1e-14 * g(used_[row], used_[row]))) return false;  // depends on those before it
        lower(row, row) = std::sqrt(sum);
      }
    }
  }
  return true;
}

void SimplexLeastSquares::substitute(std::vector<double>& values) const {
  const std::size_t n = used_.size();
  for (std::size_t row = 0; row < n; ++row) {
    for (std::size_t k = 0; k < row; ++k) values[row] -= lower(row, k) * values[k];
    values[row] /= lower(row, row);
  }
  for (std::size_t row = n; row-- > 0;) {
    for (std::size_t k = row + 1; k < n; ++k) values[row] -= lower(k, row) * values[k];
    values[row] /= lower(row, row);
  }
}

void SimplexLeastSquares::solve_equality(const Vector& b) {
  const std::size_t n = used_.size();
  values_.resize(n);
  ones_.assign(n, 1);
  for (std::size_t i = 0; i < n; ++i) values_[i] = b[used_[i]];
  substitute(values_);
  substitute(ones_);
  double sum = 0, sum_of_ones = 0;
  for (std::size_t i = 0; i < n; ++i) sum += values_[i], sum_of_ones += ones_[i];
  multiplier_ = (1 - sum) / sum_of_ones;
  for (std::size_t i = 0; i < n; ++i) values_[i] += multiplier_ * ones_[i];
}

void SimplexLeastSquares::improve(const Matrix& g, const Vector& b, Eigen::Ref<Eigen::VectorXd> x, bool may_enter) {
  const double tolerance = 1e-12 * g.diagonal().maxCoeff();
  for (Eigen::Index round = 0; round < 4 * b.size() + 16; ++round) {
    if (!factor(g)) {  // two unknowns do the same: the last of them leaves
      const auto gone = std::min_element(used_.begin(), used_.end(), [&](int i, int j) { return x[i] < x[j]; });
      if (used_.size() == 1) return;
      x[*gone] = 0;
      used_.erase(gone);
      continue;
    }
    solve_equality(b);
    double step = 1;
    for (std::size_t i = 0; i < used_.size(); ++i) {
      if (values_[i] < 0) step = std::min(step, x[used_[i]] / (x[used_[i]] - values_[i]));
    }
    std::size_t kept = 0;
    for (std::size_t i = 0; i < used_.size(); ++i) {
      double& own = x[used_[i]];
      own = step < 1 ? own + step * (values_[i] - own) : values_[i];
      if (step < 1 && values_[i] < 0 && own <= 1e-15) {
        own = 0;
      } else {
        used_[kept++] = used_[i];
      }
    }
    const bool left = kept < used_.size();
    used_.resize(kept);
    if (step < 1) {
      if (!left) return;  // rounding: x is as good as it gets
      continue;
    }
    if (!may_enter) return;
    int best = -1;
    double least = -tolerance;
    for (int j = 0; j < b.size(); ++j) {
      if (std::binary_search(used_.begin(), used_.end(), j)) continue;
      double slope = -b[j] - multiplier_;
      for (const int i : used_) slope += g(j, i) * x[i];
      if (slope < least) least = slope, best = j;
    }
    if (best < 0) return;
    used_.insert(std::upper_bound(used_.begin(), used_.end(), best), best);
  }
}

void SimplexLeastSquares::solve(const Matrix& g, const Vector& b, Eigen::Ref<Eigen::VectorXd> x) {
  used_.clear();
  const double sum = x.sum();
  if (sum > 0) {
    x /= sum;
    for (int i = 0; i < x.size(); ++i) {
      if (x[i] > 0) used_.push_back(i);
    }
  } else {
    Eigen::Index first;
    (0.5 * g.diagonal() - b).minCoeff(&first);
    x.setZero();
    x[first] = 1;
    used_.push_back(static_cast<int>(first));
  }
  improve(g, b, x, true);
  if (const double reached = x.sum(); reached > 0) x /= reached;
}

void SimplexLeastSquares::solve_sparse(const Matrix& g, const Vector& b, int most, Eigen::Ref<Eigen::VectorXd> x) {
  solve(g, b, x);
  while (std::ssize(used_) > most) {
    // Without unknown i the sum rises by x_i^2 / (2 (G^-1)_ii), but for the condition on their sum.
    if (!factor(g)) break;
    const std::size_t n = used_.size();
    std::size_t gone = 0;
    double least = std::numeric_limits<double>::infinity();
    ones_.assign(n, 1);
    substitute(ones_);
    double all = 0;
    for (const double one : ones_) all += one;
    for (std::size_t i = 0; i < n; ++i) {
      values_.assign(n, 0);
      values_[i] = 1;
      substitute(values_);
      const double rise = x[used_[i]] * x[used_[i]] / std::max(values_[i] - ones_[i] * ones_[i] / all, 1e-300);
      if (rise < least) least = rise, gone = i;
    }
    const double lost = x[used_[gone]];
    x[used_[gone]] = 0;
    used_.erase(used_.begin() + static_cast<std::ptrdiff_t>(gone));
    for (const int i : used_) x[i] += lost / static_cast<double>(used_.size());
    improve(g, b, x, false);
  }
  while (std::ssize(used_) > most) {  // they do the same
    const auto gone = std::min_element(used_.begin(), used_.end(), [&](int i, int j) { return x[i] < x[j]; });
    x[*gone] = 0;
    used_.erase(gone);
  }
  if (const double reached = x.sum(); reached > 0) x /= reached;
}

void SimplexLeastSquares::solve_among(const Matrix& g, const Vector& b, const std::vector<int>& used,
                                      Eigen::Ref<Eigen::VectorXd> x) {
  // Begins with equal shares of all, from which those leave that would become negative; then a full search among them.
  const auto n = static_cast<Eigen::Index>(used.size());
  Eigen::MatrixXd own_g(n, n);
  Eigen::VectorXd own_b(n), own_x = Eigen::VectorXd::Constant(n, 1.0 / static_cast<double>(n));
  for (Eigen::Index i = 0; i < n; ++i) {
    own_b[i] = b[used[i]];
    for (Eigen::Index j = 0; j < n; ++j) own_g(i, j) = g(used[i], used[j]);
  }
  solve(own_g, own_b, own_x);
  x.setZero();
  for (Eigen::Index i = 0; i < n; ++i) x[used[i]] = own_x[i];
}

}  // namespace sinew
