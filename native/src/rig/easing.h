/// Penner's easing functions as Blender computes them: from a value, by a change, within a duration.
#pragma once

#include "sinew/rig_description.h"

namespace sinew::rig {

/// What an easing function interpolates. Times are in frames.
struct Eased {
  float begin;
  float change;
  float duration;
  float amplitude;
  float period;
  float back;
};

/// Returns the value `time` frames after the key. `interpolation` is none of constant, linear and Bezier.
float eased(KeyInterpolation interpolation, KeyEasing easing, float time, const Eased& between);

}  // namespace sinew::rig
