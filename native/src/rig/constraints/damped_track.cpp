#include "rig/constraints/damped_track.h"

#include <cfloat>
#include <numbers>

#include "rig/constraints/kind.h"

namespace sinew::rig {

void turn_axis_to(Mat4& m, const Vec3& direction, int axis) {
  static constexpr Vec3 kAxes[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
  const Direction to = normalized(direction);
  if (to.length == 0) return;
  const Direction tracked = normalized(transformed_direction(m, kAxes[axis]));
  const Vec3 from = tracked.length == 0 ? kAxes[axis] : tracked.unit;

  Direction turn = normalized(precise_cross(from, to.unit));
  float angle = safe_acos(dot(from, to.unit));
  if (turn.length < FLT_EPSILON) {
    if (std::fabs(angle) < std::numbers::pi - 0.01F) return;
    // The opposite direction: half a turn about another axis.
    angle = kPi;
    turn = normalized(cross(from, transformed_direction(m, kAxes[(axis + 1) % 6])));
    if (turn.length == 0) return;
  } else if (turn.length < 0.1F) {
    // The sine is more exact here than the cosine.
    const float small = std::asin(turn.length);
    angle = angle > std::numbers::pi / 2 ? static_cast<float>(std::numbers::pi - small) : small;
  }
  m = widened(upper(rotated(axis_rotation(turn.unit, angle), m)), m.location());
}

namespace damped_track {
namespace {

constexpr int kTrackAxis = kCommonValueCount;
constexpr auto kSettings = settings_with(choice_setting("track_axis", 5));

void apply(const Acting& acting, Mat4& owner) {
  const std::optional<Mat4> target = acting.target();
  if (target) turn_axis_to(owner, target->location() - owner.location(), acting.choice(kTrackAxis, 6));
}

}  // namespace
}  // namespace damped_track

const ConstraintKind kDampedTrack = {"DAMPED_TRACK", damped_track::kSettings, &damped_track::apply};

}  // namespace sinew::rig
