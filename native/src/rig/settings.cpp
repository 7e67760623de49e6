#include <algorithm>
#include <array>
#include <span>

#include "rig/constraints/constraint.h"
#include "rig/constraints/kind.h"
#include "sinew/rig_description.h"

namespace sinew {
namespace {

using rig::flag_setting;
using rig::kPi;
using rig::real_setting;

constexpr RigSetting several(std::string_view name, int count, float initial = 0) {
  return real_setting(name, initial, -rig::kUnlimited, rig::kUnlimited, count);
}

/// In the order of BendValue. ease  at rest; a pose's is added to it.
constexpr auto bend_settings(float ease) {
  return std::array{
      real_setting("bbone_curveinx"),     real_setting("bbone_curveinz"),      real_setting("bbone_curveoutx"),
      real_setting("bbone_curveoutz"),    real_setting("bbone_rollin"),        real_setting("bbone_rollout"),
      real_setting("bbone_easein", ease), real_setting("bbone_easeout", ease), several("bbone_scalein", 3, 1),
      several("bbone_scaleout", 3, 1),
  };
}

constexpr std::array kChannelSettings = {
    several("location", 3),
    several("rotation_quaternion", 4),
    several("rotation_axis_angle", 4),
    several("rotation_euler", 3),
    several("scale", 3, 1),
};

constexpr std::array kDeltaSettings = {
    several("delta_location", 3),
    several("delta_rotation_quaternion", 4),
    several("delta_rotation_axis_angle", 4),
    several("delta_rotation_euler", 3),
    several("delta_scale", 3, 1),
};

constexpr std::array kIkSettings = {
    real_setting("ik_stretch", 0, 0, 1),
    real_setting("ik_stiffness_x", 0, 0, 0.99F),
    real_setting("ik_stiffness_y", 0, 0, 0.99F),
    real_setting("ik_stiffness_z", 0, 0, 0.99F),
    real_setting("ik_min_x", -kPi, -kPi, 0),
    real_setting("ik_max_x", kPi, 0, kPi),
    real_setting("ik_min_y", -kPi, -kPi, 0),
    real_setting("ik_max_y", kPi, 0, kPi),
    real_setting("ik_min_z", -kPi, -kPi, 0),
    real_setting("ik_max_z", kPi, 0, kPi),
    flag_setting("lock_ik_x"),
    flag_setting("lock_ik_y"),
    flag_setting("lock_ik_z"),
    flag_setting("use_ik_limit_x"),
    flag_setting("use_ik_limit_y"),
    flag_setting("use_ik_limit_z"),
};

template <std::size_t... N>
constexpr auto joined(const std::array<RigSetting, N>&... parts) {
  std::array<RigSetting, (N + ...)> all{};
  auto* at = all.data();
  ((at = std::copy(parts.begin(), parts.end(), at)), ...);
  return all;
}

constexpr auto kObjectSettings = joined(kChannelSettings, kDeltaSettings);
constexpr auto kBoneSettings = joined(kChannelSettings, bend_settings(0), kIkSettings, bend_settings(1));

}  // namespace

std::span<const RigSetting> bone_settings() { return kBoneSettings; }
std::span<const RigSetting> object_settings() { return kObjectSettings; }

std::span<const RigSetting> constraint_settings(ConstraintType type) { return rig::kind_of(type).settings; }

std::string_view constraint_name(ConstraintType type) { return rig::kind_of(type).name; }

}  // namespace sinew
