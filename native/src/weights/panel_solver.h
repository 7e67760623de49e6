/// Solves a symmetric system for several right-hand sides at once.
#pragma once

#include <Eigen/SparseCore>
#include <algorithm>
#include <memory>
#include <span>
#include <vector>

#include "base/cancelled.h"
#include "base/kept.h"
#include "base/parallel.h"
#include "sinew/types.h"

namespace sinew {

constexpr int kLanes = 8;  // right-hand sides that are solved together
using Lanes = Eigen::Array<double, kLanes, 1>;

/// A factorised symmetric matrix. Immutable.
class PanelSolver {
 public:
  /// lower  the lower triangle. Throws Cancelled, soon.
  explicit PanelSolver(const Eigen::SparseMatrix<double>& lower, const Progress* progress = nullptr);

  std::size_t size() const { return inverse_diagonal_.size(); }
  /// Whether the matrix is positive definite, as far as rounding lets one see. If not, no solution means anything.
  bool is_positive() const { return is_positive_; }

  /// Memory that a thread uses again.
  struct Scratch {
    std::vector<Lanes> values;
    std::vector<std::uint8_t> has_source, is_negligible;
  };

  /// Replaces the right-hand sides in scratch.values by the solutions, both in the order of position(). With `negligible`
  /// above 0, solutions are not exact where they are below: there they may be 0. This is for matrices without a positive
  /// entry off the diagonal, whose rows have no negative sum, and sources that are not negative: by the maximum principle
  /// no solution is larger than those around it where there is no source, so that most of the work for sources in one
  /// place can be left out. Throws Cancelled, soon.
  void solve(Scratch& scratch, double negligible, const Progress* progress = nullptr) const;

  /// Returns the solution for one right-hand side, both in the order of the matrix.
  std::vector<double> solved(std::span<const double> right) const;

  /// Where a row of the matrix is in the values.
  std::size_t position(std::size_t row) const { return position_[row]; }

 private:
  std::vector<int> position_;
  std::vector<std::size_t> begin_;  // of the columns below the diagonal, whose entries have ascending rows
  // Where each column's rows begin. A column whose rows are those of the one before without the first shares them.
  std::vector<std::size_t> row_begin_;
  std::vector<int> rows_;
  std::vector<double> entries_, inverse_diagonal_;
  bool is_positive_ = true;
};

/// Solves for any number of columns, kLanes at once: fill(first, lanes, scratch) sets the right-hand sides of the columns
/// from `first` on, read(first, lanes, scratch) reads the solutions. Panels run in parallel. The progress is advanced by
/// `steps`.
template <class Fill, class Read>
void solve_panels(const PanelSolver& solver, std::size_t columns, double negligible, Progress* progress,
                  std::int64_t steps, const Fill& fill, const Read& read) {
  const std::size_t panels = (columns + kLanes - 1) / kLanes;
  Kept<PanelSolver::Scratch> kept;
  parallel_for(panels, 1, [&](std::size_t begin, std::size_t end) {
    const auto scratch = kept.borrow([] { return std::make_unique<PanelSolver::Scratch>(); });
    for (std::size_t panel = begin; panel < end; ++panel) {
      stop_if_cancelled(progress);
      const std::size_t first = panel * kLanes, lanes = std::min<std::size_t>(kLanes, columns - first);
      scratch->values.assign(solver.size(), Lanes::Zero());
      fill(first, lanes, *scratch);
      solver.solve(*scratch, negligible, progress);
      read(first, lanes, *scratch);
      advance_share(progress, steps, panel, panels);
    }
  });
}

}  // namespace sinew
