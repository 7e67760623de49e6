#include "rig/constraints/kind.h"

namespace sinew::rig {
namespace pivot {
namespace {

enum Setting : int { kRelative = kCommonValueCount, kOffset, kRange = kOffset + 3 };

// The range is numbered from -1 in Blender: always; then negative and positive rotations about X, Y, Z.
constexpr auto kSettings =
    settings_with(flag_setting("use_relative_location"), real_setting("offset", 0, -kUnlimited, kUnlimited, 3),
                  RigSetting{"rotation_range", 1, ValueKind::choice, -1, 5, -1});

/// Whether the owner's rotation is in the range in which the constraint acts.
bool is_in_range(const Acting& acting, const Mat4& owner) {
  if (!(acting.number(kRange) >= 0)) return true;
  const int range = acting.choice(kRange, 6);
  const Vec3 angles = euler_of(owner, acting.bone().order());
  return range < 3 ? !(angles[range] > 0) : !(angles[range - 3] < 0);
}

/// The axis of a rotation, or zero for none.
Vec3 turning_axis(const Mat3& rotation) {
  const Quat q = quaternion_of_unit(rotation);
  const float half = std::acos(q[0]);
  if (half * 2.0F == 0) return {0, 0, 0};
  const float sine = std::sin(half);
  const Vec3 axis = {q[1] / sine, q[2] / sine, q[3] / sine};
  return axis == Vec3{0, 0, 0} ? Vec3{0, 1, 0} : axis;
}

void apply(const Acting& acting, Mat4& owner) {
  if (!is_in_range(acting, owner)) return;
  const Vec3 head = owner.location();
  Vec3 pivot = acting.vector(kOffset);
  if (const std::optional<Mat4> target = acting.target()) {
    pivot = target->location() + pivot;
  } else if (acting.flag(kRelative)) {
    pivot = head + pivot;
  }
  const Mat3 rotation = unit_columns(upper(owner));
  // Along the axis of its rotation the bone does not move.
  pivot = pivot - projected(pivot - head, turning_axis(rotation));
  owner.set_location(pivot + rotation * (head - pivot));
}

}  // namespace
}  // namespace pivot

const ConstraintKind kPivot = {"PIVOT", pivot::kSettings, &pivot::apply};

}  // namespace sinew::rig
