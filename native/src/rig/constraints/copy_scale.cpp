#include "rig/constraints/kind.h"

namespace sinew::rig {
namespace copy_scale {
namespace {

enum Setting : int { kUse = kCommonValueCount, kPower = kUse + 3, kUniform, kOffset, kAdd };

constexpr auto kSettings =
    settings_with(flag_setting("use_x"), flag_setting("use_y"), flag_setting("use_z"), real_setting("power", 1),
                  flag_setting("use_make_uniform"), flag_setting("use_offset"), flag_setting("use_add"));

/// The cube root of the volume; only of the axes in use if that is not all.
float uniform_scale(const Acting& acting, const Mat4& target) {
  if (acting.flag(kUse, 0) && acting.flag(kUse, 1) && acting.flag(kUse, 2)) {
    return std::cbrt(std::fabs(determinant(upper(target))));
  }
  const Vec3 sizes = sizes_of(target);
  float product = 1;
  for (int k = 0; k < 3; ++k) {
    if (acting.flag(kUse, k)) product *= sizes[k];
  }
  return std::cbrt(product);
}

void apply(const Acting& acting, Mat4& owner) {
  const std::optional<Mat4> target = acting.target();
  if (!target) return;
  const bool is_uniform = acting.flag(kUniform);
  const Vec3 old = sizes_of(owner);
  Vec3 sizes = is_uniform ? Vec3{1, 1, 1} * uniform_scale(acting, *target) : sizes_of(*target);
  for (float& size : sizes.v) size = std::pow(size, acting.number(kPower));
  if (acting.flag(kOffset)) sizes = acting.flag(kAdd) ? (sizes + old) + Vec3{-1, -1, -1} : sizes * old;
  for (int k = 0; k < 3; ++k) {
    if ((acting.flag(kUse, k) || is_uniform) && old[k] != 0) owner.scale_axis(k, sizes[k] / old[k]);
  }
}

}  // namespace
}  // namespace copy_scale

const ConstraintKind kCopyScale = {"COPY_SCALE", copy_scale::kSettings, &copy_scale::apply};

}  // namespace sinew::rig
