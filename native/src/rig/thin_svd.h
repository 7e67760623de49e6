/// The singular value decomposition of small matrices, with the bits of Eigen's JacobiSVD and without memory from the
/// heap.
///
/// The last bit matters: where a chain of bones cannot reach its target, inverse kinematics amplifies it to what is seen.
#pragma once

#include <limits>
#include <utility>

#include "rig/column_sums.h"
#include "rig/lanes.h"

namespace sinew::rig {

/// The most rows and columns of a decomposed matrix.
constexpr int kSvdRows = 128, kSvdColumns = 12;

/// A = U W V^T of a matrix with C columns and at least as many rows, N; of what is 0, any number. Matrices are column after
/// column. R is a double, or Lanes to decompose several matrices at once: nearly all time is waiting for roots and
/// quotients.
template <int C, int N = 0, class R = double, int kRows = (N > 0 ? N : kSvdRows)>
class ThinSvd {
 public:
  static constexpr int kColumns = C > 0 ? C : kSvdColumns;

  R a[kColumns][kRows];  ///< in; used up
  R u[kColumns][kRows];
  R v[kColumns][kColumns];
  R w[kColumns];  ///< descending

  /// rows     N, or if that is 0 at most kRows.
  /// columns  C, or if that is 0 at most kSvdColumns.
  /// eigen_5  whether products of two vectors are added up as from Eigen 5 on.
  void decompose(int rows, int columns, bool eigen_5) {
    rows_ = rows;
    columns_ = columns;
    eigen_5_ = eigen_5;
    const R scale = scaled_down();
    if (n() > c()) {
      triangularise();
    } else {
      for (int j = 0; j < c(); ++j) {
        for (int i = 0; i < n(); ++i) {
          u[j][i] = v[j][i] = i == j;
          r_[j][i] = a[j][i];
        }
      }
    }
    diagonalise();
    for (int j = 0; j < c(); ++j) {
      const auto is_negative = r_[j][j] < R(0);
      for (int i = 0; i < n(); ++i) u[j][i] = either(is_negative, -u[j][i], u[j][i]);
      w[j] = magnitude(r_[j][j]) * scale;
    }
    sort();
  }

 private:
  static constexpr double kSmallest = std::numeric_limits<double>::min();
  static constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

  using Condition = decltype(R() < R());

  struct Rotation {
    R cosine, sine;
  };

  /// Divides by the largest element and returns it.
  R scaled_down() {
    R scale = 0;
    for (int j = 0; j < c(); ++j) {
      for (int i = 0; i < n(); ++i) scale = larger(scale, magnitude(a[j][i]));
    }
    scale = either(scale == R(0), 1, scale);
    for (int j = 0; j < c(); ++j) {
      for (int i = 0; i < n(); ++i) a[j][i] = a[j][i] / scale;
    }
    return scale;
  }

  static void exchange_if(const Condition& condition, R& a, R& b) {
    const R before = a;
    a = either(condition, b, a);
    b = either(condition, before, b);
  }

  /// Brings the largest of values[k] and what is behind it to the front. exchange(condition, other) exchanges the rest.
  template <class Exchange>
  void bring_largest(R* values, int k, const Exchange& exchange) const {
    R largest = values[k], place = k;
    for (int j = k + 1; j < c(); ++j) {
      const auto is_larger = largest < values[j];
      largest = either(is_larger, values[j], largest);
      place = either(is_larger, j, place);
    }
    for (int j = k + 1; j < c(); ++j) {
      const auto is_largest = place == R(j);
      if (!is_any(is_largest)) continue;
      exchange_if(is_largest, values[k], values[j]);
      exchange(is_largest, j);
    }
  }

