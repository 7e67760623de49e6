/// The rotations of one vertex's joints, blended.
#pragma once

#include <cstddef>
#include <cstdint>

#include "skinning/blocked_skin.h"
#include "skinning/palette.h"

namespace sinew {

/// Calls add(joint, weight, weight with the sign of its rotation) for each influence; returns the sum of the rotations,
/// w x y z. Each sign is chosen against the sum so far, in stored order.
template <class Add>
Eigen::Vector4f sum_rotations(const Influences& influences, const Palette& palette, const Add& add) {
  Eigen::Vector4f real = Eigen::Vector4f::Zero();
  for (std::size_t i = 0; i < influences.joints.size(); ++i) {
    const std::int32_t j = influences.joints[i];
    const Eigen::Map<const Eigen::Vector4f> joint(palette.dual_quaternions[j].real);
    const float weight = influences.weights[i];
    const float sign = joint.dot(real) < 0 ? -weight : weight;
    real += sign * joint;
    add(j, weight, sign);
  }
  return real;
}

}  // namespace sinew
