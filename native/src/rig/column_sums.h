/// Products of columns of doubles, added up in the orders in which Eigen does it with registers of two (SSE2).
#pragma once

#include <algorithm>

namespace sinew::rig {

/// A register of Eigen's. R  a double, or Lanes.
template <class R>
struct NumberPair {
  R low = 0, high = 0;

  NumberPair& operator+=(const NumberPair& other) {
    low = low + other.low;
    high = high + other.high;
    return *this;
  }
};

/// The products of a column's elements at 2 `pair` and after it.
template <class R>
NumberPair<R> pair_product(const R* x, const R* y, int pair) {
  return {x[2 * pair] * y[2 * pair], x[2 * pair + 1] * y[2 * pair + 1]};
}

/// The sum of a register, and of the last product if the number of elements is odd.
template <class R>
R total(const NumberPair<R>& sum, const R* x, const R* y, int n) {
  const R both = sum.low + sum.high;
  return n % 2 == 1 ? both + x[n - 1] * y[n - 1] : both;
}

/// Eigen's reductions: two registers, to which an odd last pair is added in the end.
template <class R>
R two_register_product(const R* x, const R* y, int n) {
  const int pairs = n / 2;
  if (pairs == 0) return n == 1 ? x[0] * y[0] : R(0);
  NumberPair<R> sum = pair_product(x, y, 0);
  if (pairs > 1) {
    NumberPair<R> second = pair_product(x, y, 1);
    int k = 2;
    for (; k + 1 < pairs; k += 2) {
      sum += pair_product(x, y, k);
      second += pair_product(x, y, k + 1);
    }
    sum += second;
    if (k < pairs) sum += pair_product(x, y, k);
  }
  return total(sum, x, y, n);
}

/// The product of two vectors from Eigen 5 on: four registers, to the first of which the pairs that are left are added.
template <class R>
R four_register_product(const R* x, const R* y, int n) {
  const int pairs = n / 2;
  if (pairs == 0) return n == 1 ? x[0] * y[0] : R(0);
  NumberPair<R> sums[4];
  const int used = std::min(pairs, 4), whole = pairs - pairs % 4;
  for (int k = 0; k < used; ++k) sums[k] = pair_product(x, y, k);
  for (int k = 4; k < pairs; ++k) sums[k < whole ? k % 4 : k - whole] += pair_product(x, y, k);
  for (int k = used - 1; k > 0; --k) sums[k - 1] += sums[k];
  return total(sums[0], x, y, n);
}

/// A row of Eigen's product of a matrix and a vector: one register that starts at 0.
template <class R>
R row_product(const R* x, const R* y, int n) {
  NumberPair<R> sum;
  for (int k = 0; k < n / 2; ++k) sum += pair_product(x, y, k);
  return total(sum, x, y, n);
}

}  // namespace sinew::rig
