#include "mush/implicit_smoothing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/check.h"

namespace sinew {
namespace {

constexpr std::size_t kMostCoefficients = 4096;
constexpr double kTail = 1e-13;

std::vector<double> chebyshev_coefficients(double strength, int iterations, double largest, std::size_t count) {
  const double n = static_cast<double>(count);
  std::vector<double> values(count), coefficients(count);
  for (std::size_t m = 0; m < count; ++m) {
    const double x = std::cos((static_cast<double>(m) + 0.5) * std::numbers::pi / n);
    values[m] = std::pow(1 + strength * largest / 2 * (1 + x), -iterations);
  }
  // cos(k (m + 1/2) pi / n), which takes at most 4 n different values.
  std::vector<double> cosines(4 * count);
  for (std::size_t i = 0; i < cosines.size(); ++i) {
    cosines[i] = std::cos(static_cast<double>(i) * std::numbers::pi / (2 * n));
  }
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t m = 0; m < count; ++m) coefficients[k] += values[m] * cosines[k * (2 * m + 1) % (4 * count)];
    coefficients[k] *= (k == 0 ? 1 : 2) / n;
  }
  return coefficients;
}

}  // namespace

std::vector<double> smoothing_polynomial(double strength, int iterations, double largest) {
  if (strength == 0 || iterations == 0 || largest == 0) return {1};
  for (std::size_t count = 32; count <= kMostCoefficients; count *= 2) {
    auto coefficients = chebyshev_coefficients(strength, iterations, largest, count);
    const auto half = coefficients.begin() + static_cast<std::ptrdiff_t>(count / 2);
    if (std::any_of(half, coefficients.end(), [](double c) { return std::abs(c) > kTail; })) continue;
    // The samples may have missed the steep part, so check that a constant field stays constant.
    double constant = 0;
    for (std::size_t k = 0; k < count; ++k) constant += k % 2 == 0 ? coefficients[k] : -coefficients[k];
    if (std::abs(constant - 1) > 1e-11) continue;
    double tail = 0;
    while (tail + std::abs(coefficients.back()) < kTail) {
      tail += std::abs(coefficients.back());
      coefficients.pop_back();
    }
    return coefficients;
  }
  fail("smoothing by ", strength, ", ", iterations, " times, is too strong; expected less");
}

void ScaledRows::assign(const Laplacian& laplacian, std::span<const std::uint32_t> vertices,
                        std::span<const std::int32_t> number_of) {
  begin.assign(1, 0);
  columns.clear();
  values.clear();
  diagonal.clear();
  const double scale = laplacian.largest > 0 ? 2 / laplacian.largest : 0;
  for (const std::uint32_t v : vertices) {
    for (std::uint32_t i = laplacian.begin[v]; i < laplacian.begin[v + 1]; ++i) {
      const std::int32_t column = number_of[laplacian.columns[i]];
      if (column < 0) continue;
      columns.push_back(static_cast<std::uint32_t>(column));
      values.push_back(scale * laplacian.values[i]);
    }
    diagonal.push_back(laplacian.has_neighbours(v) ? scale - 1 : -1);
    begin.push_back(static_cast<std::uint32_t>(columns.size()));
  }
}

void smooth_fields(const ScaledRows& rows, std::span<const double> shape, std::span<const double> weights,
                   SmoothingPanels& panels, Progress* progress, std::int64_t steps) {
  panels.now.assign(rows.count() * kFields, 0);
  panels.next.assign(rows.count() * kFields, 0);
  const auto count = std::ssize(shape.size() > weights.size() ? shape : weights);
  for (auto left = count; left-- > 0;) {
    stop_if_cancelled(progress);
    if (progress) progress->advance(steps * (count - left) / count - steps * (count - left - 1) / count);
    const auto k = static_cast<std::size_t>(left);
    double coefficients[kFields];
    for (int f = 0; f < kFields; ++f) {
      const auto own = f < kFirstWeightField ? shape : weights;
      coefficients[f] = k < own.size() ? own[k] : 0;
    }
    clenshaw_step(rows, coefficients, k == 0 ? 1 : 2, panels.fields.data(), panels.now.data(), panels.next.data());
    panels.now.swap(panels.next);
  }
}

}  // namespace sinew
