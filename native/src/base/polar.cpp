#include "base/polar.h"

#include <Eigen/LU>
#include <Eigen/SVD>

namespace sinew {

Eigen::Matrix3d nearest_rotation_to_any(const Eigen::Matrix3d& linear) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(linear, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) sign.z() = -1;
  return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& linear) {
  constexpr double kFlat = 1e-3, kConverged = 1e-8;  // a step of 1e-8 leaves an error of its square
  constexpr int kSteps = 20;
  const double size = linear.norm();
  if (!(linear.determinant() > kFlat * size * size * size)) return nearest_rotation_to_any(linear);
  Eigen::Matrix3d rotation = linear;
  for (int step = 0; step < kSteps; ++step) {
    const Eigen::Matrix3d change = (rotation.inverse().transpose() - rotation) / 2;
    rotation += change;
    if (change.squaredNorm() < kConverged * kConverged) return rotation;
  }
  return nearest_rotation_to_any(linear);
}

}  // namespace sinew