  /// A P = U R by Householder's reflections, with columns exchanged so that the longest comes first.
  void triangularise() {
    R norms[kColumns], direct_norms[kColumns], taus[kColumns], scaled[kColumns][kRows], order[kColumns];
    for (int j = 0; j < c(); ++j) {
      norms[j] = direct_norms[j] = root(two_register_product(a[j], a[j], n()));
      order[j] = j;
    }
    for (int k = 0; k < c(); ++k) {
      bring_largest(norms, k, [&](const Condition& condition, int other) {
        for (int i = 0; i < n(); ++i) exchange_if(condition, a[k][i], a[other][i]);
        exchange_if(condition, direct_norms[k], direct_norms[other]);
        exchange_if(condition, order[k], order[other]);
      });
      const int left = n() - k;
      taus[k] = make_reflection(a[k] + k, left);
      for (int i = 1; i < left; ++i) scaled[k][i - 1] = taus[k] * a[k][k + i];
      for (int j = k + 1; j < c(); ++j) {
        reflect(a[j] + k, a[k] + k + 1, scaled[k], taus[k], left, k + 2 == c());
        update_norm(norms[j], direct_norms[j], a[j] + k, left);
      }
    }
    for (int j = 0; j < c(); ++j) {
      for (int i = 0; i < n(); ++i) u[j][i] = i == j;
      for (int i = 0; i < c(); ++i) r_[j][i] = i <= j ? a[j][i] : R(0);
      for (int i = 0; i < c(); ++i) v[j][i] = either(order[j] == R(i), 1, 0);
    }
    for (int k = c() - 1; k >= 0; --k) {
      for (int j = k; j < c(); ++j) reflect(u[j] + k, a[k] + k + 1, scaled[k], taus[k], n() - k, c() == 1);
    }
  }

  /// Replaces x by the reflection's vector, whose first element is 1, with what x becomes in its place. Returns tau.
  static R make_reflection(R* x, int n) {
    const R rest = n == 1 ? R(0) : two_register_product(x + 1, x + 1, n - 1);
    const auto is_short = rest <= R(kSmallest);
    const R length = root(x[0] * x[0] + rest);
    const R beta = either(R(0) <= x[0], -length, length);
    const R divisor = x[0] - beta;
    for (int i = 1; i < n; ++i) x[i] = either(is_short, 0, x[i] / divisor);
    const R tau = either(is_short, 0, (beta - x[0]) / beta);
    x[0] = either(is_short, x[0], beta);
    return tau;
  }

  /// essential, scaled  the reflection's vector without its first element, and tau times that.
  /// is_last            whether one column is left, which Eigen computes as a product of two vectors.
  void reflect(R* x, const R* essential, const R* scaled, const R& tau, int n, bool is_last) const {
    if (n == 1) {
      x[0] = x[0] * (R(1) - tau);
      return;
    }
    const auto is_nothing = tau == R(0);
    if (is_every(is_nothing)) return;
    R t = !is_last   ? row_product(x + 1, essential, n - 1)
          : eigen_5_ ? four_register_product(essential, x + 1, n - 1)
                     : two_register_product(essential, x + 1, n - 1);
    t = t + x[0];
    x[0] = either(is_nothing, x[0], x[0] - tau * t);
    for (int i = 1; i < n; ++i) x[i] = either(is_nothing, x[i], x[i] - t * scaled[i - 1]);
  }

  /// Takes the first of n elements off a column's length; computes it again where too little is left.
  static void update_norm(R& norm, R& direct, const R* x, int n) {
    R t = magnitude(x[0]) / norm;
    t = larger((R(1) + t) * (R(1) - t), R(0));
    const R ratio = norm / direct;
    const auto is_zero = norm == R(0);
    const auto is_lost = t * (ratio * ratio) <= R(kRootOfEpsilon);
    R updated = norm * root(t);
    if (is_any(is_lost)) {
      const R computed = root(two_register_product(x + 1, x + 1, n - 1));
      updated = either(is_lost, computed, updated);
      direct = either(is_zero, direct, either(is_lost, computed, direct));
    }
    norm = either(is_zero, norm, updated);
  }

