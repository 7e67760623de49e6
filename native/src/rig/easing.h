/// Penner's easing functions as Blender computes them: from a value, by a change, within a duration.
#pragma once

#include "sinew/fcurve.h"

namespace sinew {

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
float eased(Interpolation interpolation, Easing easing, float time, const Eased& eased);

}  // namespace sinew
