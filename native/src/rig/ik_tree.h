/// Inverse kinematics of bones: from their poses to the solver's joints and back.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "rig/ik_solver.h"
#include "rig/matrix.h"

namespace sinew::rig {

/// The settings of a bone of a tree. Numbers of axes are in the order X Y Z, angles in radians.
struct IkBone {
  int parent = -1;    ///< in the tree; the root comes first, parents before children
  Mat3 rest;          ///< Bone.matrix
  float length = 0;   ///< Bone.length
  float stretch = 0;  ///< PoseBone.ik_stretch
  std::array<float, 3> stiffness{};
  std::array<float, 3> lowest{}, highest{};
  std::array<bool, 3> is_limited{};
  std::array<bool, 3> is_locked{};
};

/// What one IK constraint wants.
struct IkGoal {
  int tip = 0;  ///< the bone whose tail shall be at the target
  bool has_location = true;
  bool has_rotation = false;
  bool has_pole = false;
  float weight = 1;
  float rotation_weight = 1;
  float influence = 1;  ///< 0 if muted
  float pole_angle = 0;
  Mat4 target = kIdentity4;  ///< in the world
  std::array<float, 4> pole{0, 0, 0,
                            1};  ///< the pole's location in the world; the fourth number is not always exactly 1
};

struct IkTree {
  std::vector<IkBone> bones;
  std::vector<IkGoal> goals;
  int iterations = 500;
  bool is_stretching = true;
  bool has_parent = false;
  Mat4 parent = kIdentity4;  ///< the pose of the root's parent
  Mat4 object = kIdentity4;  ///< the armature object in the world
  int blender = 502;         ///< see RigDescription
};

/// Solves trees. Keeps memory only.
class IkTreeSolver {
 public:
  void reserve(std::size_t bones, std::size_t goals);

  /// Begins a solve; move() and finish() have to follow. pose  the bones' poses, in armature space.
  void begin(const IkTree& tree, std::span<const Mat4> pose);

  /// Moves the joints of several trees at the same time. memory  is used and kept.
  static void move(std::span<IkTreeSolver* const> solvers, std::vector<DampedLeastSquares*>& memory);

  /// pose  before and after.
  void finish(const IkTree& tree, std::span<Mat4> pose);

 private:
  /// What a bone became in the solver.
  struct Part {
    int turn = -1;
    int slide = -1;
    float length = 0;

    int last() const { return slide >= 0 ? slide : turn; }
  };

  void add_joints(const IkTree& tree, std::span<const Mat4> pose);
  void set_limits(const IkBone& bone, const Part& part, bool is_stretching);
  void add_goals(const IkTree& tree, std::span<const Mat4> pose);
  void read_changes(const IkTree& tree);

  IkSolver solver_;
  std::vector<Part> parts_;
  std::vector<Mat3> changes_;
  std::vector<float> stretched_;
  std::vector<Mat4> local_;
  bool is_moving_ = false;
  bool is_blended_ = false;  // the result, rather than each goal
  float result_influence_ = 1;
};

}  // namespace sinew::rig
