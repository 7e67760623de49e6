#include "rig/constraints/kind.h"

namespace sinew::rig {
namespace track_to {
namespace {

enum Setting : int { kTrackAxis = kCommonValueCount, kUpAxis, kTargetUp };

constexpr auto kSettings =
    settings_with(choice_setting("track_axis", 5), choice_setting("up_axis", 2), flag_setting("use_target_z"));

/// Axes of which `track` looks along a direction and `up` is as near to `upwards` as that allows.
Mat3 tracking_axes(const Vec3& direction, const Vec3& upwards, int track, int up) {
  const Direction projection = normalized(upwards - projected(upwards, direction));
  const Vec3 raised = projection.length == 0 ? Vec3{0, 1, 0} : projection.unit;
  const Vec3 right = normalized(cross(raised, direction)).unit;
  const int step = track - up;
  Mat3 axes;
  axes[3 - track - up] = right * (step == 1 || step == -2 ? 1.0F : -1.0F);
  axes[up] = raised;
  axes[track] = direction;
  return axes;
}

void apply(const Acting& acting, Mat4& owner) {
  const std::optional<Mat4> target = acting.target();
  if (!target) return;
  const Vec3 sizes = sizes_of(owner);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) owner[i][k] = i == k ? sizes[i] : 0;
  }
  const Direction away = normalized(owner.location() - target->location());
  const int chosen = acting.choice(kTrackAxis, 6);
  const int up = acting.choice(kUpAxis, 3);
  const Vec3 direction = away.length == 0 ? Vec3{0, 0, 1} : away.unit;
  const Vec3 upwards = acting.flag(kTargetUp) ? target->axis(2) : Vec3{0, 0, 1};
  const int track = chosen % 3;
  if (track == up) return;
  owner = rotated(tracking_axes(chosen > 2 ? direction : -direction, upwards, track, up), owner);
}

}  // namespace
}  // namespace track_to

const ConstraintKind kTrackTo = {"TRACK_TO", track_to::kSettings, &track_to::apply};

}  // namespace sinew::rig
