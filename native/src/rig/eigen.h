/// A rig's matrices as those that callers have.
#pragma once

#include "rig/matrix.h"
#include "sinew/types.h"

namespace sinew::rig {

inline Eigen::Map<const Matrix4<float>> eigen_of(const Mat4& matrix) {
  return Eigen::Map<const Matrix4<float>>(&matrix.columns[0][0]);
}

}  // namespace sinew::rig
