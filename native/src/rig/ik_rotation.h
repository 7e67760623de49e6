/// Rotations as inverse kinematics splits and limits them, in double precision.
#pragma once

#include <Eigen/Geometry>
#include <cmath>

namespace sinew::rig {

/// Smaller numbers count as 0.
constexpr double kIkZero = 1e-20;
inline bool is_ik_zero(double x) { return std::fabs(x) < kIkZero; }

Eigen::Matrix3d ik_axis_rotation(int axis, double sine, double cosine);
inline Eigen::Matrix3d ik_axis_rotation(int axis, double angle) {
  return ik_axis_rotation(axis, std::sin(angle), std::cos(angle));
}

/// The Euler angle about X or Z.
double ik_euler_angle(const Eigen::Matrix3d& m, int axis);

/// The rotation about Y in swing * twist, and the swing alone.
double ik_twist(const Eigen::Matrix3d& m);
Eigen::Matrix3d ik_swing(const Eigen::Matrix3d& m);

/// The swing's quaternion has the vector part -(x, 0, z).
struct IkSwingTwist {
  double x, twist, z;
};
IkSwingTwist ik_swing_twist(const Eigen::Matrix3d& m);
Eigen::Matrix3d ik_swing_matrix(double x, double z);

/// Axis times angle.
Eigen::Vector3d ik_rotation_vector(const Eigen::Matrix3d& m);

Eigen::Matrix3d ik_turn(const Eigen::Vector3d& unit_axis, double angle);

/// Moves a point onto an ellipse with different half-axes in each quarter, along the ray from the centre, unless it is
/// inside. Returns whether it was moved.
bool ik_onto_ellipse(double& x, double& z, const double (&low)[2], const double (&high)[2]);

}  // namespace sinew::rig
