/// (I + strength D^-1 L)^-iterations, applied to several fields at once.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mush/laplacian.h"
#include "sinew/progress.h"

namespace sinew {

/// What is thrown, and caught in the library, when a computation is cancelled.
struct Cancelled {};

/// progress  or null.
inline void stop_if_cancelled(const Progress* progress) {
  if (progress && progress->is_cancelled()) throw Cancelled();
}

/// Fields that are smoothed together: numbers that a vertex has in a panel, one after the other.
constexpr int kFields = 12;

/// That operator as a polynomial of D^-1 L, in Chebyshev's basis on 0..largest, to within 1e-12: what makes the
/// matrix symmetric, D^1/2, leaves its polynomials alone, and a matrix with eigenvalues from 0 to 3 needs no solver.
/// Throws InputError if too many coefficients would be needed.
std::vector<double> smoothing_polynomial(double strength, int iterations, double largest);

/// The rows of a Laplacian that belong to some of its vertices, scaled to eigenvalues from -1 to 1; what else there
/// is counts as zero.
struct ScaledRows {
  std::vector<std::uint32_t> begin;    ///< of each vertex, and the end
  std::vector<std::uint32_t> columns;  ///< numbers in the vertices given
  std::vector<double> values;
  std::vector<double> diagonal;

  /// vertices   ascending.
  /// number_of  V: the place of a vertex in them, or -1.
  void take(const Laplacian& laplacian, std::span<const std::uint32_t> vertices,
            std::span<const std::int32_t> number_of);
  std::size_t count() const { return diagonal.size(); }
};

/// Panels of kFields numbers a row.
struct SmoothingPanels {
  std::vector<double> fields;  ///< what is to be smoothed
  std::vector<double> now, next;
};

/// Clenshaw's recurrence. The result is in panels.now.
/// shape, weights  coefficients for the first fields and for those from kFirstWeightField on.
/// progress        advanced by `steps` on the way; or null.
void smooth_fields(const ScaledRows& rows, std::span<const double> shape, std::span<const double> weights,
                   SmoothingPanels& panels, Progress* progress, std::int64_t steps);

constexpr int kFirstWeightField = 10;

/// One step, in SIMD: next = coefficients * fields + factor (rows now) - next, where a row's coefficients are
/// kFields numbers.
void clenshaw_step(const ScaledRows& rows, const double* coefficients, double factor, const double* fields,
                   const double* now, double* next);

}  // namespace sinew
