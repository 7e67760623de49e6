/// Spline IK: a chain of bones that lies along a curve.
#pragma once

#include "rig/state.h"

namespace sinew::rig {

/// Computes all bones of a chain: as without Spline IK, then what the curve makes of them.
void follow_spline(const Program& program, State& state, const Chain& chain);

}  // namespace sinew::rig
