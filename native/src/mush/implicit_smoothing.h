/// (I + strength D^-1 L)^-iterations, applied to several fields at once.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/cancelled.h"
#include "mush/laplacian.h"
#include "sinew/progress.h"

namespace sinew {

/// How many fields are smoothed together: the number of consecutive values per vertex in a panel.
constexpr int kFields = 12;

/// Returns that operator as a polynomial of D^-1 L, in the Chebyshev basis on 0..largest, accurate to 1e-12. This works
/// because the change of basis by D^1/2 that makes the matrix symmetric does not change its polynomials, and a matrix
/// with eigenvalues from 0 to 3 needs no solver. Throws InputError if too many coefficients would be needed.
std::vector<double> smoothing_polynomial(double strength, int iterations, double largest);

/// The rows of a Laplacian that belong to some of its vertices, scaled to eigenvalues from -1 to 1; all other vertices
/// count as zero.
struct ScaledRows {
  std::vector<std::uint32_t> begin;    ///< of each vertex, then the end
  std::vector<std::uint32_t> columns;  ///< indices into the given vertices
  std::vector<double> values;
  std::vector<double> diagonal;

  /// vertices   ascending.
  /// number_of  V: the index of each vertex in them, or -1.
  void assign(const Laplacian& laplacian, std::span<const std::uint32_t> vertices,
              std::span<const std::int32_t> number_of);
  std::size_t count() const { return diagonal.size(); }
};

/// Panels of kFields numbers per row.
struct SmoothingPanels {
  std::vector<double> fields;  ///< what is to be smoothed
  std::vector<double> now, next;
};

/// Smooths by Clenshaw's recurrence. The result is in panels.now.
/// shape, weights  coefficients for the first fields and for those from kFirstWeightField on.
/// progress        advanced by `steps` in total; or null.
void smooth_fields(const ScaledRows& rows, std::span<const double> shape, std::span<const double> weights,
                   SmoothingPanels& panels, Progress* progress, std::int64_t steps);

constexpr int kFirstWeightField = 10;

/// One step, in SIMD: next = coefficients * fields + factor (rows now) - next, where a row's coefficients are
/// kFields numbers.
void clenshaw_step(const ScaledRows& rows, const double* coefficients, double factor, const double* fields,
                   const double* now, double* next);

}  // namespace sinew
