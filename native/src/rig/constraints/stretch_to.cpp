#include <cmath>

#include "rig/constraints/bulge.h"
#include "rig/constraints/damped_track.h"
#include "rig/constraints/kind.h"

namespace sinew::rig {
namespace stretch_to {
namespace {

enum Setting : int {
  kVolume = kCommonValueCount,
  kKeepAxis,
  kRestLength,
  kBulge,
  kUseBulgeMin,
  kUseBulgeMax,
  kBulgeMin,
  kBulgeMax,
  kBulgeSmooth,
};
enum class Volume { xz, x, z, none };
enum class KeepAxis { x, swing, z };

constexpr auto kSettings = settings_with(
    choice_setting("volume", 3), choice_setting("keep_axis", 2), real_setting("rest_length", 0, 0, 1000),
    real_setting("bulge", 1, 0, 100), flag_setting("use_bulge_min"), flag_setting("use_bulge_max"),
    real_setting("bulge_min", 1, 0, 1), real_setting("bulge_max", 1, 1, 100), real_setting("bulge_smooth", 0, 0, 1));

Vec3 bulged(const Acting& acting, float bulge, float stretch) {
  switch (static_cast<Volume>(acting.choice(kVolume, 4))) {
    case Volume::xz:
      return {std::sqrt(bulge), stretch, std::sqrt(bulge)};
    case Volume::x:
      return {bulge, stretch, 1};
    case Volume::z:
      return {1, stretch, bulge};
    default:
      return {1, stretch, 1};
  }
}

/// Turns Y to the direction and keeps X or Z in its plane.
void turn_in_plane(Mat4& m, const Vec3& direction, KeepAxis keep) {
  const Vec3 kept = m.axis(keep == KeepAxis::x ? 0 : 2);
  m.set_axis(1, direction);
  const Vec3 normal = normalized(cross(kept, direction)).unit;
  const Vec3 turned = normalized(cross(direction, normal)).unit;
  m.set_axis(0, keep == KeepAxis::x ? turned : -normal);
  m.set_axis(2, keep == KeepAxis::x ? normal : turned);
}

void apply(const Acting& acting, Mat4& owner) {
  const std::optional<Mat4> target = acting.target();
  if (!target) return;
  const auto keep = static_cast<KeepAxis>(acting.choice(kKeepAxis, 3));
  if (keep == KeepAxis::swing) orthogonalize_y(owner, false);
  const Vec3 sizes = normalize_columns(owner);
  const Direction direction = normalized(target->location() - owner.location());
  const float distance = direction.length / sizes[1];
  const float rest = acting.number(kRestLength) == 0 ? distance : acting.number(kRestLength);
  const float bulge = limited_bulge(acting, kUseBulgeMin, std::pow(rest / distance, acting.number(kBulge)));
  const Vec3 scale = bulged(acting, bulge, distance / rest);
  if (keep == KeepAxis::swing) {
    turn_axis_to(owner, direction.unit, 1);
  } else {
    turn_in_plane(owner, direction.unit, keep);
  }
  owner.scale_axes(sizes * scale);
}

}  // namespace
}  // namespace stretch_to

const ConstraintKind kStretchTo = {"STRETCH_TO", stretch_to::kSettings, &stretch_to::apply};

}  // namespace sinew::rig
