#include <cfloat>

#include "rig/constraints/kind.h"

namespace sinew::rig {
namespace limit_distance {
namespace {

enum Setting : int { kDistance = kCommonValueCount, kMode };
enum class Mode { inside, outside, surface };

constexpr auto kSettings = settings_with(real_setting("distance"), choice_setting("limit_mode", 2));

bool must_move(Mode mode, float distance, float limit) {
  if (mode == Mode::inside) return distance >= limit;
  if (mode == Mode::outside) return distance <= limit;
  return std::fabs(distance - limit) >= FLT_EPSILON;
}

void apply(const Acting& acting, Mat4& owner) {
  const std::optional<Mat4> target = acting.target();
  if (!target) return;
  const Vec3 center = target->location();
  const float distance = length(center - owner.location());
  const float given = acting.number(kDistance);
  const float limit = given == 0 ? distance : given;
  if (!must_move(static_cast<Mode>(acting.choice(kMode, 3)), distance, limit)) return;
  owner.set_location(lerp(center, owner.location(), distance != 0 ? limit / distance : 1.0F));
}

}  // namespace
}  // namespace limit_distance

const ConstraintKind kLimitDistance = {"LIMIT_DISTANCE", limit_distance::kSettings, &limit_distance::apply};

}  // namespace sinew::rig
