/// Least squares whose unknowns are not negative and sum to 1.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace sinew {

/// Minimises x^T G x / 2 - b^T x over x >= 0, sum x = 1, by a primal active set: solved by Cholesky on the unknowns in
/// use; what would become negative leaves, what lowers the sum enters. One object for each thread.
class SimplexLeastSquares {
 public:
  using Matrix = Eigen::Ref<const Eigen::MatrixXd>;
  using Vector = Eigen::Ref<const Eigen::VectorXd>;

  /// G  n x n, positive definite.
  /// x  n: not negative, with sum 1, to begin with; or all 0. The solution.
  void solve(const Matrix& g, const Vector& b, Eigen::Ref<Eigen::VectorXd> x);

  /// The same with at most `most` unknowns that are not 0. Those that raise the sum least leave, one by one unless they are
  /// very many.
  void solve_sparse(const Matrix& g, const Vector& b, int most, Eigen::Ref<Eigen::VectorXd> x);

 private:
  bool factor(const Matrix& g);
  /// first  the values before it are 0 and stay as they come.
  void substitute(std::vector<double>& values, std::size_t first = 0) const;
  void leave(std::size_t place, Eigen::Ref<Eigen::VectorXd> x);
  void solve_equality(const Vector& b);
  void improve(const Matrix& g, const Vector& b, Eigen::Ref<Eigen::VectorXd> x, bool may_enter);
  double& lower(std::size_t row, std::size_t column) { return lower_[row * stride_ + column]; }
  double lower(std::size_t row, std::size_t column) const { return lower_[row * stride_ + column]; }

  std::vector<int> used_;                  // the unknowns that may differ from 0
  std::vector<std::uint8_t> is_used_;      // of each unknown
  std::size_t factored_ = 0, stride_ = 0;  // rows of the factor that hold; between rows
  std::vector<double> lower_, ones_, values_;
  double multiplier_ = 0;
};

}  // namespace sinew
