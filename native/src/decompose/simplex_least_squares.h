/// Least squares whose unknowns are not negative and sum to 1.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

namespace sinew {

/// A symmetric G of which only those columns are made that somebody asks for: each unknown that is ever in use.
class Gram {
 public:
  virtual ~Gram() = default;
  virtual std::span<const double> column(std::size_t k) = 0;  ///< n
  virtual std::span<const double> diagonal() = 0;             ///< n
};

/// One that is there as a whole.
class WholeGram final : public Gram {
 public:
  explicit WholeGram(const Eigen::Ref<const Eigen::MatrixXd>& g) : g_(g), diagonal_(g.diagonal()) {}
  std::span<const double> column(std::size_t k) override {
    return {g_.col(static_cast<Eigen::Index>(k)).data(), static_cast<std::size_t>(g_.rows())};
  }
  std::span<const double> diagonal() override { return {diagonal_.data(), static_cast<std::size_t>(diagonal_.size())}; }

 private:
  Eigen::Ref<const Eigen::MatrixXd> g_;
  Eigen::VectorXd diagonal_;
};

/// Minimises x^T G x / 2 - b^T x over x >= 0, sum x = 1, by a primal active set: solved by Cholesky on the unknowns in
/// use; what would become negative leaves, what lowers the sum enters. One object for each thread.
class SimplexLeastSquares {
 public:
  using Vector = Eigen::Ref<const Eigen::VectorXd>;

  /// g  n x n, positive definite.
  /// x  n: not negative, with sum 1, to begin with; or all 0. The solution.
  void solve(Gram& g, const Vector& b, Eigen::Ref<Eigen::VectorXd> x);

  /// The same with at most `most` unknowns that are not 0. Those that raise the sum least leave, one by one unless they are
  /// very many.
  void solve_sparse(Gram& g, const Vector& b, int most, Eigen::Ref<Eigen::VectorXd> x);

 private:
  bool factor(Gram& g);
  /// Solves L y = values; those before the first are 0 and stay so.
  void forward(std::vector<double>& values, std::size_t first = 0) const;
  void substitute(std::vector<double>& values) const;  ///< solves L L^T y = values
  void leave(std::size_t place, Eigen::Ref<Eigen::VectorXd> x);
  void solve_equality(const Vector& b);
  void improve(Gram& g, const Vector& b, Eigen::Ref<Eigen::VectorXd> x, bool may_enter);
  double& lower(std::size_t row, std::size_t column) { return lower_[row * stride_ + column]; }
  double lower(std::size_t row, std::size_t column) const { return lower_[row * stride_ + column]; }

  std::vector<int> used_;                  // the unknowns that may differ from 0
  std::size_t factored_ = 0, stride_ = 0;  // rows of the factor that hold; between rows
  std::vector<double> lower_, ones_, values_, slopes_;
  double multiplier_ = 0;
};

}  // namespace sinew
