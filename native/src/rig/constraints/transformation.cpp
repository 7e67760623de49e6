#include "rig/constraints/kind.h"
#include "rig/rotation_channels.h"

namespace sinew::rig {
namespace transformation {
namespace {

// Ranges are minimum and maximum of X, Y and Z, of the source and of the result.
enum Setting : int {
  kFrom = kCommonValueCount,
  kTo,
  kSource,
  kExtrapolate = kSource + 3,
  kFromRotation,
  kOrder,
  kMixLocation,
  kMixRotation,
  kMixScale,
  kRanges,
};
constexpr int kRangeCount = 12;
enum Channels : int { kLocations, kRotations, kScales };
enum class RotationMix { add, replace, before, after };

constexpr auto kSettings = settings_with(
    choice_setting("map_from", 2), choice_setting("map_to", 2), choice_setting("map_to_x_from", 2),
    choice_setting("map_to_y_from", 2), choice_setting("map_to_z_from", 2), flag_setting("use_motion_extrapolate"),
    choice_setting("from_rotation_mode", 10), choice_setting("to_euler_order", 6), choice_setting("mix_mode", 1),
    choice_setting("mix_mode_rot", 3), choice_setting("mix_mode_scale", 1),
    // Locations.
    real_setting("from_min_x"), real_setting("from_min_y"), real_setting("from_min_z"), real_setting("from_max_x"),
    real_setting("from_max_y"), real_setting("from_max_z"), real_setting("to_min_x"), real_setting("to_min_y"),
    real_setting("to_min_z"), real_setting("to_max_x"), real_setting("to_max_y"), real_setting("to_max_z"),
    // Rotations.
    real_setting("from_min_x_rot"), real_setting("from_min_y_rot"), real_setting("from_min_z_rot"),
    real_setting("from_max_x_rot"), real_setting("from_max_y_rot"), real_setting("from_max_z_rot"),
    real_setting("to_min_x_rot"), real_setting("to_min_y_rot"), real_setting("to_min_z_rot"),
    real_setting("to_max_x_rot"), real_setting("to_max_y_rot"), real_setting("to_max_z_rot"),
    // Scales.
    real_setting("from_min_x_scale"), real_setting("from_min_y_scale"), real_setting("from_min_z_scale"),
    real_setting("from_max_x_scale"), real_setting("from_max_y_scale"), real_setting("from_max_z_scale"),
    real_setting("to_min_x_scale"), real_setting("to_min_y_scale"), real_setting("to_min_z_scale"),
    real_setting("to_max_x_scale"), real_setting("to_max_y_scale"), real_setting("to_max_z_scale"));

Vec3 source_of(const Acting& acting, const Mat4& target, int from) {
  if (from == kScales) {
    const Vec3 sizes = sizes_of(target);
    return determinant(upper(target)) < 0 ? -sizes : sizes;
  }
  if (from == kRotations) {
    const auto mode = static_cast<ChannelRotation>(acting.choice(kFromRotation, 11));
    const Quat angles = rotation_angles(target, mode, acting.bone().order());
    return {angles[1], angles[2], angles[3]};
  }
  return target.location();
}

/// How far each axis is from its minimum to its maximum.
Vec3 shares_of(const Acting& acting, const Vec3& source, int range) {
  Vec3 shares;
  for (int k = 0; k < 3; ++k) {
    const float low = acting.number(range + k);
    const float high = acting.number(range + 3 + k);
    const float value = acting.flag(kExtrapolate) ? source[k] : clamped(source[k], low, high);
    shares[k] = high - low != 0 ? (value - low) / (high - low) : 0.0F;
  }
  return shares;
}

Mat3 mixed_rotation(const Acting& acting, const Mat3& rotation, const Vec3& angles) {
  const EulerOrder order = acting.order(kOrder);
  switch (static_cast<RotationMix>(acting.choice(kMixRotation, 4))) {
    case RotationMix::replace:
      return matrix_of(angles, order);
    case RotationMix::before:
      return matrix_of(angles, order) * rotation;
    case RotationMix::after:
      return rotation * matrix_of(angles, order);
    default:
      return matrix_of(angles + euler_of_unit(unit_columns(rotation), order), order);
  }
}

void apply(const Acting& acting, Mat4& owner) {
  const std::optional<Mat4> target = acting.target();
  if (!target) return;
  const int from = acting.choice(kFrom, 3);
  const int to = acting.choice(kTo, 3);
  const Vec3 shares = shares_of(acting, source_of(acting, *target, from), kRanges + from * kRangeCount);
  const int range = kRanges + to * kRangeCount + 6;
  Vec3 out;
  for (int k = 0; k < 3; ++k) {
    const float low = acting.number(range + k);
    const float high = acting.number(range + 3 + k);
    out[k] = low + shares[acting.choice(kSource + k, 3)] * (high - low);
  }
  Parts parts = decomposed(owner);
  if (to == kScales) {
    parts.size = acting.flag(kMixScale) ? parts.size * out : out;
  } else if (to == kRotations) {
    parts.rotation = mixed_rotation(acting, parts.rotation, out);
  } else {
    parts.location = acting.flag(kMixLocation) ? out : parts.location + out;
  }
  owner = composed(parts);
}

}  // namespace
}  // namespace transformation

const ConstraintKind kTransformation = {"TRANSFORM", transformation::kSettings, &transformation::apply};

}  // namespace sinew::rig
