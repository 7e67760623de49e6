/// The singular value decomposition of small matrices, with the bits of Eigen's JacobiSVD and without memory from the
/// heap.
///
/// The last bit matters: where a chain of bones cannot reach its target, inverse kinematics amplifies it to what is seen.
#pragma once

#include <cmath>
#include <limits>
#include <utility>

#include "rig/column_sums.h"

namespace sinew::rig {

/// The most rows of a decomposed matrix.
constexpr int kSvdRows = 128;

/// A = U W V^T of a matrix with C columns and at least as many rows. Matrices are column after column.
template <int C>
class ThinSvd {
 public:
  double a[C][kSvdRows];  ///< in; used up
  double u[C][kSvdRows];
  double v[C][C];
  double w[C];  ///< descending

  /// rows     n <= kSvdRows.
  /// eigen_5  whether products of two vectors are added up as from Eigen 5 on.
  void decompose(int rows, bool eigen_5) {
    n_ = rows;
    eigen_5_ = eigen_5;
    const double scale = scaled_down();
    for (auto& column : v) std::fill(column, column + C, 0.0);
    if (n_ > C) {
      triangularise();
    } else {
      for (int j = 0; j < C; ++j) {
        for (int i = 0; i < n_; ++i) {
          u[j][i] = i == j;
          r_[j][i] = a[j][i];
        }
        v[j][j] = 1;
      }
    }
    diagonalise();
    for (int j = 0; j < C; ++j) {
      w[j] = std::fabs(r_[j][j]);
      if (r_[j][j] < 0) {
        for (int i = 0; i < n_; ++i) u[j][i] = -u[j][i];
      }
      w[j] *= scale;
    }
    sort();
  }

 private:
  static constexpr double kSmallest = std::numeric_limits<double>::min();
  static constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

  struct Rotation {
    double cosine, sine;
  };

  /// Divides by the largest element and returns it.
  double scaled_down() {
    double scale = 0;
    for (int j = 0; j < C; ++j) {
      for (int i = 0; i < n_; ++i) scale = std::max(scale, std::fabs(a[j][i]));
    }
    if (scale == 0) scale = 1;
    for (int j = 0; j < C; ++j) {
      for (int i = 0; i < n_; ++i) a[j][i] /= scale;
    }
    return scale;
  }

  /// A P = U R by Householder's reflections, with columns exchanged so that the longest comes first.
  void triangularise() {
    double norms[C], direct_norms[C], taus[C], scaled[C][kSvdRows];
    int order[C];
    for (int j = 0; j < C; ++j) {
      norms[j] = direct_norms[j] = std::sqrt(two_register_product(a[j], a[j], n_));
      order[j] = j;
    }
    for (int k = 0; k < C; ++k) {
      const int longest = static_cast<int>(std::max_element(norms + k, norms + C) - norms);
      if (longest != k) {
        std::swap_ranges(a[k], a[k] + n_, a[longest]);
        std::swap(norms[k], norms[longest]);
        std::swap(direct_norms[k], direct_norms[longest]);
        std::swap(order[k], order[longest]);
      }
      const int left = n_ - k;
      taus[k] = make_reflection(a[k] + k, left);
      for (int i = 1; i < left; ++i) scaled[k][i - 1] = taus[k] * a[k][k + i];
      for (int j = k + 1; j < C; ++j) {
        reflect(a[j] + k, a[k] + k + 1, scaled[k], taus[k], left, k + 2 == C);
        if (norms[j] != 0) update_norm(norms[j], direct_norms[j], a[j] + k, left);
      }
    }
    for (int j = 0; j < C; ++j) {
      for (int i = 0; i < n_; ++i) u[j][i] = i == j;
      for (int i = 0; i < C; ++i) r_[j][i] = i <= j ? a[j][i] : 0;
      v[j][order[j]] = 1;
    }
    for (int k = C - 1; k >= 0; --k) {
      for (int j = k; j < C; ++j) reflect(u[j] + k, a[k] + k + 1, scaled[k], taus[k], n_ - k, C == 1);
    }
  }

  /// Replaces x by the reflection's vector, whose first element is 1, with what x becomes in its place. Returns tau.
  static double make_reflection(double* x, int n) {
    const double rest = n == 1 ? 0 : two_register_product(x + 1, x + 1, n - 1);
    if (rest <= kSmallest) {
      std::fill(x + 1, x + n, 0.0);
      return 0;
    }
    double beta = std::sqrt(x[0] * x[0] + rest);
    if (x[0] >= 0) beta = -beta;
    const double divisor = x[0] - beta;
    for (int i = 1; i < n; ++i) x[i] /= divisor;
    const double tau = (beta - x[0]) / beta;
    x[0] = beta;
    return tau;
  }

