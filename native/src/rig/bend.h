/// B-bones: the segments into which a bone bends.
#pragma once

#include "rig/state.h"

namespace sinew::rig {

/// The place at a share of a B-bone's length; 0 is its head.
Place place_along(int segments, float along);

/// The place that a point of armature space has along a B-bone at rest.
Place place_of_point(const Bone& bone, const RestShape& shape, const Vec3& point);

/// Computes a B-bone's segments in this frame, and those of its rest shape if its settings have changed.
void bend_bone(const Program& program, State& state, int bone);

}  // namespace sinew::rig
