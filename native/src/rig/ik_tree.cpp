#include "rig/ik_tree.h"

#include <algorithm>
#include <cmath>

#include "rig/rotation.h"

// The order of operations is that of Blender's iksolver_plugin.cc, since each of them rounds.

namespace sinew::rig {
namespace {

using Eigen::Vector3d;

Vector3d widened_vector(const Vec3& v) { return {v[0], v[1], v[2]}; }

Eigen::Matrix3d widened_matrix(const Mat3& m) {
  Eigen::Matrix3d wide;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) wide(j, i) = m[i][j];
  }
  return wide;
}

Mat3 transposed(const Mat3& m) {
  Mat3 result;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) result[i][j] = m[j][i];
  }
  return result;
}

Vec3 with_length(const Vec3& v, float wanted) {
  const float squared = dot(v, v);
  if (!(squared > 1.0e-35F)) return {0, 0, 0};
  return v * (wanted / std::sqrt(squared));
}

/// Which joint turns a bone: its kind and the axis that matters. count  of free axes.
struct Turn {
  JointKind kind;
  int axis;
  int count;
};

Turn turn_of(const IkBone& bone) {
  const bool x = !bone.is_locked[0], y = !bone.is_locked[1], z = !bone.is_locked[2];
  switch (x + y + z) {
    case 0:
      return {JointKind::fixed, 0, 0};
    case 1:
      return {JointKind::hinge, x ? 0 : y ? 1 : 2, 1};
    case 2:
      return {y ? JointKind::elbow : JointKind::swing, x ? 0 : 2, 2};
    default:
      return {JointKind::ball, 0, 3};
  }
}

double weight_of(float stiffness) {
  constexpr auto kMost = static_cast<float>(1.0 - 0.01F);
  if (stiffness > 1.0 - 0.01F) stiffness = kMost;
  return 1.0F - stiffness;
}

/// Rotation and sizes of the columns, both without a mirror.
struct Split {
  Mat3 rotation;
  Vec3 size;
};

Split split(Mat3 m) {
  Vec3 size;
  for (int i = 0; i < 3; ++i) {
    const Direction direction = normalized(m[i]);
    m[i] = direction.unit;
    size[i] = direction.length;
  }
  if (dot(cross(m[0], m[1]), m[2]) < 0) {
    for (Vec3& column : m.columns) column = -column;
    size = -size;
  }
  return {m, size};
}

/// From no change to `change`.
Mat3 blended_change(const Mat3& change, float t) {
  const Split from = split(kIdentity3), to = split(change);
  const Quat q = slerp(quaternion_of_unit(from.rotation), quaternion_of_unit(to.rotation), t);
  return matrix_of(q) * upper(diagonal(lerp(from.size, to.size, t)));
}

}  // namespace

void IkTreeSolver::add_joints(const IkTree& tree, std::span<const Mat4> pose) {
  for (std::size_t i = 0; i < tree.bones.size(); ++i) {
    const IkBone& bone = tree.bones[i];
    const bool is_stretching = tree.is_stretching && bone.stretch > 0;
    const Turn turn = turn_of(bone);
    const int above = bone.parent < 0 ? -1 : parts_[bone.parent].last();
    Part part;
    if (turn.count == 0 && is_stretching) {
      part.turn = part.slide = solver_.add_joint(JointKind::slide, 1, 1, above);
    } else {
      part.turn = solver_.add_joint(turn.kind, turn.axis, turn.count, above);
      if (is_stretching) part.slide = solver_.add_joint(JointKind::slide, 1, 1, part.turn);
    }

    const Mat3 own = unit_columns(upper(pose[i]));
    Mat3 parent = kIdentity3;
    Vec3 start{0, 0, 0};
    if (i > 0) {
      const Mat4& parent_pose = pose[bone.parent];
      parent = upper(parent_pose);
      start = pose[i].location() - (parent_pose.location() + parent_pose.axis(1) * tree.bones[bone.parent].length);
    } else if (tree.has_parent) {
      parent = upper(tree.parent);
    }
    const Mat3 from_parent = inverse(unit_columns(parent));
    const Mat3 basis = transposed(bone.rest) * (from_parent * own);
    part.length = bone.length * length(pose[i].axis(1));
    const Vector3d from_tail = widened_vector(from_parent * start);
    const bool has_own_slide = part.slide >= 0 && part.slide != part.turn;
    solver_.joint(part.turn).place(from_tail, widened_matrix(bone.rest), widened_matrix(basis),
                                   has_own_slide ? 0.0 : part.length);
    if (has_own_slide) {
      solver_.joint(part.slide)
          .place(Vector3d(0, 0, 0), Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity(), part.length);
    }
    set_limits(bone, part, is_stretching);
    parts_.push_back(part);
  }
}

void IkTreeSolver::set_limits(const IkBone& bone, const Part& part, bool is_stretching) {
  IkJoint& turn = solver_.joint(part.turn);
  for (int axis = 0; axis < 3; ++axis) {
    if (bone.is_limited[axis]) turn.limit(axis, bone.lowest[axis], bone.highest[axis]);
    if (bone.stiffness[axis] >= 0) turn.set_weight(axis, weight_of(bone.stiffness[axis]));
  }
  if (!is_stretching) return;
  IkJoint& slide = solver_.joint(part.slide);
  const float stiffness = 1.0F - bone.stretch * bone.stretch;
  if (stiffness >= 0) slide.set_weight(1, weight_of(stiffness));
  slide.limit(1, 0.001F, 1e10F);
}

