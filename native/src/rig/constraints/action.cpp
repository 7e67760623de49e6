#include <numbers>

#include "rig/channels.h"
#include "rig/constraints/kind.h"
#include "rig/constraints/mix_transforms.h"

namespace sinew::rig {
namespace action {
namespace {

enum Setting : int {
  kUseTime = kCommonValueCount,
  kTime,
  kMix,
  kChannel,
  kMinimum,
  kMaximum,
  kFirstFrame,
  kLastFrame,
  kOfObject,
};
enum class Mix { after_full, after, before, before_full, after_split, before_split, replace };

// The channels are numbered 0 to 2 for rotations, 10 to 12 for scales and 20 to 22 for locations.
constexpr float kMostFrame = 1048574;
constexpr auto kSettings =
    settings_with(flag_setting("use_eval_time"), real_setting("eval_time", 0, 0, 1), choice_setting("mix_mode", 6),
                  choice_setting("transform_channel", 22), limited_setting("min", 1000), limited_setting("max", 1000),
                  whole_setting("frame_start", -kMostFrame, kMostFrame),
                  whole_setting("frame_end", -kMostFrame, kMostFrame), flag_setting("use_bone_object_action"));

/// The target's channel that decides the time. Rotations are in degrees.
float control_of(const Acting& acting, const Mat4& target) {
  const int channel = acting.choice(kChannel, 23);
  const int axis = channel % 10 < 3 ? channel % 10 : 0;
  if (channel >= 20) return target[3][axis];
  if (channel >= 10) return length(target.axis(axis));
  return euler_of(target, EulerOrder::xyz)[axis] * static_cast<float>(180.0 / std::numbers::pi);
}

/// Where between its first and its last frame the action is, or nothing without a target.
std::optional<float> share_of(const Acting& acting) {
  if (acting.flag(kUseTime)) return acting.number(kTime);
  const std::optional<Mat4> target = acting.target();
  if (!target) return std::nullopt;
  const float range = acting.number(kMaximum) - acting.number(kMinimum);
  return range == 0 ? 0 : (control_of(acting, *target) - acting.number(kMinimum)) / range;
}

void apply(const Acting& acting, Mat4& owner) {
  const std::optional<float> share = share_of(acting);
  if (!share) return;
  const float first = acting.number(kFirstFrame);
  const float time = (clamped(*share, 0, 1) * (acting.number(kLastFrame) - first)) + first;
  std::array<float, kPoseBend> channels = {};
  channels[kQuaternion] = 1;
  channels[kAxisAngle + 2] = 1;
  for (int k = 0; k < 3; ++k) channels[kScale + k] = 1;
  for (const ActionCurve& curve : acting.constraint().action) channels[curve.channel] = curve.curve.value(time);
  // Since Blender 5.0 the action does not move connected bones.
  const bool has_location = acting.program().blender < 500 || !acting.bone().is_connected;
  const Mat4 action = channel_matrix(channels.data(), acting.bone().rotation_mode, has_location);
  switch (static_cast<Mix>(acting.choice(kMix, 7))) {
    case Mix::after_full:
      owner = owner * action;
      break;
    case Mix::after:
      owner = mixed(owner, action, false);
      break;
    case Mix::before:
      owner = mixed(action, owner, false);
      break;
    case Mix::before_full:
      owner = action * owner;
      break;
    case Mix::after_split:
      owner = mixed(owner, action, true);
      break;
    case Mix::before_split:
      owner = mixed(action, owner, true);
      break;
    case Mix::replace:
      owner = action;
      break;
  }
}

}  // namespace
}  // namespace action

const ConstraintKind kAction = {"ACTION", action::kSettings, &action::apply};

}  // namespace sinew::rig
