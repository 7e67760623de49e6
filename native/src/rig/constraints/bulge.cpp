#include "rig/constraints/bulge.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sinew::rig {
namespace {

enum Limit : int { kUseMin, kUseMax, kMin, kMax, kSmooth };

}  // namespace

float limited_bulge(const Acting& acting, int first, float bulge) {
  constexpr auto kQuarterTurn = static_cast<float>(std::numbers::pi / 2);
  if (bulge > 1.0F && acting.flag(first + kUseMax)) {
    const float maximum = std::max(acting.number(first + kMax), 1.0F);
    const float hard = std::min(bulge, maximum);
    const float range = maximum - 1.0F;
    const float scale = range > 0 ? 1.0F / range : 0.0F;
    const float soft = 1.0F + range * std::atan((bulge - 1.0F) * scale) / kQuarterTurn;
    bulge = lerp(hard, soft, acting.number(first + kSmooth));
  }
  if (bulge < 1.0F && acting.flag(first + kUseMin)) {
    const float minimum = clamped(acting.number(first + kMin), 0.0F, 1.0F);
    const float hard = std::max(bulge, minimum);
    const float range = 1.0F - minimum;
    const float scale = range > 0 ? 1.0F / range : 0.0F;
    const float soft = 1.0F - range * std::atan((1.0F - bulge) * scale) / kQuarterTurn;
    bulge = lerp(hard, soft, acting.number(first + kSmooth));
  }
  return bulge;
}

}  // namespace sinew::rig