void IkTreeSolver::add_goals(const IkTree& tree, std::span<const Mat4> pose) {
  Mat4 root = kIdentity4;
  if (tree.has_parent) {
    root = tree.parent;
    normalize_columns(root);
  }
  root.set_location(pose[0].location());
  const Mat4 root_from_world = inverse(tree.object * root);

  is_blended_ = false;
  result_influence_ = 1;
  for (const IkGoal& goal : tree.goals) {
    const Mat4 target = root_from_world * goal.target;
    Vec3 at = target.location();
    Mat3 rotation = unit_columns(upper(target));
    Vec3 pole{0, 0, 0};
    if (goal.has_pole) {
      Mat4 matrix = kIdentity4;
      std::ranges::copy(goal.pole, matrix[3]);
      pole = (root_from_world * matrix).location();
      // From here on the influence blends what the solver changes, not the goals.
      is_blended_ = true;
      result_influence_ = goal.influence;
    }
    if (!is_blended_ && goal.influence != 1) {
      Mat4 end = pose[goal.tip];
      end.set_location(end.location() + end.axis(1) * tree.bones[goal.tip].length);
      const Mat4 present = (root_from_world * tree.object) * end;
      const float t = goal.influence;
      const float rest = 1.0F - t;
      for (int k = 0; k < 3; ++k) at[k] = t * at[k] + rest * present[3][k];
      rotation = matrix_of(slerp(quaternion_of_unit(unit_columns(rotation)), quaternion_of(present), rest));
    }
    const int tip = parts_[goal.tip].last();
    if (goal.has_location && goal.weight != 0) {
      if (goal.has_pole) solver_.set_pole({tip, widened_vector(at), widened_vector(pole), goal.pole_angle});
      solver_.add_position(tip, widened_vector(at), goal.weight);
    }
    if (goal.has_rotation && goal.rotation_weight != 0) {
      solver_.add_rotation(tip, widened_matrix(rotation), goal.rotation_weight);
    }
  }
}

/// What the solver changed, as a rotation and a size on top of each bone.
void IkTreeSolver::read_changes(const IkTree& tree) {
  const bool is_stretching =
      std::ranges::any_of(tree.bones, [&](const IkBone& bone) { return tree.is_stretching && bone.stretch > 0; });
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Part& part = parts_[i];
    const Eigen::Matrix3d turned = solver_.joint(part.turn).change();
    Mat3 change;
    for (int column = 0; column < 3; ++column) {
      for (int row = 0; row < 3; ++row) change[column][row] = static_cast<float>(turned(row, column));
    }
    stretched_.push_back(1);
    if (is_stretching) {
      const int parent = tree.bones[i].parent;
      const float above = parent >= 0 ? stretched_[parent] : 1;
      if (part.slide >= 0) {
        const auto slid = static_cast<float>(solver_.joint(part.slide).slid());
        stretched_[i] = part.length == 0 ? 1 : (slid + part.length) / part.length;
      }
      const float factor = above == 0 ? 1 : stretched_[i] / above;
      for (Vec3& column : change.columns) column = column * factor;
    }
    if (is_blended_ && result_influence_ != 1) change = blended_change(change, result_influence_);
    changes_.push_back(change);
  }
}

void IkTreeSolver::reserve(std::size_t bones, std::size_t goals) {
  parts_.reserve(bones);
  changes_.reserve(bones);
  stretched_.reserve(bones);
  local_.reserve(bones);
  solver_.reserve(2 * bones, 2 * goals);  // a turn and a slide, a position and a rotation
}

void IkTreeSolver::begin(const IkTree& tree, std::span<const Mat4> pose) {
  solver_.clear();
  parts_.clear();
  changes_.clear();
  stretched_.clear();
  local_.clear();
  add_joints(tree, pose);
  add_goals(tree, pose);
  solver_.begin(tree.iterations, tree.blender >= 500);
}

void IkTreeSolver::move(std::span<IkTreeSolver* const> solvers, std::vector<DampedLeastSquares*>& memory) {
  for (;;) {
    memory.clear();
    for (IkTreeSolver* solver : solvers) {
      DampedLeastSquares* const system = solver->solver_.next_system();
      solver->is_moving_ = system != nullptr;
      if (system) memory.push_back(system);
    }
    if (memory.empty()) return;
    DampedLeastSquares::solve(memory);
    for (IkTreeSolver* solver : solvers) {
      if (solver->is_moving_) solver->solver_.make_step();
    }
  }
}

void IkTreeSolver::finish(const IkTree& tree, std::span<Mat4> pose) {
  read_changes(tree);

  const auto parent_of = [&](std::size_t i) -> const Mat4* {
    return i > 0 ? &pose[tree.bones[i].parent] : tree.has_parent ? &tree.parent : nullptr;
  };
  for (std::size_t i = 0; i < pose.size(); ++i) {
    const Mat4* parent = parent_of(i);
    local_.push_back(parent == nullptr ? pose[i] : inverse(*parent) * pose[i]);
  }
  for (std::size_t i = 0; i < pose.size(); ++i) {
    const Mat4* parent = parent_of(i);
    Mat4 m = parent == nullptr ? local_[i] : *parent * local_[i];
    // A bone that is scaled unevenly is changed as if it were even.
    const Vec3 size = sizes_of(m);
    m.set_axis(0, with_length(m.axis(0), size[1]));
    m.set_axis(2, with_length(m.axis(2), size[1]));
    m = m * widened(changes_[i]);
    m.set_axis(0, with_length(m.axis(0), size[0] * length(changes_[i][0])));
    m.set_axis(2, with_length(m.axis(2), size[2] * length(changes_[i][2])));
    pose[i] = m;
  }
}

}  // namespace sinew::rig
