/// Inverse kinematics of a tree of joints: repeated steps towards goals, as Blender's standard solver makes them.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "rig/damped_least_squares.h"
#include "rig/ik_joint.h"

namespace sinew::rig {

/// Memory is kept from solve to solve. Everything is in the root's space.
class IkSolver {
 public:
  void reserve(std::size_t joints, std::size_t tasks);

  /// Removes all joints and tasks.
  void clear();

  /// Adds a joint after its parent, -1 for the root. Returns its number.
  int add_joint(JointKind kind, int axis, int dofs, int parent);
  IkJoint& joint(int number) { return joints_[number]; }

  /// A joint's end shall be somewhere, or be turned in some way. weight > 0.
  void add_position(int joint, const Eigen::Vector3d& goal, double weight);
  void add_rotation(int joint, const Eigen::Matrix3d& goal, double weight);

  /// Turns the whole tree, before the first step, so that it points at the goal and its plane holds the pole.
  struct Pole {
    int tip = 0;
    Eigen::Vector3d goal, at;
#ifdef __linux__
    double angle = 0;
#else
    float angle = 0;  // only the headers of GCC's library compute the sine of Blender's float in double precision
#endif
  };
  void set_pole(const Pole& pole) {
    pole_ = pole;
    has_pole_ = true;
  }

  /// Begins to move the joints. eigen_5  see ThinSvd.
  void begin(int iterations, bool eigen_5);

  /// The linear system of the next step, or null after the last one. When it is solved, make_step() follows.
  DampedLeastSquares* next_system();
  void make_step();

 private:
  struct Task {
    bool is_position;
    int joint;
    double weight;  // its square root after prepare()
    double reach;   // of a position: no step aims farther
    Eigen::Vector3d position;
    Eigen::Matrix3d rotation;
  };

  bool prepare(bool eigen_5);
  void number(int joint);
  void scale(double factor);
  void update(int joint, const Eigen::Affine3d& parent_end);
  void turn_to_pole();
  void linearise(const Task& task, int row);
  bool step_is_complete();
  void finish();

  std::vector<IkJoint> joints_;
  std::vector<int> order_;  // depth first
  std::vector<Task> tasks_;
  Eigen::Affine3d root_ = Eigen::Affine3d::Identity();
  Pole pole_;
  bool has_pole_ = false;
  DampedLeastSquares system_;
  int iterations_left_ = 0;
  int iteration_ = 0;
  bool is_half_ = false;  // some joints are held at their limits, and the step is looked for again
  double moved_ = 0;      // in this step, the farthest way to a limit
  float factor_ = 1;
};

}  // namespace sinew::rig
