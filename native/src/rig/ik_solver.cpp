#include "rig/ik_solver.h"

#include <algorithm>
#include <cmath>

#include "rig/ik_rotation.h"

// The order of operations is that of Blender's intern/iksolver, since each of them rounds.

namespace sinew::rig {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// A solve ends when nothing moves farther, but not before this many iterations.
constexpr double kStill = 1e-3;
constexpr int kLeastIterations = 12;

Vector3d unit(const Vector3d& v) {
  const double length = v.norm();
  return is_ik_zero(length) ? Vector3d(0, 0, 0) : Vector3d(v / length);
}

/// Rows: to the right of `direction` and `up`, above, and back.
Matrix3d view(const Vector3d& direction, const Vector3d& up) {
  Matrix3d m;
  m.row(0) = unit(direction.cross(up));
  m.row(1) = m.row(0).cross(direction);
  m.row(2) = -direction;
  return m;
}

}  // namespace

void IkSolver::reserve(std::size_t joints, std::size_t tasks) {
  joints_.reserve(joints);
  order_.reserve(joints);
  tasks_.reserve(tasks);
  constexpr std::size_t kMostAxes = 3;
  system_.reserve(3 * tasks, kMostAxes * joints);
}

void IkSolver::clear() {
  joints_.clear();
  order_.clear();
  tasks_.clear();
  root_ = Eigen::Affine3d::Identity();
  has_pole_ = false;
}

int IkSolver::add_joint(JointKind kind, int axis, int dofs, int parent) {
  const int number = static_cast<int>(joints_.size());
  joints_.emplace_back(kind, axis, dofs, parent);
  if (parent >= 0) {
    joints_[number].next_sibling = joints_[parent].first_child;
    joints_[parent].first_child = number;
  }
  return number;
}

void IkSolver::add_position(int joint, const Vector3d& goal, double weight) {
  double reach = 0;
  int count = 0;
  for (int j = joint; j >= 0; j = joints_[j].parent, ++count) reach += joints_[j].reach;
  reach /= 2 * count;
  tasks_.push_back({true, joint, std::sqrt(weight), reach, goal, Matrix3d::Zero()});
}

void IkSolver::add_rotation(int joint, const Matrix3d& goal, double weight) {
  tasks_.push_back({false, joint, std::sqrt(weight), 0, Vector3d::Zero(), goal});
}

void IkSolver::number(int joint) {
  order_.push_back(joint);
  for (int child = joints_[joint].first_child; child >= 0; child = joints_[child].next_sibling) number(child);
}

/// Returns whether there is anything to solve.
bool IkSolver::prepare(bool eigen_5) {
  number(0);
  int dofs = 0;
  for (const int j : order_) {
    joints_[j].first_dof = dofs;
    dofs += joints_[j].dofs;
  }
  double sum = 0;
  for (const Task& task : tasks_) sum += task.weight * task.weight;
  if (dofs == 0 || tasks_.empty() || is_ik_zero(sum)) return false;
  const double factor = 1.0 / sum;
  for (Task& task : tasks_) task.weight = std::sqrt(task.weight * task.weight * factor);
  system_.reset(3 * static_cast<int>(tasks_.size()), dofs, eigen_5);
  for (const IkJoint& joint : joints_) {
    for (int i = 0; i < joint.dofs; ++i) system_.set_weight(joint.first_dof + i, joint.weight(i));
  }
  return true;
}

void IkSolver::scale(double factor) {
  for (Task& task : tasks_) {
    task.position *= factor;
    task.reach *= factor;
  }
  for (IkJoint& joint : joints_) joint.scale(factor);
  root_.translation() *= factor;
  pole_.goal *= factor;
  pole_.at *= factor;
}

void IkSolver::update(int joint, const Eigen::Affine3d& parent_end) {
  joints_[joint].update(parent_end);
  for (int child = joints_[joint].first_child; child >= 0; child = joints_[child].next_sibling) {
    update(child, joints_[joint].end);
  }
}

void IkSolver::turn_to_pole() {
  // With several positions Blender ignores the pole.
  has_pole_ = has_pole_ && std::ranges::count(tasks_, true, &Task::is_position) < 2;
  if (!has_pole_) return;
  update(0, root_);
  const Vector3d from = joints_[0].head, to = joints_[pole_.tip].end.translation();
  const Matrix3d basis = joints_[0].end.linear();
  const Vector3d direction = unit(to - from), x = basis.col(0), z = basis.col(2);
  const Vector3d up = x * std::cos(pole_.angle) + z * std::sin(pole_.angle);
  const Matrix3d now = view(direction, up), wanted = view(unit(pole_.goal - from), unit(pole_.at - from));
  Eigen::Affine3d turn;
  turn.linear() = wanted.transpose() * now;
  turn.translation() = Vector3d(0, 0, 0);
  root_ = turn * root_;
}

