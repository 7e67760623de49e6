/// What drivers' variables read of a rig.
#pragma once

#include "rig/state.h"

namespace sinew::rig {

float variable_value(const Program& program, State& state, const Variable& variable);

}  // namespace sinew::rig
