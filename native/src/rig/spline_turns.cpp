#include <cmath>
#include <numbers>

#include "rig/spline_path.h"

namespace sinew::rig {
namespace {

/// Between unit vectors; exact for small ones, too.
float angle_between(const Vec3& a, const Vec3& b) {
  if (dot(a, b) >= 0) return 2.0F * safe_asin(length(b - a) / 2.0F);
  return kPi - 2.0F * safe_asin(length(-b - a) / 2.0F);
}

/// Turns the Z axis to a direction, with the Y axis up.
Quat with_y_up(const Vec3& direction) {
  const float size = length(direction);
  if (size == 0) return {1, 0, 0, 0};
  Vec3 axis = {-direction[1], direction[0], 0};
  if (std::fabs(direction[0]) + std::fabs(direction[1]) < 1e-4F) axis[0] = 1;
  axis = normalized(axis).unit;
  const float half = 0.5F * safe_acos(direction[2] / size);
  const Vec3 v = axis * std::sin(half);
  const Quat to_direction = {std::cos(half), v[0], v[1], v[2]};
  const Mat3 m = matrix_of(to_direction);
  const float angle = -0.5F * std::atan2(-m[2][0], -m[2][1]);
  const float sine = std::sin(angle) / size;
  return Quat{std::cos(angle), direction[0] * sine, direction[1] * sine, direction[2] * sine} * to_direction;
}

/// The rotation at a point that follows from that at the point before, without any twist.
Quat carried_on(const Quat& before, const Vec3& from, const Vec3& to) {
  const float angle = angle_between(from, to);
  return angle > 0 ? turn_about(cross(from, to), angle) * before : before;
}

}  // namespace

void SplinePath::find_directions() {
  const std::size_t count = points_.size();
  directions_.assign(count, {0, 0, 0});
  const auto bisect = [&](std::size_t before, std::size_t i, std::size_t after) {
    const Vec3 in = normalized(points_[i] - points_[before]).unit;
    const Vec3 out = normalized(points_[after] - points_[i]).unit;
    directions_[i] = normalized(in + out).unit;
  };
  if (is_closed_) {
    for (std::size_t i = 0; i < count; ++i) bisect((i + count - 1) % count, i, (i + 1) % count);
    return;
  }
  for (std::size_t i = 1; i + 1 < count; ++i) bisect(i - 1, i, i + 1);
  const auto set = [&](std::size_t i, const Vec3& direction, std::size_t from, std::size_t to, std::size_t other) {
    directions_[i] = direction;
    if (direction != Vec3{0, 0, 0}) return;
    const Direction way = normalized(points_[to] - points_[from]);
    directions_[i] = way.length == 0 ? directions_[other] : way.unit;
  };
  set(0, ends_[0], 0, 1, 1);
  set(count - 1, ends_[1], count - 2, count - 1, count - 2);
}

/// With the least twist from one point to the next.
void SplinePath::turn_least() {
  const int count = static_cast<int>(points_.size());
  const int last = count - 1;
  rotations_[last] = with_y_up(directions_[last]);
  if (!is_closed_) rotations_[0] = with_y_up(directions_[0]);
  for (int i = is_closed_ ? 0 : 1; i < last; ++i) {
    const int before = i == 0 ? last : i - 1;
    rotations_[i] = carried_on(rotations_[before], directions_[before], directions_[i]);
  }
  if (!is_closed_) {
    rotations_[0] = carried_on(rotations_[1], directions_[1], directions_[0]);
    rotations_[last] = carried_on(rotations_[last - 1], directions_[last - 1], directions_[last]);
    return;
  }
  // What is twisted at the end is spread over all of it.
  const Vec3& first = directions_[last];
  const Vec3& other = directions_[last - 1];
  const Vec3 up = normalized(turned(rotations_[last], {0, 1, 0})).unit;
  Vec3 arrived = normalized(turned(rotations_[last - 1], {0, 1, 0})).unit;
  arrived = turned(turn_about(cross(other, first), angle_between(first, other)), arrived);
  float angle = angle_between(up, arrived);
  constexpr float kQuarter = 90.0F * static_cast<float>(std::numbers::pi / 180);
  if (angle_between(first, normalized(cross(up, arrived)).unit) < kQuarter) angle = -angle;
  for (int step = 0; step < count; ++step) {
    const int i = step == 0 ? last : step - 1;
    const float share = 1.0F - static_cast<float>(last - step) / static_cast<float>(count);
    rotations_[i] = turn_about(directions_[i], angle * share) * rotations_[i];
  }
}

void SplinePath::turn(const Spline& spline) {
  const std::size_t count = points_.size();
  rotations_.assign(count, {1, 0, 0, 0});
  if (count < 2) return;
  if (count == 2) {
    directions_.assign(2, normalized(points_[1] - points_[0]).unit);
    for (Quat& each : rotations_) each = with_y_up(directions_[0]);
  } else {
    find_directions();
    if (spline.twist == SplineTwist::minimum) {
      turn_least();
    } else {
      for (std::size_t i = 0; i < count; ++i) rotations_[i] = with_y_up(directions_[i]);
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    rotations_[i] = normalized(turn_about(directions_[i], tilts_[i]) * rotations_[i]);
  }
}

Quat SplinePath::rotation_at(float share) const {
  const Along along = piece_at(share);
  const float before = clamped(-along.share + 1.0F, 0, 1);
  const float after = clamped(along.share, 0, 1);
  return slerp(rotations_[along.piece], rotations_[end_of(along.piece)], after / (before + after));
}

}  // namespace sinew::rig
