#include "rig/constraints/limits.h"

namespace sinew::rig {
namespace limit_location {
namespace {

constexpr auto kSettings = limit_settings(kUnlimited);

void apply(const Acting& acting, Mat4& owner) {
  for (int k = 0; k < 3; ++k) owner[3][k] = limited(acting, k, owner[3][k]);
}

}  // namespace
}  // namespace limit_location

const ConstraintKind kLimitLocation = {"LIMIT_LOCATION", limit_location::kSettings, &limit_location::apply};

}  // namespace sinew::rig
