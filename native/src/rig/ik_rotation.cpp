#include "rig/ik_rotation.h"

#include <cmath>
#include <numbers>

// The order of operations is that of Blender's intern/iksolver, since each of them rounds.

namespace sinew::rig {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d ik_axis_rotation(int axis, double sine, double cosine) {
  Matrix3d m = Matrix3d::Identity();
  const int i = (axis + 1) % 3, k = (axis + 2) % 3;
  m(i, i) = m(k, k) = cosine;
  m(i, k) = -sine;
  m(k, i) = sine;
  return m;
}

double ik_euler_angle(const Matrix3d& m, int axis) {
  const double t = std::sqrt(m(0, 0) * m(0, 0) + m(0, 1) * m(0, 1));
  if (t > 16.0 * kIkZero) return axis == 0 ? -std::atan2(m(1, 2), m(2, 2)) : -std::atan2(m(0, 1), m(0, 0));
  return axis == 0 ? -std::atan2(-m(2, 1), m(1, 1)) : 0.0;
}

double ik_twist(const Matrix3d& m) { return 2.0 * std::atan2(m(0, 2) - m(2, 0), m(0, 0) + m(1, 1) + m(2, 2) + 1); }

Matrix3d ik_swing(const Matrix3d& m) {
  const Matrix3d twist = ik_axis_rotation(1, ik_twist(m));
  return m * twist.transpose();
}

IkSwingTwist ik_swing_twist(const Matrix3d& m) {
  const double twist = ik_twist(m), n = 2.0 * (1.0 + m(1, 1));
  if (is_ik_zero(n)) return {0, twist, 1};
  const double factor = 1.0 / std::sqrt(n);
  return {-m(2, 1) * factor, twist, m(0, 1) * factor};
}

Matrix3d ik_swing_matrix(double x, double z) {
  const double squared = x * x + z * z;
  return Matrix3d(Eigen::Quaterniond(-std::sqrt(squared >= 1.0 ? 0.0 : 1.0 - squared), x, 0.0, z));
}

Vector3d ik_rotation_vector(const Matrix3d& m) {
  Vector3d v(m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1));
  const double cosine = (m(0, 0) + m(1, 1) + m(2, 2) - 1) / 2;
  const double angle = cosine <= -1.0 ? std::numbers::pi : cosine >= 1.0 ? 0.0 : std::acos(cosine);
  const double length = v.norm();
  if (!is_ik_zero(length)) v *= angle / length;
  return v;
}

Matrix3d ik_turn(const Vector3d& w, double angle) {
  // Rodrigues' formula.
  const double sine = std::sin(angle), cosine = std::cos(angle), rest = 1 - cosine;
  const double xs = w.x() * sine, ys = w.y() * sine, zs = w.z() * sine;
  const double xx = w.x() * w.x() * rest, xz = w.x() * w.z() * rest, zz = w.z() * w.z() * rest;
  const double xy = w.x() * w.y() * rest, yy = w.y() * w.y() * rest, yz = w.y() * w.z() * rest;
  Matrix3d m;
  m << cosine + xx, -zs + xy, ys + xz, zs + xy, cosine + yy, -xs + yz, -ys + xz, xs + yz, cosine + zz;
  return m;
}

bool ik_onto_ellipse(double& x, double& z, const double (&low)[2], const double (&high)[2]) {
  // In the quarter where both are positive.
  double px = x < 0 ? -x : x, pz = z < 0 ? -z : z;
  const double a = x < 0 ? -low[0] : high[0], b = z < 0 ? -low[1] : high[1];
  if (is_ik_zero(a) || is_ik_zero(b)) {
    if (px <= a && pz <= b) return false;
    if (px > a) px = a;
    if (pz > b) pz = b;
  } else {
    const double inverse_a = 1.0 / (a * a), inverse_b = 1.0 / (b * b);
    if (px * px * inverse_a + pz * pz * inverse_b <= 1.0) return false;
    if (is_ik_zero(px)) {
      px = 0;
      pz = b;
    } else {
      const double slope = pz / px;
      px = std::sqrt(1.0 / (inverse_a + inverse_b * slope * slope));
      pz = slope * px;
    }
  }
  x = x < 0 ? -px : px;
  z = z < 0 ? -pz : pz;
  return true;
}

}  // namespace sinew::rig
