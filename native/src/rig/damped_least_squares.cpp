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

/// Decompositions with more columns are left to Eigen; no usual rig has them.
constexpr int kThinColumns = 12;

double length_of(const double* v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

}  // namespace

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

template <int C>
void DampedLeastSquares::solve_thin() {
  ThinSvd<C> svd;
  const bool is_wide = rows_ < dofs_;
  for (int i = 0; i < dofs_; ++i) {
    for (int j = 0; j < rows_; ++j) (is_wide ? svd.a[j][i] : svd.a[i][j]) = jacobian_[i * rows_ + j];
  }
  svd.decompose(is_wide ? dofs_ : rows_, eigen_5_);
  begin_step();
  for (int i = 0; i < C; ++i) {
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

void DampedLeastSquares::solve() {
  using Way = void (DampedLeastSquares::*)();
  static constexpr auto kWays = []<std::size_t... I>(std::index_sequence<I...>) {
    return std::array<Way, sizeof...(I)>{&DampedLeastSquares::solve_thin<I + 1>...};
  }
  (std::make_index_sequence<kThinColumns>{});
  const int columns = std::min(rows_, dofs_);
  const bool is_thin = columns <= kThinColumns && std::max(rows_, dofs_) <= kSvdRows;
  (this->*(is_thin ? kWays[columns - 1] : &DampedLeastSquares::solve_with_eigen))();
  double largest = 0;
  for (int j = 0; j < dofs_; ++j) {
    step_[j] *= weight_[j];
    largest = std::max(largest, std::fabs(step_[j]));
  }
  if (largest <= kLargestTurn) return;
  const double damping = kLargestTurn / (kLargestTurn + largest);
  for (int j = 0; j < dofs_; ++j) step_[j] *= damping;
}

}  // namespace sinew::rig
