#include "rig/constraints/limits.h"

namespace sinew::rig {
namespace limit_scale {
namespace {

constexpr auto kSettings = limit_settings(1000);

void apply(const Acting& acting, Mat4& owner) {
  const Vec3 old = sizes_of(owner);
  for (int k = 0; k < 3; ++k) {
    if (old[k] != 0) owner.scale_axis(k, limited(acting, k, old[k]) / old[k]);
  }
}

}  // namespace
}  // namespace limit_scale

const ConstraintKind kLimitScale = {"LIMIT_SCALE", limit_scale::kSettings, &limit_scale::apply};

}  // namespace sinew::rig
