#include "rig/ik_joint.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "rig/ik_rotation.h"

// The order of operations is that of Blender's intern/iksolver, since each of them rounds.

namespace sinew::rig {

using Eigen::Matrix3d;
using Eigen::Vector3d;

void IkJoint::place(const Vector3d& start, const Matrix3d& rest_rotation, const Matrix3d& rotation, double length) {
  reach = start.norm() + length;
  start_ = start;
  rest = rest_rotation;
  first_basis_ = rotation;
  switch (kind) {
    case JointKind::fixed:
      basis.setIdentity();
      break;
    case JointKind::hinge:
      angle_ = axis == 1 ? ik_twist(rotation) : ik_euler_angle(rotation, axis);
      basis = ik_axis_rotation(axis, angle_);
      break;
    case JointKind::swing:
      basis = ik_swing(rotation);
      break;
    case JointKind::elbow:
      twist_ = ik_twist(rotation);
      angle_ = ik_euler_angle(rotation, axis);
      basis = ik_axis_rotation(axis, angle_) * ik_axis_rotation(1, twist_);
      break;
    case JointKind::ball:
    case JointKind::slide:
      basis = rotation;
  }
  shift_ = first_shift_ = Vector3d(0, length, 0);
}

void IkJoint::limit(int which, double low, double high) {
  const bool is_swing = (kind == JointKind::ball || kind == JointKind::swing) && which != 1;
  const bool is_free = kind == JointKind::ball || is_swing ||
                       ((kind == JointKind::hinge || kind == JointKind::slide) && which == axis) ||
                       (kind == JointKind::elbow && (which == axis || which == 1));
  if (!is_free || low > high) return;
  if (kind != JointKind::slide) {
    low = std::clamp(low, -std::numbers::pi, std::numbers::pi);
    high = std::clamp(high, -std::numbers::pi, std::numbers::pi);
  }
  limits_[which] = is_swing ? Limit{true, -std::sin(high * 0.5), -std::sin(low * 0.5)} : Limit{true, low, high};
}

void IkJoint::set_weight(int which, double weight) {
  switch (kind) {
    case JointKind::ball:
      weights_[which] = weight;
      break;
    case JointKind::hinge:
    case JointKind::slide:
      if (which == axis) weights_[0] = weight;
      break;
    case JointKind::swing:
      if (which != 1) weights_[which / 2] = weight;
      break;
    case JointKind::elbow:
      if (which == axis || which == 1) weights_[which == 1 ? 1 : 0] = weight;
      break;
    case JointKind::fixed:
      break;
  }
}

void IkJoint::scale(double factor) {
  start_ *= factor;
  shift_ *= factor;
  first_shift_ *= factor;
  head *= factor;
  end.translation() *= factor;
  reach *= factor;
  // Blender scales a slide's upper limit for each of the three axes, and the lower one never.
  if (kind == JointKind::slide) {
    for (int i = 0; i < 3; ++i) limits_[1].high *= factor;
  }
}

void IkJoint::update(const Eigen::Affine3d& parent_end) {
  head = parent_end.translation() + parent_end.linear() * start_;
  end.translation() = head;
  end.linear() = parent_end.linear() * rest * basis;
  end.translate(shift_);
}

Vector3d IkJoint::axis_of(int dof) const {
  switch (kind) {
    case JointKind::ball:
      return end.linear().col(dof);
    case JointKind::hinge:
    case JointKind::slide:
      return end.linear().col(axis);
    case JointKind::swing:
      return end.linear().col(dof == 0 ? 0 : 2);
    case JointKind::elbow:
      if (dof == 1) return end.linear().col(1);
      return end.linear() *
             (axis == 0 ? Vector3d(twist_cosine_, 0, twist_sine_) : Vector3d(-twist_sine_, 0, twist_cosine_));
    default:
      return Vector3d::Zero();
  }
}

bool IkJoint::Limit::clamp(double& x) const {
  if (x < low) {
    x = low;
  } else if (x > high) {
    x = high;
  } else {
    return false;
  }
  return true;
}

bool IkJoint::clamp_swing(double& x, double& z, std::array<bool, 3>& hit) const {
  if (limits_[0].is_set && limits_[2].is_set) {
    if (ik_onto_ellipse(x, z, {limits_[0].low, limits_[2].low}, {limits_[0].high, limits_[2].high})) {
      hit[0] = hit[2] = true;
    }
  } else if (limits_[0].is_set) {
    hit[0] = limits_[0].clamp(x);
  } else if (limits_[2].is_set) {
    hit[2] = limits_[2].clamp(z);
  }
  return hit[0] || hit[2];
}

void IkJoint::step_angle(const DampedLeastSquares& system, int dof, int which, double now, double& next,
                         Hit& hit) const {
  if (held_[dof]) return;
  next = now + system.step(first_dof + dof);
  const Limit& limit = limits_[which];
  if (!limit.is_set) return;
  double at = next;
  hit.dofs[dof] = limit.clamp(at);
  if (!hit.dofs[dof]) return;
  hit.moved[dof] = at - now;
  // A hinge goes as far as it moves, an elbow to its limit, which may differ by a rounding.
  next = kind == JointKind::hinge ? now + hit.moved[dof] : at;
}

void IkJoint::step_slide(const DampedLeastSquares& system, Hit& hit) {
  new_shift_ = shift_;
  if (held_[0]) {
    new_shift_[axis] = new_angle_;
    return;
  }
  new_shift_[axis] = shift_[axis] + system.step(first_dof);
  if (limits_[axis].is_set) {
    // Blender asks for the upper limit first; the two may cross (see scale).
    const Limit& limit = limits_[axis];
    double& at = new_shift_[axis];
    if (at > limit.high || at < limit.low) {
      at = at > limit.high ? limit.high : limit.low;
      hit.moved[0] = at - shift_[axis];
      hit.dofs[0] = true;
    }
  }
  new_angle_ = new_shift_[axis];
}

void IkJoint::step_swing(const DampedLeastSquares& system, Hit& hit) {
  if (held_[0] && held_[1]) return;
  const Vector3d turn(system.step(first_dof), 0.0, system.step(first_dof + 1));
  const double angle = turn.norm();
  new_basis_ = is_ik_zero(angle) ? basis : ik_swing(basis * ik_turn(turn * (1.0 / angle), angle));
  if (!limits_[0].is_set && !limits_[2].is_set) return;
  // With one limit only, Blender compares 0 with it.
  double x = 0, z = 0;
  if (limits_[0].is_set && limits_[2].is_set) {
    const IkSwingTwist now = ik_swing_twist(new_basis_);
    x = now.x;
    z = now.z;
  }
  std::array<bool, 3> is_hit{};
  if (!clamp_swing(x, z, is_hit)) return;
  hit.dofs = {is_hit[0], is_hit[2], false};
  new_basis_ = ik_swing_matrix(x, z);
  const Vector3d moved = ik_rotation_vector(basis.transpose() * new_basis_);
  hit.moved = {moved[0], moved[2], 0};
}

void IkJoint::step_ball(const DampedLeastSquares& system, Hit& hit) {
  if (held_[0] && held_[1] && held_[2]) return;
  const Vector3d turn(system.step(first_dof), system.step(first_dof + 1), system.step(first_dof + 2));
  const double angle = turn.norm();
  if (is_ik_zero(angle)) {
    new_basis_ = basis;
  } else {
    new_basis_ = basis * ik_turn(turn * (1.0 / angle), angle);
  }
  if (!limits_[0].is_set && !limits_[1].is_set && !limits_[2].is_set) return;
  const IkSwingTwist now = ik_swing_twist(new_basis_);
  double x = held_[0] ? held_at_[0] : now.x;
  double twist = held_[1] ? held_at_[1] : now.twist;
  double z = held_[2] ? held_at_[2] : now.z;
  if (limits_[1].is_set) hit.dofs[1] = limits_[1].clamp(twist);
  clamp_swing(x, z, hit.dofs);
  if (!hit.any()) {
    if (held_[0] || held_[1] || held_[2]) new_basis_ = ik_swing_matrix(x, z) * ik_axis_rotation(1, twist);
    return;
  }
  new_basis_ = ik_swing_matrix(x, z) * ik_axis_rotation(1, twist);
  hit.moved = ik_rotation_vector(basis.transpose() * new_basis_);
  if (!(held_[0] || held_[2]) && (hit.dofs[0] || hit.dofs[2])) {
    held_at_[0] = x;
    held_at_[2] = z;
  }
  if (!held_[1] && hit.dofs[1]) held_at_[1] = twist;
}

IkJoint::Hit IkJoint::try_step(const DampedLeastSquares& system) {
  Hit hit;
  switch (kind) {
    case JointKind::fixed:
      break;
    case JointKind::hinge:
      step_angle(system, 0, axis, angle_, new_angle_, hit);
      break;
    case JointKind::slide:
      step_slide(system, hit);
      break;
    case JointKind::elbow:
      step_angle(system, 0, axis, angle_, new_angle_, hit);
      step_angle(system, 1, 1, twist_, new_twist_, hit);
      break;
    case JointKind::swing:
      step_swing(system, hit);
      break;
    case JointKind::ball:
      step_ball(system, hit);
  }
  return hit;
}

void IkJoint::hold(int dof, DampedLeastSquares& system, const Vector3d& moved) {
  const auto hold_one = [&](int which) {
    held_[which] = true;
    system.fix(first_dof + which, moved[which]);
  };
  // The two directions of a swing are held together.
  if (kind == JointKind::ball && dof != 1) {
    hold_one(0);
    hold_one(2);
  } else if (kind == JointKind::swing) {
    hold_one(0);
    hold_one(1);
  } else {
    hold_one(dof);
  }
}

void IkJoint::accept() {
  switch (kind) {
    case JointKind::ball:
    case JointKind::swing:
      basis = new_basis_;
      break;
    case JointKind::hinge:
      angle_ = new_angle_;
      basis = ik_axis_rotation(axis, angle_);
      break;
    case JointKind::elbow:
      angle_ = new_angle_;
      twist_ = new_twist_;
      twist_sine_ = std::sin(twist_);
      twist_cosine_ = std::cos(twist_);
      basis = ik_axis_rotation(axis, angle_) * ik_axis_rotation(1, twist_sine_, twist_cosine_);
      break;
    case JointKind::slide:
      shift_ = new_shift_;
      break;
    case JointKind::fixed:
      break;
  }
}

}  // namespace sinew::rig
