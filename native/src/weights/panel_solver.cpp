#include "weights/panel_solver.h"

namespace sinew {

PanelSolver::PanelSolver(const Eigen::SparseMatrix<double>& lower) : solver_(lower) {
  const auto diagonal = solver_.vectorD();
  for (const double pivot : diagonal) inverse_diagonal_.push_back(pivot > 0 ? 1 / pivot : 0);
}

void PanelSolver::solve(Scratch& scratch, double negligible) const {
  const auto& factor = solver_.matrixL().nestedExpression();
  const auto* const begin = factor.outerIndexPtr();
  const auto* const rows = factor.innerIndexPtr();
  const double* const entries = factor.valuePtr();
  std::vector<Lanes>& values = scratch.values;
  const std::size_t count = size();
  scratch.has_source.assign(count, 0);
  scratch.is_negligible.assign(count, 0);
  for (std::size_t j = 0; j < count; ++j) {
    if ((values[j] == 0).all()) continue;
    scratch.has_source[j] = 1;
    const Lanes own = values[j];
    for (auto i = begin[j]; i < begin[j + 1]; ++i) values[rows[i]] -= entries[i] * own;
    values[j] *= inverse_diagonal_[j];
  }
  // A column's first entry is in the row of its parent in the elimination tree, and its other entries are in rows where
  // the parent's column has entries, too. So where there is no source below, and the parent's whole column is negligible,
  // so is all that is below it.
  for (std::size_t j = count; j-- > 0;) {
    if (!scratch.has_source[j] && (begin[j] == begin[j + 1] || scratch.is_negligible[rows[begin[j]]])) {
      scratch.is_negligible[j] = 1;
      continue;
    }
    Lanes sum = values[j], largest = Lanes::Zero();
    for (auto i = begin[j]; i < begin[j + 1]; ++i) {
      const Lanes& above = values[rows[i]];
      sum -= entries[i] * above;
      largest = largest.max(above);
    }
    values[j] = sum;
    if (!scratch.has_source[j] && (largest < negligible).all()) scratch.is_negligible[j] = 1;
  }
}

}  // namespace sinew
