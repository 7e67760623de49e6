#include "rig/constraints/kind.h"

namespace sinew::rig {
namespace locked_track {
namespace {

enum Setting : int { kTrackAxis = kCommonValueCount, kLockAxis };

constexpr auto kSettings = settings_with(choice_setting("track_axis", 5), choice_setting("lock_axis", 2));

void apply(const Acting& acting, Mat4& owner) {
  const std::optional<Mat4> target = acting.target();
  if (!target) return;
  const int chosen = acting.choice(kTrackAxis, 6);
  const int track = chosen % 3;
  const int lock = acting.choice(kLockAxis, 3);
  Mat3 axes = kIdentity3;
  if (track != lock) {
    const Vec3 direction = target->location() - owner.location();
    const Vec3 across = normalized(direction - projected(direction, owner.axis(lock))).unit;
    const int third = 3 - track - lock;
    axes[track] = chosen > 2 ? -across : across;
    axes[lock] = normalized(owner.axis(lock)).unit;
    axes[third] = cross(axes[(third + 1) % 3], axes[(third + 2) % 3]);
  }
  Mat3 turn = axes * inverse(unit_columns(upper(owner)));
  if (determinant(turn) == 0) turn = kIdentity3;
  owner = rotated(turn, owner);
}

}  // namespace
}  // namespace locked_track

const ConstraintKind kLockedTrack = {"LOCKED_TRACK", locked_track::kSettings, &locked_track::apply};

}  // namespace sinew::rig
