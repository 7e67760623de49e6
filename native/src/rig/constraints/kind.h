/// Helpers for a type's table of settings.
#pragma once

#include <array>

#include "rig/constraints/constraint.h"

namespace sinew::rig {

inline constexpr float kUnlimited = 3.4e38F;

constexpr RigSetting real_setting(std::string_view name, float initial = 0, float low = -kUnlimited,
                                  float high = kUnlimited, int count = 1) {
  return {name, count, ValueKind::real, low, high, initial};
}
constexpr RigSetting limited_setting(std::string_view name, float most) { return real_setting(name, 0, -most, most); }
constexpr RigSetting flag_setting(std::string_view name) { return {name, 1, ValueKind::boolean, 0, 1, 0}; }
constexpr RigSetting whole_setting(std::string_view name, float low, float high) {
  return {name, 1, ValueKind::whole, low, high, 0};
}

/// One of 0 to `last`.
constexpr RigSetting choice_setting(std::string_view name, float last) {
  return {name, 1, ValueKind::choice, 0, last, 0};
}

/// The settings that all types have, and then a type's own.
template <class... Own>
constexpr std::array<RigSetting, kCommonValueCount + sizeof...(Own)> settings_with(const Own&... own) {
  return {{real_setting("influence", 1, 0, 1), flag_setting("mute"), flag_setting("is_valid"),
           choice_setting("owner_space", 6), choice_setting("target_space", 6), real_setting("head_tail", 0, 0, 1),
           flag_setting("use_bbone_shape"), RigSetting{"enabled", 1, ValueKind::boolean, 0, 1, 1}, own...}};
}

}  // namespace sinew::rig
