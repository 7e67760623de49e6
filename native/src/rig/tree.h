/// Bones that IK moves together.
#pragma once

#include <span>

#include "rig/state.h"

namespace sinew::rig {

/// Computes all bones of trees that do not need each other: as without IK, then what IK makes of them.
void solve_trees(const Program& program, State& state, std::span<const Operation> trees);

}  // namespace sinew::rig
