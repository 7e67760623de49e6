#include <algorithm>
#include <numbers>

#include "rig/constraints/kind.h"

namespace sinew::rig {
namespace limit_rotation {
namespace {

enum Setting : int {
  kUse = kCommonValueCount,
  kMinimum = kUse + 3,
  kMaximum = kMinimum + 3,
  kOrder = kMaximum + 3,
  kLegacy
};

constexpr auto kSettings =
    settings_with(flag_setting("use_limit_x"), flag_setting("use_limit_y"), flag_setting("use_limit_z"),
                  limited_setting("min_x", 1000), limited_setting("min_y", 1000), limited_setting("min_z", 1000),
                  limited_setting("max_x", 1000), limited_setting("max_y", 1000), limited_setting("max_z", 1000),
                  choice_setting("euler_order", 6), flag_setting("use_legacy_behavior"));

/// Between minus and plus half a turn; computed in double precision and rounded twice.
float wrapped(float angle) {
  const auto turns = static_cast<float>(angle * (0.5 / std::numbers::pi) + 0.5);
  return static_cast<float>(((turns - std::floor(turns)) - 0.5) * (2.0 * std::numbers::pi));
}

/// To the nearest limit, on the shorter way round.
float limited_angle(float angle, float low, float high) {
  if ((high - low) >= (2 * std::numbers::pi)) return angle;
  if (high <= low) return low;
  const float to_low = wrapped(low - angle);
  const float to_high = wrapped(high - angle);
  if (to_low < to_high) return angle + std::min(std::max(0.0F, to_low), to_high);
  if (to_high >= 0.0F || to_low <= 0.0F) return angle;
  return std::fabs(to_high) < std::fabs(to_low) ? angle + to_high : angle + to_low;
}

/// Against the maximum first, as Blender did before 4.2.
float legacy_limited(float angle, float low, float high) { return angle > high ? high : angle < low ? low : angle; }

void apply(const Acting& acting, Mat4& owner) {
  orthogonalize_y(owner, false);
  if (!acting.flag(kUse, 0) && !acting.flag(kUse, 1) && !acting.flag(kUse, 2)) return;
  const EulerOrder order = acting.order(kOrder);
  const Vec3 sizes = sizes_of(owner);
  Vec3 angles = euler_of(owner, order);
  const auto limit = acting.flag(kLegacy) ? &legacy_limited : &limited_angle;
  for (int k = 0; k < 3; ++k) {
    if (acting.flag(kUse, k)) {
      angles[k] = limit(angles[k], acting.number(kMinimum + k), acting.number(kMaximum + k));
    }
  }
  owner = widened(matrix_of(angles, order) * upper(diagonal(sizes)), owner.location());
}

}  // namespace
}  // namespace limit_rotation

const ConstraintKind kLimitRotation = {"LIMIT_ROTATION", limit_rotation::kSettings, &limit_rotation::apply};

}  // namespace sinew::rig
