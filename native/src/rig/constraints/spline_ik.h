/// The settings of a Spline IK constraint. The chain of bones that it moves is computed by spline_chain.h.
#pragma once

#include "rig/constraints/constraint.h"

namespace sinew::rig {

enum SplineIkSetting : int {
  kSplineChainLength = kCommonValueCount,
  kSplineEvenDivisions,
  kSplineChainOffset,
  kSplineCurveRadius,
  kSplineLengthMode,
  kSplineWidthMode,
  kSplineOriginalScale,
  kSplineBulge,
  kSplineBulgeLimits,
};

/// Blender's y_scale_mode and xz_scale_mode, by number.
enum class LengthMode { bone, fit_curve, pose };
enum class WidthMode { none, pose, inverse, volume };

}  // namespace sinew::rig
