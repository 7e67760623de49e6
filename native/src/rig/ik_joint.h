/// A joint of the solver of inverse kinematics: a way to turn, or to slide along Y, with limits.
#pragma once

#include <Eigen/Geometry>
#include <array>

#include "rig/damped_least_squares.h"

namespace sinew::rig {

/// Named after the axes that are free: none, one, X and Z, Y and another one, all; a slide has no rotation.
enum class JointKind { fixed, hinge, swing, elbow, ball, slide };

/// Rotations are relative to the rest rotation. Limits and weights are numbered by axis, degrees of freedom in the order
/// of the free axes, an elbow's Y last.
class IkJoint {
 public:
  JointKind kind = JointKind::fixed;
  int axis = 0;  ///< of a hinge or slide, and the one beside Y of an elbow
  int dofs = 0;
  int first_dof = 0;  ///< in the linear system
  // In the tree; -1 is none. The newest child comes first.
  int parent = -1;
  int first_child = -1;
  int next_sibling = -1;

  Eigen::Affine3d end = Eigen::Affine3d::Identity();  ///< in the root's space
  Eigen::Vector3d head = Eigen::Vector3d::Zero();     ///< in the root's space
  Eigen::Matrix3d rest = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d basis = Eigen::Matrix3d::Identity();  ///< the present rotation
  double reach = 0;                                     ///< of the bone, with its distance from the parent's tail

  IkJoint(JointKind which, int free_axis, int dof_count, int above)
      : kind(which), axis(free_axis), dofs(dof_count), parent(above) {}

  /// start   from the parent's tail, in its space. rotation  before the solve. length  along Y.
  void place(const Eigen::Vector3d& start, const Eigen::Matrix3d& rest, const Eigen::Matrix3d& rotation, double length);

  /// Does nothing for an axis that is not free, and if low > high.
  void limit(int axis, double low, double high);
  void set_weight(int axis, double weight);
  double weight(int dof) const { return weights_[dof]; }

  /// Multiplies all lengths.
  void scale(double factor);
  void update(const Eigen::Affine3d& parent_end);

  /// The axis of a degree of freedom, in the root's space.
  Eigen::Vector3d axis_of(int dof) const;

  /// What a step would do that runs into limits.
  struct Hit {
    std::array<bool, 3> dofs{};      ///< which degrees of freedom run into one
    Eigen::Vector3d moved{0, 0, 0};  ///< how far each moves until then

    bool any() const { return dofs[0] || dofs[1] || dofs[2]; }
  };

  /// Tries the system's step.
  Hit try_step(const DampedLeastSquares& system);

  /// Moves a degree of freedom to its limit and takes it out of the system for the rest of this iteration.
  void hold(int dof, DampedLeastSquares& system, const Eigen::Vector3d& moved);
  bool is_held(int dof) const { return held_[dof]; }
  void release() { held_ = {}; }

  /// Makes the step that was tried last.
  void accept();

  /// The rotation since place().
  Eigen::Matrix3d change() const { return first_basis_.transpose() * basis; }
  double slid() const { return shift_[1] - first_shift_[1]; }

 private:
  struct Limit {
    bool is_set = false;
    double low = 0, high = 0;

    bool clamp(double& x) const;
  };

  void step_angle(const DampedLeastSquares& system, int dof, int axis, double now, double& next, Hit& hit) const;
  void step_slide(const DampedLeastSquares& system, Hit& hit);
  void step_swing(const DampedLeastSquares& system, Hit& hit);
  void step_ball(const DampedLeastSquares& system, Hit& hit);
  bool clamp_swing(double& x, double& z, std::array<bool, 3>& hit) const;

  std::array<double, 3> weights_{1, 1, 1};  // by degree of freedom
  std::array<Limit, 3> limits_;             // by axis; ball and swing: X and Z of the swing's quaternion, negated
  std::array<bool, 3> held_{};              // by degree of freedom
  std::array<double, 3> held_at_{};         // ball: where it is held
  Eigen::Vector3d start_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d shift_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d first_shift_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d first_basis_ = Eigen::Matrix3d::Identity();
  double angle_ = 0;
  double twist_ = 0;
  // Blender's elbow begins with the twist 0 in its axis, whatever it is.
  double twist_sine_ = 0, twist_cosine_ = 1;
  // What the step that was tried leads to.
  Eigen::Matrix3d new_basis_ = Eigen::Matrix3d::Identity();
  Eigen::Vector3d new_shift_ = Eigen::Vector3d::Zero();
  double new_angle_ = 0;
  double new_twist_ = 0;
};

}  // namespace sinew::rig
