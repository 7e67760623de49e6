/// The linear part of inverse kinematics: which step of the joints brings the tasks nearer to their goals.
///
/// Selectively damped least squares (Buss and Kim 2005, "Selectively Damped Least Squares for Inverse Kinematics"): each
/// singular vector of the Jacobian has a bound of its own, so that joints do not run away where the chain is straight.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <span>
#include <vector>

namespace sinew::rig {

/// R rows, three for each task, and D degrees of freedom. Memory is kept from solve to solve.
class DampedLeastSquares {
 public:
  void reserve(std::size_t rows, std::size_t dofs);

  /// eigen_5  see ThinSvd.
  void reset(int rows, int dofs, bool eigen_5);

  /// weight  of a degree of freedom, in (0, 1]: how far it moves.
  void set_weight(int dof, double weight);

  /// Sets three rows of a column. A slide's step counts 100 times as much when the end is looked for.
  void set_column(int row, int dof, const Eigen::Vector3d& column, bool is_slide);
  void set_residual(int row, const Eigen::Vector3d& residual);

  /// Moves a degree of freedom and takes it out of the system.
  void fix(int dof, double moved);

  void solve();

  /// Solves several systems, those of one size side by side, with the bits that solve() gives. Their order changes.
  static void solve(std::span<DampedLeastSquares*> systems);

  double step(int dof) const { return step_[dof]; }
  double largest_step() const;

 private:
  /// The numbers of rows and of columns of what is decomposed.
  int long_side() const { return std::max(rows_, dofs_); }
  int short_side() const { return std::min(rows_, dofs_); }

  template <int C, int N = 0>
  void solve_thin();
  template <int N, int P>
  static void solve_side_by_side(std::span<DampedLeastSquares* const> systems);
  template <int N>
  static void solve_up_to_four(std::span<DampedLeastSquares* const> systems);
  void solve_with_eigen();
  void begin_step();
  void end_step();
  void add_damped(double singular_value, const double* u, const double* v);

  int rows_ = 0;
  int dofs_ = 0;
  bool eigen_5_ = true;
  std::vector<double> jacobian_;                                                           // R x D, column after column
  std::vector<double> residual_;                                                           // R
  std::vector<double> step_, one_step_, column_norm_, weight_, weight_root_, end_factor_;  // D
};

}  // namespace sinew::rig
