#include <numbers>

#include "rig/constraints/kind.h"
#include "rig/kept_path.h"

namespace sinew::rig {
namespace follow_path {
namespace {

enum Setting : int {
  kForwardAxis = kCommonValueCount,
  kUpAxis,
  kIsFixed,
  kOffsetFactor,
  kOffset,
  kFollowsCurve,
  kUsesRadius,
};

constexpr auto kSettings =
    settings_with(choice_setting("forward_axis", 5), choice_setting("up_axis", 2), flag_setting("use_fixed_location"),
                  real_setting("offset_factor"), real_setting("offset", 0, -1048574, 1048574),
                  flag_setting("use_curve_follow"), flag_setting("use_curve_radius"));

/// Where on the curve the bone is, as a share of its length.
float share_of(const Acting& acting, const Spline& spline) {
  if (acting.flag(kIsFixed)) return acting.number(kOffsetFactor);
  const float time = spline.time < 0 ? 0 : acting.state().values[spline.time];
  const float share = (time - acting.number(kOffset)) / spline.duration;
  return spline.stays_within && !spline.is_closed ? clamped(share, 0, 1) : share;
}

/// Turns from a curve's rotation, whose Z axis is along it, to one with other axes along it and up.
Quat with_axes(const Quat& q, int forward, int up) {
  constexpr auto kHalf = static_cast<float>(std::numbers::sqrt2 / 2);
  static constexpr Quat kForward[] = {
      {kHalf, 0, -kHalf, 0}, {0.5F, 0.5F, 0.5F, 0.5F},   {kHalf, 0, 0, kHalf},
      {kHalf, 0, kHalf, 0},  {0.5F, -0.5F, -0.5F, 0.5F}, {0, kHalf, kHalf, 0},
  };
  const Quat along = q * kForward[forward];
  const int axis = forward % 3;
  if (up == (axis == 0 ? 1 : 0)) return along;
  Quat quarter = {kHalf, 0, 0, 0};
  quarter[axis + 1] = axis == 1 ? kHalf : -kHalf;
  return along * quarter;
}

/// The identity where there is no curve any more.
Mat4 target_of(const Acting& acting, const Spline& spline) {
  const int number = acting.constraint().spline;
  const bool follows = acting.flag(kFollowsCurve);
  const SplinePath& path = follows ? turned_path_of(acting.program(), acting.state(), number)
                                   : path_of(acting.program(), acting.state(), number);
  if (!path.is_there()) return kIdentity4;
  const float share = share_of(acting, spline);
  const PathPlace place = path.at(share);
  Mat4 local = kIdentity4;
  if (follows) {
    local = widened(
        matrix_of(with_axes(path.rotation_at(share), acting.choice(kForwardAxis, 6), acting.choice(kUpAxis, 3))));
  }
  if (acting.flag(kUsesRadius)) local = diagonal({place.radius, place.radius, place.radius}) * local;
  local.set_location(place.point);
  return acting.state().outside[spline.matrix] * local;
}

void apply(const Acting& acting, Mat4& owner) {
  if (acting.constraint().spline < 0) return;
  const Spline& spline = acting.program().splines[acting.constraint().spline];
  const Vec3 sizes = sizes_of(owner);
  owner = target_of(acting, spline) * owner;
  if (acting.flag(kUsesRadius)) return;
  const Vec3 changed = sizes_of(owner);
  for (int k = 0; k < 3; ++k) {
    if (changed[k] != 0) owner.scale_axis(k, sizes[k] / changed[k]);
  }
}

}  // namespace
}  // namespace follow_path

const ConstraintKind kFollowPath = {"FOLLOW_PATH", follow_path::kSettings, &follow_path::apply};

}  // namespace sinew::rig
