#include <array>

#include "rig/constraints/kind.h"

namespace sinew::rig {
namespace child_of {
namespace {

enum Setting : int { kUse = kCommonValueCount, kInverse = kUse + 9 };  // location, rotation and scale of each axis

constexpr auto kSettings =
    settings_with(flag_setting("use_location_x"), flag_setting("use_location_y"), flag_setting("use_location_z"),
                  flag_setting("use_rotation_x"), flag_setting("use_rotation_y"), flag_setting("use_rotation_z"),
                  flag_setting("use_scale_x"), flag_setting("use_scale_y"), flag_setting("use_scale_z"),
                  real_setting("inverse_matrix", 0, -kUnlimited, kUnlimited, 16));

/// A matrix without the channels that are not used.
Mat4 with_used_channels(const Acting& acting, const Mat4& m, EulerOrder order) {
  Vec3 location = m.location();
  Vec3 angles = euler_of(m, order);
  Vec3 sizes = sizes_of(m);
  for (int k = 0; k < 3; ++k) {
    if (!acting.flag(kUse, k)) location[k] = 0;
    if (!acting.flag(kUse, 3 + k)) angles[k] = 0;
    if (!acting.flag(kUse, 6 + k)) sizes[k] = 1;
  }
  return widened(matrix_of(angles, order) * upper(diagonal(sizes)), location);
}

void apply(const Acting& acting, Mat4& owner) {
  const std::optional<Mat4> target = acting.target();
  if (!target) return;
  Mat4 parent = *target;
  std::array<float, 16> numbers;
  bool uses_all = true;
  for (int i = 0; i < 16; ++i) numbers[i] = acting.number(kInverse + i);
  for (int i = 0; i < 9; ++i) uses_all = uses_all && acting.flag(kUse, i);
  Mat4 inverse = matrix_of(numbers);
  if (!uses_all) {
    const RigTarget& of = acting.constraint().targets[0];
    const bool is_bone = of.type == RigTarget::Type::bone;
    parent = with_used_channels(acting, parent, is_bone ? acting.program().bones[of.index].order() : EulerOrder::xyz);
    inverse = with_used_channels(acting, inverse, acting.bone().order());
  }
  const Vec3 old = owner.location();
  owner = (parent * inverse) * owner;
  for (int k = 0; k < 3; ++k) {
    if (!acting.flag(kUse, k)) owner[3][k] = old[k];
  }
}

}  // namespace
}  // namespace child_of

const ConstraintKind kChildOf = {"CHILD_OF", child_of::kSettings, &child_of::apply, true};

}  // namespace sinew::rig
