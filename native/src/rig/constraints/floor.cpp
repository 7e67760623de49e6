#include "rig/constraints/kind.h"

namespace sinew::rig {
namespace floor {
namespace {

enum Setting : int { kSide = kCommonValueCount, kUseRotation, kOffset };

constexpr auto kSettings =
    settings_with(choice_setting("floor_location", 5), flag_setting("use_rotation"), real_setting("offset"));

void apply(const Acting& acting, Mat4& owner) {
  const std::optional<Mat4> target = acting.target();
  if (!target) return;
  const bool is_turned = acting.flag(kUseRotation);
  Mat4 moved = is_turned ? inverse(*target) * owner : owner;
  const int side = acting.choice(kSide, 6);
  const int axis = side % 3;
  const float floor = is_turned ? 0 : (*target)[3][axis];
  const float offset = acting.number(kOffset);
  const float bottom = moved[3][axis] - offset;
  if (!(side < 3 ? floor > bottom : bottom > floor)) return;
  moved[3][axis] = floor + offset;
  if (is_turned) {
    owner = *target * moved;
  } else {
    owner.set_location(moved.location());
  }
}

}  // namespace
}  // namespace floor

const ConstraintKind kFloor = {"FLOOR", floor::kSettings, &floor::apply};

}  // namespace sinew::rig
