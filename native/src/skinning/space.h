/// The transform from a layer's armature to its mesh.
#pragma once

#include <Eigen/LU>
#include <cmath>

#include "sinew/types.h"

namespace sinew {

/// A change of space C and its inverse; zeros if it has none, as in Blender.
struct Space {
  explicit Space(const Matrix4<double>& mesh_from_armature) : forth(mesh_from_armature), back(forth.inverse()) {
    has_inverse = forth.determinant() != 0 && back.allFinite();
    if (!has_inverse) back.setZero();
  }

  /// Whether C only turns, moves and scales uniformly, within the rounding of float32.
  bool is_similarity() const {
    const Eigen::Matrix3d linear = forth.topLeftCorner<3, 3>();
    const Eigen::Matrix3d gram = linear.transpose() * linear;
    const double scale2 = gram.trace() / 3;
    return linear.determinant() > 0 &&
           (gram - scale2 * Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= 1e-6 * scale2;
  }

  /// The rotation of C. Only if C is a similarity.
  Eigen::Matrix3d axes() const {
    const Eigen::Matrix3d linear = forth.topLeftCorner<3, 3>();
    return linear / std::cbrt(linear.determinant());
  }

  Matrix4<double> forth;
  Matrix4<double> back;
  bool has_inverse;
};

}  // namespace sinew
