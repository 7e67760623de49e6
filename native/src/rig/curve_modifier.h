/// Modifiers of F-curves, with the bits that Blender's fmodifier.cc computes. Cycles, which needs the keys, is in fcurve.h.
#pragma once

#include <cstdint>

#include "sinew/rig_description.h"

namespace sinew::rig {

/// As x86 converts numbers, also those that do not fit.
std::int32_t truncated(float value);

/// Throws InputError for numbers that are not finite, points of an envelope that are not in order, and a Cycles that does
/// not act everywhere.
void check_modifier(const CurveModifier& modifier);

/// The frame on which the curve is evaluated.
float modified_time(const CurveModifier& modifier, float time);

/// What becomes of the curve's value at that time.
float modified_value(const CurveModifier& modifier, float value, float time);

}  // namespace sinew::rig
