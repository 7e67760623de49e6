#include "weights/panel_solver.h"

#include <Eigen/OrderingMethods>
#include <utility>

namespace sinew {
namespace {

constexpr int kColumnsBetweenLooks = 16;  // at whether the work is cancelled; the last columns of a factor are long

using Matrix = Eigen::SparseMatrix<double>;

/// Calls visit(i) for i and what is above it in the elimination tree, up to what is tagged with k; tags it, and makes k
/// the parent of what has none.
template <class Visit>
void climb(int i, int k, std::vector<int>& parents, std::vector<int>& tags, const Visit& visit) {
  for (; tags[i] != k; i = parents[i]) {
    if (parents[i] < 0) parents[i] = k;
    tags[i] = k;
    visit(i);
  }
}

}  // namespace

// The factor L D L^T is made row by row. T. Davis, "Algorithm 849: a concise sparse Cholesky factorization package", ACM
// TOMS 31(4), 2005.
PanelSolver::PanelSolver(const Matrix& lower, const Progress* progress) {
  const auto count = static_cast<int>(lower.cols());
  Matrix upper(count, count);  // in the new order
  {
    Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> inverse;
    const Matrix whole = lower.selfadjointView<Eigen::Lower>();
    Eigen::AMDOrdering<int>()(whole, inverse);
    const auto order = inverse.inverse().eval();
    upper.selfadjointView<Eigen::Upper>() = lower.selfadjointView<Eigen::Lower>().twistedBy(order);
    position_.assign(order.indices().begin(), order.indices().end());
  }
  stop_if_cancelled(progress);

  std::vector<int> parents(count, -1), tags(count, -1);
  begin_.assign(static_cast<std::size_t>(count) + 1, 0);
  for (int k = 0; k < count; ++k) {
    tags[k] = k;
    for (Matrix::InnerIterator it(upper, k); it; ++it) {
      climb(static_cast<int>(it.row()), k, parents, tags, [&](int i) { ++begin_[i + 1]; });
    }
  }
  row_begin_.resize(count);
  std::size_t row_count = 0;
  for (int k = 0; k < count; ++k) {
    const bool goes_on = k > 0 && parents[k - 1] == k && begin_[k] - begin_[k - 1] == begin_[k + 1] + 1;
    row_begin_[k] = goes_on ? row_begin_[k - 1] + 1 : row_count;
    if (!goes_on) row_count += begin_[k + 1];
    begin_[k + 1] += begin_[k];
  }
  rows_.resize(row_count);
  entries_.resize(begin_.back());
  inverse_diagonal_.resize(count);

  std::vector<double> sums(count);
  std::vector<int> pattern(count), path;
  std::vector<std::size_t> end(begin_.begin(), begin_.end() - 1);
  std::ranges::fill(tags, -1);
  for (int k = 0; k < count; ++k) {
    if (k % kColumnsBetweenLooks == 0) stop_if_cancelled(progress);
    int top = count;  // the pattern of row k, in the order in which it is computed
    tags[k] = k;
    for (Matrix::InnerIterator it(upper, k); it; ++it) {
      sums[it.row()] += it.value();
      path.clear();
      climb(static_cast<int>(it.row()), k, parents, tags, [&](int i) { path.push_back(i); });
      while (!path.empty()) pattern[--top] = path.back(), path.pop_back();
    }
    double pivot = std::exchange(sums[k], 0);
    for (; top < count; ++top) {
      const int i = pattern[top];
      const double sum = std::exchange(sums[i], 0);
      const std::size_t own = end[i] - begin_[i];
      int* const rows = rows_.data() + row_begin_[i];
      for (std::size_t e = 0; e < own; ++e) sums[rows[e]] -= entries_[begin_[i] + e] * sum;
      const double entry = sum * inverse_diagonal_[i];
      pivot -= entry * sum;
      rows[own] = k;
      entries_[end[i]++] = entry;
    }
    is_positive_ &= pivot > 0;
    inverse_diagonal_[k] = pivot > 0 ? 1 / pivot : 0;
  }
}

void PanelSolver::solve(Scratch& scratch, double negligible, const Progress* progress) const {
  std::vector<Lanes>& values = scratch.values;
  const std::size_t count = size();
  scratch.has_source.assign(count, 0);
  scratch.is_negligible.assign(count, 0);
  for (std::size_t j = 0; j < count; ++j) {
    if (j % kColumnsBetweenLooks == 0) stop_if_cancelled(progress);
    if ((values[j] == 0).all()) continue;
    scratch.has_source[j] = 1;
    const Lanes own = values[j];
    const int* row = rows_.data() + row_begin_[j];
    for (std::size_t i = begin_[j]; i < begin_[j + 1]; ++i) values[*row++] -= entries_[i] * own;
    values[j] *= inverse_diagonal_[j];
  }
  // A column's first entry is in the row of its parent in the elimination tree, and its other entries are in rows where
  // the parent's column has entries, too. So where there is no source below, and the parent's whole column is negligible,
  // so is all that is below it.
  for (std::size_t j = count; j-- > 0;) {
    if (j % kColumnsBetweenLooks == 0) stop_if_cancelled(progress);
    if (!scratch.has_source[j] && (begin_[j] == begin_[j + 1] || scratch.is_negligible[rows_[row_begin_[j]]])) {
      scratch.is_negligible[j] = 1;
      continue;
    }
    Lanes sum = values[j], largest = Lanes::Zero();
    const int* row = rows_.data() + row_begin_[j];
    for (std::size_t i = begin_[j]; i < begin_[j + 1]; ++i) {
      const Lanes& above = values[*row++];
      sum -= entries_[i] * above;
      largest = largest.max(above);
    }
    values[j] = sum;
    if (!scratch.has_source[j] && (largest < negligible).all()) scratch.is_negligible[j] = 1;
  }
}

std::vector<double> PanelSolver::solved(std::span<const double> right) const {
  Scratch scratch{std::vector<Lanes>(size(), Lanes::Zero()), {}, {}};
  for (std::size_t row = 0; row < size(); ++row) scratch.values[position(row)][0] = right[row];
  solve(scratch, 0);
  std::vector<double> solution(size());
  for (std::size_t row = 0; row < size(); ++row) solution[row] = scratch.values[position(row)][0];
  return solution;
}

}  // namespace sinew
