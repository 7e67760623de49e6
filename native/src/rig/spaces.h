/// A bone's parent and the spaces that constraints and drivers work in.
#pragma once

#include "rig/state.h"

namespace sinew::rig {

/// Numbered as Blender's.
enum class Space : signed char { world = 0, local = 1, pose = 2, local_with_parent = 3, custom = 5, local_owner = 6 };

inline Space space_of(float number) {
  if (!(number >= 0 && number < 7)) return Space::world;  // NaN too
  const int chosen = static_cast<int>(number);
  return chosen == 4 ? Space::world : static_cast<Space>(chosen);
}

/// What a bone takes from its parent.
struct ParentEffect {
  Mat4 rotation_scale;
  Mat4 location;
  Vec3 scale = {1, 1, 1};  ///< applied to the axes afterwards

  Mat4 applied_to(const Mat4& local) const;
};

ParentEffect parent_effect(const Program& program, const State& state, int bone);

/// Notes a plain bone's parent matrix, which is needed for its pose and later for its spaces.
const Mat4& posed_parent(const Program& program, State& state, int bone);

/// A matrix in armature space relative to the bone's parent and rest, and back.
Mat4 to_local(const Program& program, State& state, int bone, const Mat4& pose);
Mat4 from_local(const Program& program, const State& state, int bone, const Mat4& local);

/// The bone's own matrix in local space, and the lengths of its columns; computed once in a frame.
const Mat4& local_of(const Program& program, State& state, int bone);
const Vec3& local_sizes_of(const Program& program, State& state, int bone);

inline Mat4 to_world(const State& state, const Mat4& pose) { return state.is_at_origin ? pose : state.world * pose; }
inline Mat4 to_pose(const State& state, const Mat4& world) {
  return state.is_at_origin ? world : state.inverse_world * world;
}

/// Whose matrix is converted, and for which constraint.
struct Conversion {
  int bone;            ///< -1 for an object
  int owner;           ///< the constraint's bone
  const Mat4& custom;  ///< the constraint's custom space
};

Mat4 converted(const Program& program, State& state, const Conversion& of, const Mat4& m, Space from, Space to);

}  // namespace sinew::rig
