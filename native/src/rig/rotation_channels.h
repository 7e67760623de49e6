/// A rotation as the numbers that drivers and the Transformation constraint read.
#pragma once

#include "rig/rotation.h"
#include "sinew/rig_description.h"

namespace sinew::rig {

/// w x y z; Euler angles leave w 0.
///
/// order    the Euler order of ChannelRotation::automatic.
/// channel  the only number that counts, 0 to 3.
Quat rotation_channel(const Mat4& m, ChannelRotation rotation, EulerOrder order, int channel);

/// All four numbers, as angles: quaternions and swings become twice the arc cosine of w and the arc sines of x, y and z.
Quat rotation_angles(const Mat4& m, ChannelRotation rotation, EulerOrder order);

}  // namespace sinew::rig
