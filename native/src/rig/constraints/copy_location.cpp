#include "rig/constraints/kind.h"

namespace sinew::rig {
namespace copy_location {
namespace {

enum Setting : int { kUse = kCommonValueCount, kInvert = kUse + 3, kOffset = kInvert + 3 };

constexpr auto kSettings =
    settings_with(flag_setting("use_x"), flag_setting("use_y"), flag_setting("use_z"), flag_setting("invert_x"),
                  flag_setting("invert_y"), flag_setting("invert_z"), flag_setting("use_offset"));

void apply(const Acting& acting, Mat4& owner) {
  const std::optional<Mat4> target = acting.target();
  if (!target) return;
  const Vec3 offset = acting.flag(kOffset) ? owner.location() : Vec3{0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    if (!acting.flag(kUse, k)) continue;
    const float location = (*target)[3][k];
    owner[3][k] = (acting.flag(kInvert, k) ? -location : location) + offset[k];
  }
}

}  // namespace
}  // namespace copy_location

const ConstraintKind kCopyLocation = {"COPY_LOCATION", copy_location::kSettings, &copy_location::apply};

}  // namespace sinew::rig
