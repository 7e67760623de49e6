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
Matrix4<double> world_of(std::span<const std::int32_t> parents, const Matrices& rest, const Matrices& local,
                         std::int32_t j);

Matrices forward_kinematics(std::span<const std::int32_t> parents, const Matrices& rest, const Matrices& local);

/// V x J. What nothing moves has a row of zeros.
Eigen::MatrixXd dense_weights(const Skin& skin);

Eigen::Vector3d rest_position(const Skin& skin, std::ptrdiff_t v);

bool is_moved(const Skin& skin, std::ptrdiff_t v);

/// v' = sum over ALL joints of w_j M_j v.
Eigen::MatrixX3d skin_linear(const Skin& skin, const Matrices& matrices);

struct DualQuaternion {
  Eigen::Quaterniond real{0, 0, 0, 0};
  Eigen::Quaterniond dual{0, 0, 0, 0};
  Eigen::Matrix3d stretch;
};

/// M = (rotation, translation) * stretch, the stretch being the root of M^T M. A mirrored matrix
/// mirrors along the direction in which it stretches least.
DualQuaternion dual_quaternion(const Matrix4<double>& matrix);

std::vector<DualQuaternion> dual_quaternions(const Matrices& matrices);

/// Kavan 2008 with signs against the running sum, in the stored order of the influences.
Eigen::MatrixX3d skin_dual_quaternion(const Skin& skin, const Matrices& matrices);

/// A joint's motion split along its rest frame: rotation and translation after the stretch, an affine matrix. The frame
/// keeps the direction of its Y, and its Z at right angles to its X.
struct FrameMotion {
  Eigen::Quaterniond rotation;
  Eigen::Vector3d translation;
  Matrix4<double> stretch;
};

FrameMotion frame_motion(const Matrix4<double>& matrix, const Matrix4<double>& rest);

/// Blended stretches first, or, with `each`, each joint moving the point that it has stretched itself.
Eigen::MatrixX3d skin_dual_quaternion_in_frames(const Skin& skin, const Matrices& matrices, const Matrices& rest_frames,
                                                bool each);

/// R S (v - p) + sum_j w_j M_j p with signs against the running sum; linear where there is no p.
/// centers  V x 3.
Eigen::MatrixX3d skin_rotation_centers(const Skin& skin, const Matrices& matrices, const Eigen::MatrixX3d& centers);

/// The formula, over all triangles and all pairs of joints. faces: vertices around each, a fan.
Eigen::MatrixX3d rotation_centers(const Skin& skin, const std::vector<std::vector<std::int32_t>>& faces, double sigma);

}  // namespace sinew::reference
