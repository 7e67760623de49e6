/// The curves of a rig as paths, each built once in a frame, and again only if it is another one.
#pragma once

#include "rig/state.h"

namespace sinew::rig {

/// The path of a spline, after all that its hooks look at.
SplinePath& path_of(const Program& program, State& state, int spline);

/// The same, with its rotations.
const SplinePath& turned_path_of(const Program& program, State& state, int spline);

}  // namespace sinew::rig