  /// essential, scaled  the reflection's vector without its first element, and tau times that.
  /// is_last            whether one column is left, which Eigen computes as a product of two vectors.
  void reflect(double* x, const double* essential, const double* scaled, double tau, int n, bool is_last) const {
    if (n == 1) {
      x[0] *= 1 - tau;
      return;
    }
    if (tau == 0) return;
    double t = !is_last   ? row_product(x + 1, essential, n - 1)
               : eigen_5_ ? four_register_product(essential, x + 1, n - 1)
                          : two_register_product(essential, x + 1, n - 1);
    t += x[0];
    x[0] -= tau * t;
    for (int i = 1; i < n; ++i) x[i] -= t * scaled[i - 1];
  }

  /// Takes the first of n elements off a column's length; computes it again where too little is left.
  static void update_norm(double& norm, double& direct, const double* x, int n) {
    double t = std::fabs(x[0]) / norm;
    t = std::max((1 + t) * (1 - t), 0.0);
    const double ratio = norm / direct;
    if (t * (ratio * ratio) <= std::sqrt(kEpsilon)) {
      norm = direct = std::sqrt(two_register_product(x + 1, x + 1, n - 1));
    } else {
      norm *= std::sqrt(t);
    }
  }

  /// Turns two columns into each other.
  static void turn(double* x, double* y, int n, const Rotation& by) {
    for (int i = 0; i < n; ++i) {
      const double xi = x[i], yi = y[i];
      x[i] = by.cosine * xi + by.sine * yi;
      y[i] = -by.sine * xi + by.cosine * yi;
    }
  }

  /// Jacobi's rotations from both sides, until what is beside the diagonal is lost in rounding.
  void diagonalise() {
    double largest = 0;
    for (int j = 0; j < C; ++j) largest = std::max(largest, std::fabs(r_[j][j]));
    for (bool is_finished = false; !is_finished;) {
      is_finished = true;
      for (int p = 1; p < C; ++p) {
        for (int q = 0; q < p; ++q) {
          const double threshold = std::max(kSmallest, 2 * kEpsilon * largest);
          if (!(std::fabs(r_[q][p]) > threshold || std::fabs(r_[p][q]) > threshold)) continue;
          is_finished = false;
          rotate(p, q);
          largest = std::max({largest, std::fabs(r_[p][p]), std::fabs(r_[q][q])});
        }
      }
    }
  }

  void rotate(int p, int q) {
    const double pp = r_[p][p], pq = r_[q][p], qp = r_[p][q], qq = r_[q][q];
    // One rotation makes the 2 x 2 part symmetric, ...
    Rotation first{1, 0};
    if (const double d = qp - pq; !(std::fabs(d) < kSmallest)) {
      const double ratio = (pp + qq) / d, length = std::sqrt(1 + ratio * ratio);
      first = {ratio / length, 1 / length};
    }
    const double x = first.cosine * pp + first.sine * qp, y = first.cosine * pq + first.sine * qq,
                 z = -first.sine * pq + first.cosine * qq;
    // ... another one diagonal.
    Rotation right{1, 0};
    if (const double twice = 2 * std::fabs(y); !(twice < kSmallest)) {
      const double e = (x - z) / twice, length = std::sqrt(e * e + 1);
      const double g = e > 0 ? 1 / (e + length) : 1 / (e - length), sign = g > 0 ? 1 : -1;
      right.cosine = 1 / std::sqrt(g * g + 1);
      right.sine = -sign * (y / std::fabs(y)) * std::fabs(g) * right.cosine;
    }
    const Rotation left{first.cosine * right.cosine + first.sine * right.sine,
                        first.sine * right.cosine - first.cosine * right.sine};
    for (auto& column : r_) {
      const double up = column[p], down = column[q];
      column[p] = left.cosine * up + left.sine * down;
      column[q] = -left.sine * up + left.cosine * down;
    }
    turn(u[p], u[q], n_, left);
    turn(r_[p], r_[q], C, {right.cosine, -right.sine});
    turn(v[p], v[q], C, {right.cosine, -right.sine});
  }

  void sort() {
    for (int k = 0; k < C; ++k) {
      const int largest = static_cast<int>(std::max_element(w + k, w + C) - w);
      if (w[largest] == 0) return;
      if (largest == k) continue;
      std::swap(w[k], w[largest]);
      std::swap_ranges(u[k], u[k] + n_, u[largest]);
      std::swap_ranges(v[k], v[k] + C, v[largest]);
    }
  }

  int n_ = 0;
  bool eigen_5_ = true;
  double r_[C][C] = {};
};

}  // namespace sinew::rig
