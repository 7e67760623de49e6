#include "weights/unit_frame.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace sinew {
namespace {

// If the box of all vertices is this many times as large as that of all but one in fifty along each axis, some are astray
// and the box is kGrown times the smaller one. It is taken from this many vertices.
constexpr double kAstray = 8, kGrown = 3, kOutermost = 0.02;
constexpr std::size_t kSample = 4096;
// Far bones and vertices are moved to this many sizes of the mesh away, where nothing overflows.
constexpr double kFarthest = 1e9;

/// Returns the box of most positions, along one axis.
std::array<double, 2> box_of_most(std::span<const double> positions, std::size_t axis, int exponent) {
  std::vector<double> sample;
  const std::size_t vertices = positions.size() / 3, step = vertices / kSample + 1;
  for (std::size_t v = 0; v < vertices; v += step) {
    sample.push_back(std::scalbn(positions[3 * v + axis], -exponent));
  }
  std::ranges::sort(sample);
  const auto left_out = static_cast<std::size_t>(kOutermost * static_cast<double>(sample.size()));
  return {sample[left_out], sample[sample.size() - 1 - left_out]};
}

}  // namespace

UnitFrame::UnitFrame(std::span<const double> positions) {
  double largest = 0;
  for (const double number : positions) largest = std::max(largest, std::abs(number));
  if (largest > 0) exponent_ = std::ilogb(largest);
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = low;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const double number = std::scalbn(positions[i], -exponent_);
    const auto axis = static_cast<Eigen::Index>(i % 3);
    low[axis] = i < 3 ? number : std::min(low[axis], number);
    high[axis] = i < 3 ? number : std::max(high[axis], number);
  }
  centre_ = (low + high) / 2;
  double side = (high - low).maxCoeff();
  Eigen::Vector3d core_low = low, core_high = high;
  for (std::size_t axis = 0; axis < 3 && !positions.empty(); ++axis) {
    const auto box = box_of_most(positions, axis, exponent_);
    core_low[static_cast<Eigen::Index>(axis)] = box[0];
    core_high[static_cast<Eigen::Index>(axis)] = box[1];
  }
  const double core = (core_high - core_low).maxCoeff();
  if (core > 1e-14 && side > kAstray * core) {
    centre_ = (core_low + core_high) / 2;
    side = kGrown * core;
  }
  // Below this nothing but rounding would be seen.
  if (side > 1e-14) scale_ = 1 / side;
  size_ = side > 1e-14 ? std::scalbn(side, exponent_) : 0;
}

Eigen::Vector3d UnitFrame::operator()(const double* point) const {
  Eigen::Vector3d result;
  for (int axis = 0; axis < 3; ++axis) {
    const double number = (std::scalbn(point[axis], -exponent_) - centre_[axis]) * scale_;
    result[axis] = std::clamp(number, -kFarthest, kFarthest);
  }
  return result;
}

}  // namespace sinew
