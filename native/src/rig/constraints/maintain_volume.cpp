#include "rig/constraints/kind.h"

namespace sinew::rig {
namespace maintain_volume {
namespace {

enum Setting : int { kFreeAxis = kCommonValueCount, kMode, kVolume };
enum class Mode { strict, uniform, single_axis };

constexpr auto kSettings =
    settings_with(choice_setting("free_axis", 2), choice_setting("mode", 2), real_setting("volume", 1, 0));

void apply(const Acting& acting, Mat4& owner) {
  const Vec3 sizes = sizes_of(owner);
  const int free = acting.choice(kFreeAxis, 3);
  float volume = sizes[free];
  const auto mode = static_cast<Mode>(acting.choice(kMode, 3));
  if (mode == Mode::strict) volume = sizes[0] * sizes[1] * sizes[2];
  if (mode == Mode::uniform) volume = sizes[free] * sizes[free] * sizes[free];
  const float factor = volume != 0 ? std::sqrt(acting.number(kVolume) / volume) : 1.0F;
  for (int k = 0; k < 3; ++k) {
    if (k != free) owner.scale_axis(k, factor);
  }
}

}  // namespace
}  // namespace maintain_volume

const ConstraintKind kMaintainVolume = {"MAINTAIN_VOLUME", maintain_volume::kSettings, &maintain_volume::apply};

}  // namespace sinew::rig
