/// The shortest rotation of an axis to a direction, for Damped Track and Stretch To.
#pragma once

#include "rig/matrix.h"

namespace sinew::rig {

/// axis  X Y Z, then the same backwards. The fourth row becomes 0 0 0 1.
void turn_axis_to(Mat4& m, const Vec3& direction, int axis);

}  // namespace sinew::rig
