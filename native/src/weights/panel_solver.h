/// Solves a symmetric system for several right-hand sides at once.
#pragma once

#include <Eigen/SparseCholesky>
#include <span>
#include <vector>

#include "sinew/types.h"

namespace sinew {

constexpr int kLanes = 8;  // right-hand sides that are solved together
using Lanes = Eigen::Array<double, kLanes, 1>;

/// A factorised matrix with a positive diagonal, no positive entry off it, and rows whose sums are not negative. By the
/// maximum principle no solution is larger than those around it where there is no source, so that most of the work for
/// sources in one place can be left out. Immutable.
class PanelSolver {
 public:
  /// lower  the lower triangle, in a row order of its own.
  explicit PanelSolver(const Eigen::SparseMatrix<double>& lower);

  std::size_t size() const { return inverse_diagonal_.size(); }

  /// Memory that a thread uses again.
  struct Scratch {
    std::vector<Lanes> values;
    std::vector<std::uint8_t> has_source, is_negligible;
  };

  /// Replaces the right-hand sides, not negative, in scratch.values by the solutions, which are not exact where they are
  /// below `negligible`: there they may be 0. Both in the order of position().
  void solve(Scratch& scratch, double negligible) const;

  /// Where a row of the matrix is in the values.
  std::size_t position(std::size_t row) const {
    return solver_.permutationP().indices()[static_cast<Eigen::Index>(row)];
  }

 private:
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver_;
  std::vector<double> inverse_diagonal_;
};

}  // namespace sinew
