/// A bone's pose from its channels: location, rotation and scale.
#pragma once

#include "rig/state.h"

namespace sinew::rig {

/// channels  kLocation to kScale + 2.
Mat3 rotation_of(const float* channels, RotationMode mode);
Mat4 channel_matrix(const float* channels, RotationMode mode, bool has_location);

/// The matrix of the bone's channels in this frame.
Mat4 channels_of(const Program& program, const State& state, int bone);

/// Computes a bone, its parent and all that it depends on being done: channels, parent, then constraints other than IK.
void pose_bone(const Program& program, State& state, int bone);

/// Notes where a bone whose pose has changed ends.
void update_tail(const Program& program, State& state, int bone);

/// A bone's pose relative to its rest; computed once in a frame.
const Mat4& channel_of(const Program& program, State& state, int bone);

}  // namespace sinew::rig
