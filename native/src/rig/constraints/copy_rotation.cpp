#include "rig/constraints/kind.h"

namespace sinew::rig {
namespace copy_rotation {
namespace {

enum Setting : int { kUse = kCommonValueCount, kInvert = kUse + 3, kOrder = kInvert + 3, kMix };
enum class Mix { replace, offset, add, before, after };

constexpr auto kSettings = settings_with(flag_setting("use_x"), flag_setting("use_y"), flag_setting("use_z"),
                                         flag_setting("invert_x"), flag_setting("invert_y"), flag_setting("invert_z"),
                                         choice_setting("euler_order", 6), choice_setting("mix_mode", 4));

void apply(const Acting& acting, Mat4& owner) {
  std::optional<Mat4> target = acting.target();
  if (!target) return;
  const EulerOrder order = acting.order(kOrder);
  const auto mix = static_cast<Mix>(acting.choice(kMix, 5));
  Parts parts = decomposed(owner);
  const Vec3 old = euler_of(owner, order);
  orthogonalize_y(*target, true);
  Vec3 angles = compatible_euler_of(*target, order, old);
  const bool keeps_others = mix == Mix::replace || mix == Mix::offset;
  for (int k = 0; k < 3; ++k) {
    if (!acting.flag(kUse, k)) {
      angles[k] = keeps_others ? old[k] : 0;
      continue;
    }
    if (mix == Mix::offset) angles = rotated_euler(angles, order, k, old[k]);
    if (acting.flag(kInvert, k)) angles[k] = -angles[k];
  }
  if (mix == Mix::add) angles = angles + old;
  const Mat3 rotation = matrix_of(made_compatible(angles, old), order);
  if (mix == Mix::before) {
    parts.rotation = rotation * parts.rotation;
  } else if (mix == Mix::after) {
    parts.rotation = parts.rotation * rotation;
  } else {
    parts.rotation = rotation;
  }
  owner = composed(parts);
}

}  // namespace
}  // namespace copy_rotation

const ConstraintKind kCopyRotation = {"COPY_ROTATION", copy_rotation::kSettings, &copy_rotation::apply};

}  // namespace sinew::rig
