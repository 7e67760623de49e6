#include "rig/spaces.h"

namespace sinew::rig {

Mat4 ParentEffect::applied_to(const Mat4& local) const {
  Mat4 m = rotation_scale * local;
  m.set_location(transformed_point(location, local.location()));
  m.scale_axes(scale);
  return m;
}

namespace {

ParentEffect root_effect(const Bone& bone) {
  ParentEffect effect{bone.offset, bone.offset};
  if (!bone.uses_local_location) effect.location = widened(kIdentity3, bone.offset.location());
  return effect;
}

/// The parent's matrix as far as the bone inherits its rotation and scale.
Mat4 inherited(const Program& program, const Bone& bone, const Mat4& parent, Vec3& scale) {
  if (bone.inherits_rotation) {
    Mat4 m = parent;
    switch (bone.inherit_scale) {
      case InheritScale::full:
      case InheritScale::fix_shear:
        break;
      case InheritScale::aligned:
        orthogonalize_y(m, false);
        scale = normalize_columns(m);
        break;
      case InheritScale::average:
      case InheritScale::none:
        orthogonalize_y(m, true);
        break;
      case InheritScale::none_legacy:
        normalize_columns(m);
        break;
    }
    return m;
  }
  Mat4 m = program.bones[bone.parent].rest;
  if (bone.inherit_scale == InheritScale::full) {
    m.scale_axes(sizes_of(parent));
  } else if (bone.inherit_scale == InheritScale::fix_shear) {
    m.scale_axes(sizes_without_shear(parent));
  } else if (bone.inherit_scale == InheritScale::aligned) {
    scale = sizes_without_shear(parent);
  }
  return m;
}

}  // namespace

ParentEffect parent_effect(const Program& program, const State& state, int index) {
  const Bone& bone = program.bones[index];
  if (bone.parent < 0) return root_effect(bone);
  const Mat4& parent = state.poses[bone.parent];
  ParentEffect effect;
  if (bone.is_plain) {
    effect.rotation_scale = parent * bone.offset;
  } else {
    Mat4 m = inherited(program, bone, parent, effect.scale);
    if (bone.inherit_scale == InheritScale::average) {
      m.scale_axes(Vec3{1, 1, 1} * std::cbrt(std::fabs(determinant(upper(parent)))));
    }
    effect.rotation_scale = m * bone.offset;
    if (bone.inherit_scale == InheritScale::fix_shear) orthogonalize_y(effect.rotation_scale, false);
  }
  if (bone.uses_local_location) {
    effect.location = bone.is_plain ? effect.rotation_scale : parent * bone.offset;
  } else {
    effect.location = widened(kIdentity3, transformed_point(parent, bone.offset.location())) * widened(upper(parent));
  }
  return effect;
}

const Mat4& posed_parent(const Program& program, State& state, int index) {
  const Bone& bone = program.bones[index];
  state.parents[index] = bone.parent < 0 ? bone.offset : state.poses[bone.parent] * bone.offset;
  state.lazy[index].inverse = 0;
  return state.parents[index];
}

Mat4 to_local(const Program& program, State& state, int index, const Mat4& pose) {
  const Bone& bone = program.bones[index];
  if (bone.is_plain && bone.uses_local_location) {
    if (state.lazy[index].inverse != state.pass) {
      state.parent_inverses[index] = inverse(state.parents[index]);
      state.lazy[index].inverse = state.pass;
    }
    return chained(state.parent_inverses[index], pose);
  }
  ParentEffect effect = parent_effect(program, state, index);
  effect.rotation_scale = inverse(effect.rotation_scale);
  effect.location = inverse(effect.location);
  for (float& factor : effect.scale.v) factor = factor != 0 ? 1.0F / factor : factor;
  return effect.applied_to(pose);
}

Mat4 from_local(const Program& program, const State& state, int bone, const Mat4& local) {
  return parent_effect(program, state, bone).applied_to(local);
}

const Mat4& local_of(const Program& program, State& state, int bone) {
  if (state.lazy[bone].local != state.pass) {
    state.locals[bone] = to_local(program, state, bone, state.poses[bone]);
    state.lazy[bone].local = state.pass;
  }
  return state.locals[bone];
}

const Vec3& local_sizes_of(const Program& program, State& state, int bone) {
  if (state.lazy[bone].local_sizes != state.pass) {
    state.local_sizes[bone] = sizes_of(local_of(program, state, bone));
    state.lazy[bone].local_sizes = state.pass;
  }
  return state.local_sizes[bone];
}

namespace {

/// The rotation from the owner's rest to the bone's.
Mat4 rest_difference(const Program& program, const Conversion& of) {
  Mat4 m = program.bones[of.bone].rest;
  if (of.owner >= 0) m = program.bones[of.owner].inverse_rest * m;
  m.set_location({0, 0, 0});
  return m;
}

/// An object has no spaces of its own: all of them but the custom one are the world.
Mat4 converted_object(const Conversion& of, const Mat4& m, Space from, Space to) {
  if (from != Space::custom && to == Space::custom) return inverse(of.custom) * m;
  if (from == Space::custom && to != Space::custom) return of.custom * m;
  return m;
}

/// From any space to armature space.
Mat4 into_pose(const Program& program, const State& state, const Conversion& of, const Mat4& m, Space from) {
  switch (from) {
    case Space::world:
      return to_pose(state, m);
    case Space::custom:
      return to_pose(state, of.custom * m);
    case Space::local_with_parent:
      return program.bones[of.bone].rest * m;
    case Space::local:
      return from_local(program, state, of.bone, m);
    case Space::local_owner: {
      const Mat4 difference = rest_difference(program, of);
      return from_local(program, state, of.bone, (inverse(difference) * m) * difference);
    }
    default:
      return m;
  }
}

Mat4 out_of_pose(const Program& program, State& state, const Conversion& of, const Mat4& m, Space to) {
  switch (to) {
    case Space::world:
      return to_world(state, m);
    case Space::custom:
      return inverse(of.custom) * to_world(state, m);
    case Space::local_with_parent:
      return program.bones[of.bone].inverse_rest * m;
    case Space::local:
      return to_local(program, state, of.bone, m);
    case Space::local_owner: {
      const Mat4 difference = rest_difference(program, of);
      return (difference * to_local(program, state, of.bone, m)) * inverse(difference);
    }
    default:
      return m;
  }
}

}  // namespace

Mat4 converted(const Program& program, State& state, const Conversion& of, const Mat4& m, Space from, Space to) {
  if (from == to) return m;
  if (of.bone < 0) return converted_object(of, m, from, to);
  // Between the world and the custom space without a detour, which would round.
  if (from == Space::world && to == Space::custom) return inverse(of.custom) * m;
  if (from == Space::custom && to == Space::world) return of.custom * m;
  return out_of_pose(program, state, of, into_pose(program, state, of, m, from), to);
}

}  // namespace sinew::rig
