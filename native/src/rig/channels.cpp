#include "rig/channels.h"

#include <cstring>

#include "rig/constraints/constraint.h"
#include "rig/spaces.h"

namespace sinew::rig {

Mat3 rotation_of(const float* channels, RotationMode mode) {
  if (mode >= RotationMode::xyz) {
    const float* angles = channels + kEuler;
    return matrix_of(Vec3{angles[0], angles[1], angles[2]}, static_cast<EulerOrder>(mode));
  }
  if (mode == RotationMode::axis_angle) {
    const float* turn = channels + kAxisAngle;
    const Direction axis = normalized(Vec3{turn[1], turn[2], turn[3]});
    return axis.length == 0 ? kIdentity3 : axis_rotation(axis.unit, turn[0]);
  }
  const float* q = channels + kQuaternion;
  return matrix_of(normalized(Quat{q[0], q[1], q[2], q[3]}));
}

namespace {

/// The matrix of a bone's channels, computed again only if a channel has changed.
const KeptChannels& kept_channels(const Program& program, State& state, int index) {
  KeptChannels& kept = state.kept_channels[index];
  const Bone& bone = program.bones[index];
  const float* values = state.values.data() + bone.values;
  if (!kept.is_known || std::memcmp(kept.values.data(), values, sizeof kept.values) != 0) {
    std::memcpy(kept.values.data(), values, sizeof kept.values);
    kept.matrix = channel_matrix(values, bone.rotation_mode, !bone.is_connected);
    kept.is_identity = std::memcmp(&kept.matrix, &kIdentity4, sizeof kIdentity4) == 0;
    kept.is_known = true;
  }
  return kept;
}

}  // namespace

Mat4 channel_matrix(const float* channels, RotationMode mode, bool has_location) {
  Mat4 m = widened(rotation_of(channels, mode));
  m.scale_axes({channels[kScale], channels[kScale + 1], channels[kScale + 2]});
  if (has_location) m.set_location({channels[kLocation], channels[kLocation + 1], channels[kLocation + 2]});
  return m;
}

Mat4 channels_of(const Program& program, const State& state, int index) {
  const Bone& bone = program.bones[index];
  return channel_matrix(state.values.data() + bone.values, bone.rotation_mode, !bone.is_connected);
}

void update_tail(const Program& program, State& state, int index) {
  const Mat4& pose = state.poses[index];
  state.tails[index] = pose.location() + pose.axis(1) * program.bones[index].length;
}

const Mat4& channel_of(const Program& program, State& state, int index) {
  if (state.lazy[index].channel != state.pass) {
    state.channels[index] = state.poses[index] * program.bones[index].inverse_rest;
    state.lazy[index].channel = state.pass;
  }
  return state.channels[index];
}

void pose_bone(const Program& program, State& state, int index) {
  const Bone& bone = program.bones[index];
  const KeptChannels& channels = kept_channels(program, state, index);
  Mat4& pose = state.poses[index];
  if (bone.is_plain && bone.uses_local_location) {
    const Mat4& parent = posed_parent(program, state, index);
    pose = channels.is_identity ? parent : chained(parent, channels.matrix);
  } else {
    pose = parent_effect(program, state, index).applied_to(channels.matrix);
  }
  if (bone.has_constraints) {
    const Vec3 head = pose.location();
    Mat4 world = to_world(state, pose);
    for (int i = 0; i < bone.constraint_count; ++i) {
      apply_constraint(program, state, program.constraints[bone.first_constraint + i], world);
    }
    pose = to_pose(state, world);
    if (bone.is_connected) pose.set_location(head);
  }
  update_tail(program, state, index);
}

}  // namespace sinew::rig