void IkSolver::linearise(const Task& task, int row) {
  const IkJoint& tip = joints_[task.joint];
  const Vector3d at = tip.end.translation();
  Vector3d missing;
  if (task.is_position) {
    missing = task.position - at;
    const double distance = missing.norm();
    if (distance > task.reach) missing = (task.reach / distance) * missing;
  } else {
    const Matrix3d& present = tip.end.linear();
    const Matrix3d e = (task.rotation * present.transpose()).transpose();
    missing = -0.5 * Vector3d(e(2, 1) - e(1, 2), e(0, 2) - e(2, 0), e(1, 0) - e(0, 1));
  }
  system_.set_residual(row, task.weight * missing);
  for (int j = task.joint; j >= 0; j = joints_[j].parent) {
    const IkJoint& joint = joints_[j];
    const bool is_slide = joint.kind == JointKind::slide;
    const Vector3d arm = joint.head - at;
    for (int i = 0; i < joint.dofs; ++i) {
      const Vector3d axis = joint.axis_of(i) * task.weight;
      Vector3d column = axis;
      if (task.is_position && !is_slide) column = arm.cross(axis);
      if (!task.is_position && is_slide) column.setZero();
      system_.set_column(row, joint.first_dof + i, column, is_slide);
    }
  }
}

/// Makes the step unless a limit is in the way. Then the joint that is nearest to its limit is held there, together with
/// those that are at theirs, and the system has to be solved again.
bool IkSolver::step_is_complete() {
  int nearest_joint = -1, nearest_dof = 0;
  double nearest = 1e10;
  Vector3d nearest_moved(0, 0, 0);
  bool is_complete = true;
  for (const int j : order_) {
    IkJoint& joint = joints_[j];
    const IkJoint::Hit hit = joint.try_step(system_);
    if (!hit.any()) continue;
    for (int i = 0; i < joint.dofs; ++i) {
      if (!hit.dofs[i] || joint.is_held(i)) continue;
      const double distance = std::fabs(hit.moved[i]);
      if (is_ik_zero(distance)) {
        joint.hold(i, system_, hit.moved);
        is_complete = false;
      } else if (distance < nearest) {
        nearest = distance;
        nearest_moved = hit.moved;
        nearest_joint = j;
        nearest_dof = i;
      }
    }
  }
  if (nearest_joint >= 0) {
    joints_[nearest_joint].hold(nearest_dof, system_, nearest_moved);
    is_complete = false;
    moved_ = std::max(moved_, nearest);
  }
  if (is_complete) {
    for (IkJoint& joint : joints_) joint.accept();
  }
  return is_complete;
}

void IkSolver::begin(int iterations, bool eigen_5) {
  iterations_left_ = 0;
  if (!prepare(eigen_5)) return;
  double size = 0;
  for (const int j : order_) size += joints_[j].reach;
  factor_ = static_cast<float>(size == 0 ? 1.0 : 1.0 / size);
  scale(factor_);
  turn_to_pole();
  iterations_left_ = iterations;
  iteration_ = 0;
  is_half_ = false;
  if (iterations == 0) finish();
}

DampedLeastSquares* IkSolver::next_system() {
  if (iterations_left_ == 0) return nullptr;
  if (!is_half_) {
    update(0, root_);
    for (std::size_t t = 0; t < tasks_.size(); ++t) linearise(tasks_[t], 3 * static_cast<int>(t));
    moved_ = 0;
  }
  return &system_;
}

void IkSolver::make_step() {
  is_half_ = !step_is_complete();
  if (is_half_) return;
  for (IkJoint& joint : joints_) joint.release();
  ++iteration_;
  --iterations_left_;
  const bool is_still = std::max(moved_, system_.largest_step()) < kStill && iteration_ >= kLeastIterations;
  if (is_still) iterations_left_ = 0;
  if (iterations_left_ == 0) finish();
}

void IkSolver::finish() {
  if (has_pole_) {
    IkJoint& root = joints_[0];
    root.basis = root.rest.inverse() * root_.linear() * root.rest * root.basis;
  }
  scale(1.0f / factor_);
}

}  // namespace sinew::rig
