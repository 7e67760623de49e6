#include "rig/constraints/kind.h"
#include "rig/constraints/mix_transforms.h"

namespace sinew::rig {
namespace copy_transforms {
namespace {

enum Setting : int { kRemoveShear = kCommonValueCount, kMix };
enum class Mix { replace, before, after, before_split, after_split, before_full, after_full };

constexpr auto kSettings = settings_with(flag_setting("remove_target_shear"), choice_setting("mix_mode", 6));

void apply(const Acting& acting, Mat4& owner) {
  std::optional<Mat4> target = acting.target(true);
  if (!target) return;
  if (acting.flag(kRemoveShear)) orthogonalize_y(*target, false);
  switch (static_cast<Mix>(acting.choice(kMix, 7))) {
    case Mix::replace:
      owner = *target;
      break;
    case Mix::before:
      owner = mixed(*target, owner, false);
      break;
    case Mix::after:
      owner = mixed(owner, *target, false);
      break;
    case Mix::before_split:
      owner = mixed(*target, owner, true);
      break;
    case Mix::after_split:
      owner = mixed(owner, *target, true);
      break;
    case Mix::before_full:
      owner = *target * owner;
      break;
    case Mix::after_full:
      owner = owner * *target;
      break;
  }
}

}  // namespace
}  // namespace copy_transforms

const ConstraintKind kCopyTransforms = {"COPY_TRANSFORMS", copy_transforms::kSettings, &copy_transforms::apply};

}  // namespace sinew::rig
