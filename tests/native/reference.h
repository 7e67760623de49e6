/// The oracle: slow, obvious formulas in double, with nothing in common with the library's own code
/// but Eigen.
#pragma once

#include <Eigen/Eigenvalues>
#include <vector>

#include "sinew/skin.h"
#include "sinew/types.h"

namespace sinew::reference {

using Matrices = std::vector<Matrix4<double>>;

/// F(j) = F(p(j)) R(j) T(j), by going up to the root anew for every joint.
inline Matrix4<double> world_of(std::span<const std::int32_t> parents, const Matrices& rest, const Matrices& local,
                                std::int32_t j) {
  const Matrix4<double> own = rest[j] * local[j];
  if (parents[j] < 0) return own;
  return world_of(parents, rest, local, parents[j]) * own;
}

inline Matrices forward_kinematics(std::span<const std::int32_t> parents, const Matrices& rest, const Matrices& local) {
  Matrices world;
  for (std::size_t j = 0; j < parents.size(); ++j) {
    world.push_back(world_of(parents, rest, local, static_cast<std::int32_t>(j)));
  }
  return world;
}

/// V x J. What nothing moves has a row of zeros.
inline Eigen::MatrixXd dense_weights(const Skin& skin) {
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(skin.vertex_count(), skin.joint_count());
  for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
    for (auto i = skin.offsets()[v]; i < skin.offsets()[v + 1]; ++i) {
      dense(v, skin.joints()[i]) += skin.weights()[i];
    }
  }
  return dense;
}

inline Eigen::Vector3d rest_position(const Skin& skin, std::ptrdiff_t v) {
  return Eigen::Map<const Eigen::Vector3f>(skin.rest_positions().data() + 3 * v).cast<double>();
}

inline bool is_moved(const Skin& skin, std::ptrdiff_t v) { return skin.offsets()[v] != skin.offsets()[v + 1]; }

/// v' = sum over ALL joints of w_j M_j v.
inline Eigen::MatrixX3d skin_linear(const Skin& skin, const Matrices& matrices) {
  const Eigen::MatrixXd weights = dense_weights(skin);
  Eigen::MatrixX3d positions(skin.vertex_count(), 3);
  for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
    const Eigen::Vector3d point = rest_position(skin, v);
    Eigen::Vector3d moved = is_moved(skin, v) ? Eigen::Vector3d::Zero() : point;
    for (std::ptrdiff_t j = 0; j < skin.joint_count(); ++j) {
      moved += weights(v, j) * (matrices[j] * point.homogeneous()).head<3>();
    }
    positions.row(v) = moved;
  }
  return positions;
}

struct DualQuaternion {
  Eigen::Quaterniond real{0, 0, 0, 0};
  Eigen::Quaterniond dual{0, 0, 0, 0};
  Eigen::Matrix3d stretch;
};

/// M = (rotation, translation) * stretch, the stretch being the root of M^T M. A mirrored matrix
/// mirrors along the direction in which it stretches least.
inline DualQuaternion dual_quaternion(const Matrix4<double>& matrix) {
  const Eigen::Matrix3d linear = matrix.topLeftCorner<3, 3>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(linear.transpose() * linear);
  Eigen::Vector3d lengths = eigen.eigenvalues().cwiseSqrt();  // ascending
  if (linear.determinant() < 0) lengths[0] = -lengths[0];
  const Eigen::Matrix3d& axes = eigen.eigenvectors();
  DualQuaternion result;
  result.stretch = axes * lengths.asDiagonal() * axes.transpose();
  result.real = Eigen::Quaterniond(Eigen::Matrix3d(linear * result.stretch.inverse()));
  const Eigen::Vector3d t = matrix.topRightCorner<3, 1>();
  result.dual = Eigen::Quaterniond(0, t.x(), t.y(), t.z()) * result.real;
  result.dual.coeffs() *= 0.5;
  return result;
}

/// Kavan 2008 with signs against the running sum, in the stored order of the influences.
inline Eigen::MatrixX3d skin_dual_quaternion(const Skin& skin, const Matrices& matrices) {
  Eigen::MatrixX3d positions(skin.vertex_count(), 3);
  for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
    const Eigen::Vector3d point = rest_position(skin, v);
    positions.row(v) = point;
    if (!is_moved(skin, v)) continue;
    DualQuaternion sum;
    sum.stretch.setZero();
    double weights = 0;
    for (auto i = skin.offsets()[v]; i < skin.offsets()[v + 1]; ++i) {
      const DualQuaternion joint = dual_quaternion(matrices[skin.joints()[i]]);
      const double weight = skin.weights()[i];
      const double sign = sum.real.dot(joint.real) < 0 ? -1 : 1;
      sum.real.coeffs() += sign * weight * joint.real.coeffs();
      sum.dual.coeffs() += sign * weight * joint.dual.coeffs();
      sum.stretch += weight * joint.stretch;
      weights += weight;
    }
    const double norm = sum.real.norm();
    sum.real.coeffs() /= norm;
    sum.dual.coeffs() /= norm;
    const Eigen::Vector3d translation = 2 * (sum.dual * sum.real.conjugate()).vec();
    positions.row(v) = sum.real.toRotationMatrix() * (sum.stretch * point / weights) + translation;
  }
  return positions;
}

}  // namespace sinew::reference
