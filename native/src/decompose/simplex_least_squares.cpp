#include "decompose/simplex_least_squares.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <utility>

namespace sinew {

bool SimplexLeastSquares::factor(Gram& g) {
  const std::size_t n = used_.size();
  if (stride_ < n) {
    stride_ = std::max(2 * n, std::size_t{16});
    lower_.resize(stride_ * stride_);
    factored_ = 0;
  }
  for (std::size_t row = std::exchange(factored_, n); row < n; ++row) {
    const std::span<const double> own = g.column(used_[row]);
    for (std::size_t column = 0; column <= row; ++column) {
      double sum = own[used_[column]];
      for (std::size_t k = 0; k < column; ++k) sum -= lower(row, k) * lower(column, k);
      if (column < row) {
        lower(row, column) = sum / lower(column, column);
      } else {
        if (!(sum > 1e-14 * own[used_[row]])) {  // depends on those before it
          factored_ = row;
          return false;
        }
        lower(row, row) = std::sqrt(sum);
      }
    }
  }
  return true;
}

void SimplexLeastSquares::forward(std::vector<double>& values, std::size_t first) const {
  for (std::size_t row = first; row < used_.size(); ++row) {
    for (std::size_t k = first; k < row; ++k) values[row] -= lower(row, k) * values[k];
    values[row] /= lower(row, row);
  }
}

void SimplexLeastSquares::substitute(std::vector<double>& values) const {
  forward(values);
  const std::size_t n = used_.size();
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

void SimplexLeastSquares::improve(Gram& g, const Vector& b, Eigen::Ref<Eigen::VectorXd> x, bool may_enter) {
  const double tolerance = 1e-12 * std::ranges::max(g.diagonal());
  for (Eigen::Index round = 0; round < 4 * b.size() + 16; ++round) {
    if (!factor(g)) {  // two unknowns do the same: the last of them leaves
      const auto gone = std::min_element(used_.begin(), used_.end(), [&](int i, int j) { return x[i] < x[j]; });
      if (used_.size() == 1) return;
      leave(static_cast<std::size_t>(gone - used_.begin()), x);
      continue;
    }
    solve_equality(b);
    double step = 1;
    for (std::size_t i = 0; i < used_.size(); ++i) {
      if (values_[i] < 0) step = std::min(step, x[used_[i]] / (x[used_[i]] - values_[i]));
    }
    const std::size_t count = used_.size();
    for (std::size_t i = count; i-- > 0;) {
      double& own = x[used_[i]];
      own = step < 1 ? own + step * (values_[i] - own) : values_[i];
      if (step < 1 && values_[i] < 0 && own <= 1e-15) leave(i, x);
    }
    const bool left = used_.size() < count;
    if (step < 1) {
      if (!left) return;  // rounding: x is as good as it gets
      continue;
    }
    if (!may_enter) return;
    int best = -1;
    double least = -tolerance;
    slopes_.resize(static_cast<std::size_t>(b.size()));
    for (std::size_t j = 0; j < slopes_.size(); ++j) slopes_[j] = -b[static_cast<Eigen::Index>(j)] - multiplier_;
    for (const int i : used_) {
      const std::span<const double> column = g.column(i);
      const double weight = x[i];
      for (std::size_t j = 0; j < slopes_.size(); ++j) slopes_[j] += column[j] * weight;
    }
    for (const int i : used_) slopes_[i] = 0;
    for (std::size_t j = 0; j < slopes_.size(); ++j) {
      if (slopes_[j] < least) least = slopes_[j], best = static_cast<int>(j);
    }
    if (best < 0) return;
    used_.push_back(best);
  }
}

void SimplexLeastSquares::solve(Gram& g, const Vector& b, Eigen::Ref<Eigen::VectorXd> x) {
  used_.clear();
  factored_ = 0;
  const double sum = x.sum();
  if (sum > 0) {
    x /= sum;
    for (int i = 0; i < x.size(); ++i) {
      if (x[i] > 0) used_.push_back(i);
    }
  } else {
    const std::span<const double> diagonal = g.diagonal();
    Eigen::Index first;
    (0.5 * Eigen::VectorXd::Map(diagonal.data(), b.size()) - b).minCoeff(&first);
    x.setZero();
    x[first] = 1;
    used_.push_back(static_cast<int>(first));
  }
  improve(g, b, x, true);
  if (const double reached = x.sum(); reached > 0) x /= reached;
}

void SimplexLeastSquares::leave(std::size_t place, Eigen::Ref<Eigen::VectorXd> x) {
  x[used_[place]] = 0;
  used_.erase(used_.begin() + static_cast<std::ptrdiff_t>(place));
  factored_ = std::min(factored_, place);
}

void SimplexLeastSquares::solve_sparse(Gram& g, const Vector& b, int most, Eigen::Ref<Eigen::VectorXd> x) {
  solve(g, b, x);
  std::vector<double> rises;
  std::vector<int> leaving;
  while (std::ssize(used_) > most) {
    // Without unknown i the sum rises by x_i^2 / (2 (G^-1)_ii), but for the condition on their sum.
    if (!factor(g)) break;
    const std::size_t n = used_.size();
    ones_.assign(n, 1);
    substitute(ones_);
    double all = 0;
    for (const double one : ones_) all += one;
    rises.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      values_.assign(n, 0);
      values_[i] = 1;
      forward(values_, i);
      double inverse = 0;  // (G^-1)_ii: the square of column i of L^-1
      for (std::size_t row = i; row < n; ++row) inverse += values_[row] * values_[row];
      rises[i] = x[used_[i]] * x[used_[i]] / std::max(inverse - ones_[i] * ones_[i] / all, 1e-300);
    }
    // Of very many, an eighth at once.
    const std::size_t count = std::max<std::size_t>(1, (n - static_cast<std::size_t>(most)) / 8);
    leaving.resize(n);
    std::iota(leaving.begin(), leaving.end(), 0);
    std::stable_sort(leaving.begin(), leaving.end(), [&](int i, int j) { return rises[i] < rises[j]; });
    leaving.resize(count);
    std::sort(leaving.begin(), leaving.end(), std::greater<>());
    double lost = 0;
    for (const int gone : leaving) {
      lost += x[used_[gone]];
      leave(static_cast<std::size_t>(gone), x);
    }
    for (const int i : used_) x[i] += lost / static_cast<double>(used_.size());
    improve(g, b, x, false);
  }
  while (std::ssize(used_) > most) {  // they do the same
    const auto gone = std::min_element(used_.begin(), used_.end(), [&](int i, int j) { return x[i] < x[j]; });
    leave(static_cast<std::size_t>(gone - used_.begin()), x);
  }
  if (const double reached = x.sum(); reached > 0) x /= reached;
}

}  // namespace sinew