  /// Turns two columns into each other.
  static void turn(R* x, R* y, int n, const Rotation& by, const Condition& where) {
    if (is_every(where)) {
      for (int i = 0; i < n; ++i) {
        const R xi = x[i], yi = y[i];
        x[i] = by.cosine * xi + by.sine * yi;
        y[i] = -by.sine * xi + by.cosine * yi;
      }
      return;
    }
    for (int i = 0; i < n; ++i) {
      const R xi = x[i], yi = y[i];
      x[i] = either(where, by.cosine * xi + by.sine * yi, xi);
      y[i] = either(where, -by.sine * xi + by.cosine * yi, yi);
    }
  }

  /// Jacobi's rotations from both sides, until what is beside the diagonal is lost in rounding.
  void diagonalise() {
    R largest = 0;
    for (int j = 0; j < c(); ++j) largest = larger(largest, magnitude(r_[j][j]));
    for (bool is_finished = false; !is_finished;) {
      is_finished = true;
      for (int p = 1; p < c(); ++p) {
        for (int q = 0; q < p; ++q) {
          const R threshold = larger(R(kSmallest), R(2 * kEpsilon) * largest);
          const auto is_wanted = is_either(threshold < magnitude(r_[q][p]), threshold < magnitude(r_[p][q]));
          if (!is_any(is_wanted)) continue;
          is_finished = false;
          rotate(p, q, is_wanted);
          const R on_diagonal = larger(magnitude(r_[p][p]), magnitude(r_[q][q]));
          largest = either(is_wanted, larger(largest, on_diagonal), largest);
        }
      }
    }
  }

  void rotate(int p, int q, const Condition& where) {
    const R pp = r_[p][p], pq = r_[q][p], qp = r_[p][q], qq = r_[q][q];
    // One rotation makes the 2 x 2 part symmetric, ...
    const R d = qp - pq;
    const R ratio = (pp + qq) / d, ratio_length = root(R(1) + ratio * ratio);
    const auto is_symmetric = magnitude(d) < R(kSmallest);
    const Rotation first{either(is_symmetric, 1, ratio / ratio_length), either(is_symmetric, 0, R(1) / ratio_length)};
    const R x = first.cosine * pp + first.sine * qp, y = first.cosine * pq + first.sine * qq,
            z = -first.sine * pq + first.cosine * qq;
    // ... another one diagonal.
    const R twice = R(2) * magnitude(y);
    const R e = (x - z) / twice, e_length = root(e * e + R(1));
    const auto is_positive = R(0) < e;
    const R g = R(1) / either(is_positive, e + e_length, e - e_length);
    const R sign = either(is_positive, 1, -1);
    const auto is_diagonal = twice < R(kSmallest);
    const R cosine = R(1) / root(g * g + R(1));
    const Rotation right{either(is_diagonal, 1, cosine),
                         either(is_diagonal, 0, -sign * (y / magnitude(y)) * magnitude(g) * cosine)};
    const Rotation left{first.cosine * right.cosine + first.sine * right.sine,
                        first.sine * right.cosine - first.cosine * right.sine};
    for (int j = 0; j < c(); ++j) {
      const R up = r_[j][p], down = r_[j][q];
      r_[j][p] = either(where, left.cosine * up + left.sine * down, up);
      r_[j][q] = either(where, -left.sine * up + left.cosine * down, down);
    }
    turn(u[p], u[q], n(), left, where);
    turn(r_[p], r_[q], c(), {right.cosine, -right.sine}, where);
    turn(v[p], v[q], c(), {right.cosine, -right.sine}, where);
  }

  void sort() {
    for (int k = 0; k < c(); ++k) {
      bring_largest(w, k, [&](const Condition& condition, int other) {
        for (int i = 0; i < n(); ++i) exchange_if(condition, u[k][i], u[other][i]);
        for (int i = 0; i < c(); ++i) exchange_if(condition, v[k][i], v[other][i]);
      });
    }
  }

  static constexpr double kRootOfEpsilon = 0x1p-26;  // of kEpsilon

  int n() const { return N > 0 ? N : rows_; }
  int c() const { return C > 0 ? C : columns_; }

  int rows_ = 0, columns_ = 0;
  bool eigen_5_ = true;
  R r_[kColumns][kColumns] = {};
};

}  // namespace sinew::rig
