/// Limits of the three axes, as Limit Location and Limit Scale have them.
#pragma once

#include "rig/constraints/kind.h"

namespace sinew::rig {

enum LimitSetting : int {
  kUseMinimum = kCommonValueCount,
  kUseMaximum = kUseMinimum + 3,
  kMinimum = kUseMaximum + 3,
  kMaximum = kMinimum + 3,
};

/// most  the largest limit, whatever its sign.
constexpr auto limit_settings(float most) {
  return settings_with(flag_setting("use_min_x"), flag_setting("use_min_y"), flag_setting("use_min_z"),
                       flag_setting("use_max_x"), flag_setting("use_max_y"), flag_setting("use_max_z"),
                       limited_setting("min_x", most), limited_setting("min_y", most), limited_setting("min_z", most),
                       limited_setting("max_x", most), limited_setting("max_y", most), limited_setting("max_z", most));
}

/// First against the minimum, then against the maximum.
inline float limited(const Acting& acting, int axis, float value) {
  if (acting.flag(kUseMinimum, axis) && value < acting.number(kMinimum + axis)) value = acting.number(kMinimum + axis);
  if (acting.flag(kUseMaximum, axis) && value > acting.number(kMaximum + axis)) value = acting.number(kMaximum + axis);
  return value;
}

}  // namespace sinew::rig
