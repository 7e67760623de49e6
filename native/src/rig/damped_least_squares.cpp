#include "rig/damped_least_squares.h"

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "rig/thin_svd.h"

// The order of operations is that of Blender's intern/iksolver, since each of them rounds.

namespace sinew::rig {
namespace {

/// The largest turn of a joint in one iteration.
constexpr double kLargestTurn = std::numbers::pi / 4;
constexpr double kSmallestSingularValue = 1e-10;

/// Those of one location to reach, with up to this many degrees of freedom, have sizes that the compiler knows.
constexpr int kUnrolledRows = 9;

double length_of(const double* v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

}  // namespace

void DampedLeastSquares::reserve(std::size_t rows, std::size_t dofs) {
  jacobian_.reserve(rows * dofs);
  residual_.reserve(rows);
  for (auto* each : {&step_, &one_step_, &column_norm_, &weight_, &weight_root_, &end_factor_}) each->reserve(dofs);
}

void DampedLeastSquares::reset(int rows, int dofs, bool eigen_5) {
  rows_ = rows;
  dofs_ = dofs;
  eigen_5_ = eigen_5;
  jacobian_.assign(static_cast<std::size_t>(rows) * dofs, 0);
  residual_.assign(rows, 0);
  for (auto* zeros : {&step_, &one_step_, &column_norm_}) zeros->assign(dofs, 0);
  for (auto* ones : {&weight_, &weight_root_, &end_factor_}) ones->assign(dofs, 1);
}

void DampedLeastSquares::set_weight(int dof, double weight) {
  weight_[dof] = weight;
  weight_root_[dof] = std::sqrt(weight);
}

void DampedLeastSquares::set_column(int row, int dof, const Eigen::Vector3d& column, bool is_slide) {
  for (int i = 0; i < 3; ++i) jacobian_[dof * rows_ + row + i] = column[i] * weight_root_[dof];
  end_factor_[dof] = is_slide ? 100 : 1;
}

void DampedLeastSquares::set_residual(int row, const Eigen::Vector3d& residual) {
  for (int i = 0; i < 3; ++i) residual_[row + i] = residual[i];
}

void DampedLeastSquares::fix(int dof, double moved) {
  double* column = &jacobian_[dof * rows_];
  for (int i = 0; i < rows_; ++i) {
    residual_[i] -= column[i] * moved;
    column[i] = 0;
  }
  step_[dof] = 0;
}

double DampedLeastSquares::largest_step() const {
  double largest = 0;
  for (int i = 0; i < dofs_; ++i) largest = std::max(largest, std::fabs(step_[i] * end_factor_[i]));
  return largest;
}

void DampedLeastSquares::begin_step() {
  for (int i = 0; i < dofs_; ++i) {
    double sum = 0;
    for (int j = 0; j < rows_; j += 3) sum += length_of(&jacobian_[i * rows_ + j]);
    column_norm_[i] = sum;
    step_[i] = 0;
  }
}

/// Adds what one singular vector contributes to the step. u, v  its parts among the rows and degrees of freedom.
void DampedLeastSquares::add_damped(double singular_value, const double* u, const double* v) {
  if (singular_value <= kSmallestSingularValue) return;
  const double inverse = 1.0 / singular_value;
  double alpha = 0, reached = 0;
  for (int j = 0; j < rows_; j += 3) {
    for (int k = 0; k < 3; ++k) alpha += u[j + k] * residual_[j + k];
    reached += length_of(u + j);
  }
  alpha *= inverse;
  double moved = 0, largest = 0;
  for (int j = 0; j < dofs_; ++j) {
    moved += std::fabs(v[j]) * column_norm_[j];
    one_step_[j] = v[j] * alpha;
    largest = std::max(largest, std::fabs(one_step_[j]) * weight_root_[j]);
  }
  moved *= inverse;
  double bound = kLargestTurn;
  if (reached < moved) bound *= reached / moved;
  const double damping = bound < largest ? bound / largest : 1.0;
  for (int j = 0; j < dofs_; ++j) step_[j] += 0.80 * std::min(damping / weight_[j], 1.0) * one_step_[j];
}

template <int C, int N>
void DampedLeastSquares::solve_thin() {
  ThinSvd<C, N> svd;
  const bool is_wide = rows_ < dofs_;
  for (int i = 0; i < dofs_; ++i) {
    for (int j = 0; j < rows_; ++j) (is_wide ? svd.a[j][i] : svd.a[i][j]) = jacobian_[i * rows_ + j];
  }
  svd.decompose(long_side(), short_side(), eigen_5_);
  begin_step();
  for (int i = 0; i < short_side(); ++i) {
    add_damped(svd.w[i], is_wide ? svd.v[i] : svd.u[i], is_wide ? svd.u[i] : svd.v[i]);
  }
}

void DampedLeastSquares::solve_with_eigen() {
  const bool is_wide = rows_ < dofs_;
  const Eigen::Map<const Eigen::MatrixXd> jacobian(jacobian_.data(), rows_, dofs_);
  Eigen::MatrixXd tall = jacobian;
  if (is_wide) tall.transposeInPlace();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(tall, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const Eigen::MatrixXd& u = is_wide ? svd.matrixV() : svd.matrixU();
  const Eigen::MatrixXd& v = is_wide ? svd.matrixU() : svd.matrixV();
  begin_step();
  for (Eigen::Index i = 0; i < svd.singularValues().size(); ++i) {
    add_damped(svd.singularValues()[i], u.col(i).data(), v.col(i).data());
  }
}

void DampedLeastSquares::end_step() {
  double largest = 0;
  for (int j = 0; j < dofs_; ++j) {
    step_[j] *= weight_[j];
    largest = std::max(largest, std::fabs(step_[j]));
  }
  if (largest <= kLargestTurn) return;
  const double damping = kLargestTurn / (kLargestTurn + largest);
  for (int j = 0; j < dofs_; ++j) step_[j] *= damping;
}

void DampedLeastSquares::solve() {
  using Way = void (DampedLeastSquares::*)();
  static constexpr auto kWaysOfOneGoal = []<std::size_t... I>(std::index_sequence<I...>) {
    return std::array<Way, sizeof...(I)>{&DampedLeastSquares::solve_thin<3, I + 3>...};
  }
  (std::make_index_sequence<kUnrolledRows - 2>{});
  const int columns = short_side(), rows = long_side();
  const bool is_thin = columns <= kSvdColumns && rows <= kSvdRows;  // larger ones, which no usual rig has, are Eigen's
  const bool is_unrolled = columns == 3 && rows <= kUnrolledRows;
  (this->*(is_unrolled               ? kWaysOfOneGoal[rows - 3]
           : is_thin && columns == 3 ? &DampedLeastSquares::solve_thin<3>
           : is_thin && columns == 6 ? &DampedLeastSquares::solve_thin<6>  // of two goals, or one with a rotation
           : is_thin                 ? &DampedLeastSquares::solve_thin<0>
                                     : &DampedLeastSquares::solve_with_eigen))();
  end_step();
}

/// N  the long side, or 0 for any of up to kUnrolledRows. P  pairs of lanes; those without a system compute what the first
///    one does.
template <int N, int P>
void DampedLeastSquares::solve_side_by_side(std::span<DampedLeastSquares* const> systems) {
  using Numbers = Lanes<P>;
  constexpr int kLanes = Numbers::kCount;
  const bool is_wide = systems[0]->rows_ < systems[0]->dofs_;
  const int rows = N > 0 ? N : systems[0]->long_side();
  ThinSvd<3, N, Numbers, (N > 0 ? N : kUnrolledRows)> svd;
  double lanes[kLanes];
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < rows; ++i) {
      for (std::size_t k = 0; k < kLanes; ++k) {
        const DampedLeastSquares& system = *systems[k < systems.size() ? k : 0];
        lanes[k] = system.jacobian_[is_wide ? i * system.rows_ + j : j * system.rows_ + i];
      }
      svd.a[j][i] = Numbers::read(lanes);
    }
  }
  svd.decompose(rows, 3, systems[0]->eigen_5_);
  double w[3][kLanes], u[kLanes][3][kUnrolledRows], v[kLanes][3][3];
  for (int j = 0; j < 3; ++j) {
    svd.w[j].write(w[j]);
    for (int i = 0; i < rows; ++i) {
      svd.u[j][i].write(lanes);
      for (int k = 0; k < kLanes; ++k) u[k][j][i] = lanes[k];
    }
    for (int i = 0; i < 3; ++i) {
      svd.v[j][i].write(lanes);
      for (int k = 0; k < kLanes; ++k) v[k][j][i] = lanes[k];
    }
  }
  for (std::size_t k = 0; k < systems.size(); ++k) {
    systems[k]->begin_step();
    for (int j = 0; j < 3; ++j) {
      systems[k]->add_damped(w[j][k], is_wide ? v[k][j] : u[k][j], is_wide ? u[k][j] : v[k][j]);
    }
    systems[k]->end_step();
  }
}

template <int N>
void DampedLeastSquares::solve_up_to_four(std::span<DampedLeastSquares* const> systems) {
  systems.size() > 2 ? solve_side_by_side<N, 2>(systems) : solve_side_by_side<N, 1>(systems);
}

void DampedLeastSquares::solve(std::span<DampedLeastSquares*> systems) {
  constexpr std::size_t kMost = 4;
  while (!systems.empty()) {
    const DampedLeastSquares& first = *systems[0];
    const int rows = first.long_side();
    std::size_t count = 1;
    for (std::size_t i = 1; i < systems.size() && count < kMost; ++i) {
      const bool is_like_first = systems[i]->rows_ == first.rows_ && systems[i]->dofs_ == first.dofs_ &&
                                 systems[i]->eigen_5_ == first.eigen_5_;
      if (is_like_first) std::swap(systems[count++], systems[i]);
    }
    if (count > 1 && first.short_side() == 3 && rows <= kUnrolledRows) {
      const auto solve_them = rows == 6   ? &solve_up_to_four<6>  // of two bones
                              : rows == 9 ? &solve_up_to_four<9>
                                          : &solve_up_to_four<0>;
      solve_them(systems.first(count));
    } else {
      for (std::size_t i = 0; i < count; ++i) systems[i]->solve();
    }
    systems = systems.subspan(count);
  }
}

}  // namespace sinew::rig
