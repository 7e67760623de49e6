/// Bones that IK moves together.
#pragma once

#include "rig/state.h"

namespace sinew::rig {

/// Computes all bones of a tree: as without IK, then what IK makes of them.
void solve_tree(const Program& program, State& state, int tree);

}  // namespace sinew::rig
