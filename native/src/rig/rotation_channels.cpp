#include "rig/rotation_channels.h"

namespace sinew::rig {
namespace {

constexpr int kAllChannels = -1;

float as_angle(const Quat& q, int channel) { return 2.0F * (channel == 0 ? safe_acos(q[0]) : safe_asin(q[channel])); }

Quat as_angles(Quat q, int channel) {
  if (channel != kAllChannels) {
    q[channel] = as_angle(q, channel);
    return q;
  }
  return {as_angle(q, 0), as_angle(q, 1), as_angle(q, 2), as_angle(q, 3)};
}

Quat channels(const Mat4& m, ChannelRotation rotation, EulerOrder order, int channel, bool has_angles) {
  if (rotation < ChannelRotation::quaternion) {
    const Vec3 euler = euler_of(m, rotation == ChannelRotation::automatic ? order : static_cast<EulerOrder>(rotation));
    return {0, euler[0], euler[1], euler[2]};
  }
  const Quat q = quaternion_of(m);
  if (rotation == ChannelRotation::quaternion) return has_angles ? as_angles(q, channel) : q;
  const int axis = static_cast<int>(rotation) - static_cast<int>(ChannelRotation::swing_twist_x);
  if (channel == axis + 1) {
    Quat only{};
    only[channel] = twist_of(q, axis);
    return only;
  }
  const SwingTwist parts = swing_twist(q, axis);
  Quat swing = as_angles(parts.swing, channel);
  swing[axis + 1] = parts.twist;
  return swing;
}

}  // namespace

Quat rotation_channel(const Mat4& m, ChannelRotation rotation, EulerOrder order, int channel) {
  return channels(m, rotation, order, channel, false);
}

Quat rotation_angles(const Mat4& m, ChannelRotation rotation, EulerOrder order) {
  return channels(m, rotation, order, kAllChannels, true);
}

}  // namespace sinew::rig
