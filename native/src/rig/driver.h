/// Drivers: what their variables read, and what they make of it.
#pragma once

#include <memory>
#include <span>

#include "rig/expression.h"
#include "rig/fcurve.h"
#include "rig/rotation.h"
#include "sinew/rig_description.h"

namespace sinew::rig {

/// The formula of a driver, from its variables' values to what its property is given. Immutable.
class Driver {
 public:
  struct Result {
    float value = 0;
    bool is_undefined = false;  ///< see Expression::Result
  };

  /// Throws InputError for expressions and curves that are not covered.
  explicit Driver(const DriverDescription& data);

  /// variables  in their order. time  in frames.
  Result value(std::span<const float> variables, float time) const;

 private:
  Result combined(std::span<const float> variables, float time) const;

  DriverType type_;
  Expression expression_;
  std::shared_ptr<const FCurve> curve_;  // null: none, as of nearly all
};

/// What a transform variable reads of an object.
struct ReadTransform {
  TransformChannel channel;
  ChannelRotation rotation;
};

/// Returns a channel of a matrix.
///
/// order      the Euler order of ChannelRotation::automatic: the target's own, or XYZ for other rotation modes.
/// own_euler  the target's Euler angles if its rotation mode is Euler, otherwise null; automatic angles are near them.
float transform_channel(const Mat4& m, const ReadTransform& read, EulerOrder order, const Vec3* own_euler);

/// Returns the angle between two rotations, 0 to pi.
float rotation_difference(const Mat4& a, const Mat4& b);

}  // namespace sinew::rig
