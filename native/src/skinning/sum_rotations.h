/// The rotations of one vertex's joints, blended.
#pragma once

#include <cstddef>
#include <cstdint>

#include "skinning/blocked_skin.h"
#include "skinning/palette.h"

namespace sinew {

/// Calls add(joint, weight, weight with the sign of its rotation) for each influence; returns the sum of the rotations,
/// w x y z. Each sign is chosen against the sum so far, in stored order. Where joints lie half a turn apart the last bit
/// decides, so these sums are Blender's: of its floats, from left to right.
template <class Add>
Eigen::Vector4f sum_rotations(const Influences& influences, const Palette& palette, const Add& add) {
  Eigen::Vector4f real = Eigen::Vector4f::Zero();
  float own_sum[4] = {};
  for (std::size_t i = 0; i < influences.joints.size(); ++i) {
    const std::int32_t j = influences.joints[i];
    const OwnRotation& own = palette.own_rotations[j];
    const float weight = influences.weights[i];
    float cosine = 0;
    for (int part = 0; part < 4; ++part) cosine += own.real[part] * own_sum[part];
    const float own_sign = cosine < 0 ? -weight : weight;
    for (int part = 0; part < 4; ++part) own_sum[part] += own_sign * own.real[part];
    const float sign = own_sign * own.sign;
    real += sign * Eigen::Map<const Eigen::Vector4f>(palette.dual_quaternions[j].real);
    add(j, weight, sign);
  }
  return real;
}

}  // namespace sinew
