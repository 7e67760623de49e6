#include "rig/spline_path.h"

#include <algorithm>
#include <cfloat>
#include <cmath>

namespace sinew::rig {
namespace {

enum BezierPart { kLeft, kPoint, kRight };

/// The points of a Bezier curve at `count` equal steps without the last, by forward differences.
void add_bezier(float q0, float q1, float q2, float q3, int count, int axis, Vec3* points) {
  auto power = static_cast<float>(count);
  const float first = 3.0F * (q1 - q0) / power;
  power *= power;
  const float second = 3.0F * (q0 - 2.0F * q1 + q2) / power;
  power *= static_cast<float>(count);
  const float third = (q3 - q0 + 3.0F * (q1 - q2)) / power;
  float value = q0;
  float step = first + second + third;
  float change = 2 * second + 6 * third;
  for (int i = 0; i < count; ++i) {
    points[i][axis] = value;
    value += step;
    step += change;
    change += 6 * third;
  }
}

std::array<float, 4> radius_weights(RadiusInterpolation interpolation, float t) {
  const float t2 = t * t;
  const float t3 = t2 * t;
  switch (interpolation) {
    case RadiusInterpolation::cardinal: {
      constexpr float kTension = 0.71F;
      return {-kTension * t3 + 2.0F * kTension * t2 - kTension * t,
              (2.0F - kTension) * t3 + (kTension - 3.0F) * t2 + 1.0F,
              (kTension - 2.0F) * t3 + (3.0F - 2.0F * kTension) * t2 + kTension * t, kTension * t3 - kTension * t2};
    }
    case RadiusInterpolation::bspline:
      return {-0.16666666F * t3 + 0.5F * t2 - 0.5F * t + 0.16666666F, 0.5F * t3 - t2 + 0.66666666F,
              -0.5F * t3 + 0.5F * t2 + 0.5F * t + 0.16666666F, 0.16666666F * t3};
    default:
      return {0.0F, -t + 1.0F, t, 0.0F};
  }
}

float distance(const Vec3& a, const Vec3& b) { return length(a - b); }

bool are_near(const Vec3& a, const Vec3& b, float most) {
  for (int k = 0; k < 3; ++k) {
    if (!(std::fabs(a[k] - b[k]) <= most)) return false;
  }
  return true;
}

}  // namespace

void SplinePath::reserve(std::size_t pieces) {
  points_.reserve(std::max(points_.capacity(), pieces + 1));
  radii_.reserve(points_.capacity());
  lengths_.reserve(points_.capacity());
}

void SplinePath::add_segment(const Spline& spline, std::span<const std::array<Vec3, 3>> points, const float* radii,
                             std::size_t i) {
  const int count = spline.resolution;
  const std::size_t begin = points_.size();
  points_.resize(begin + count);
  for (int k = 0; k < 3; ++k) {
    add_bezier(points[i][kPoint][k], points[i][kRight][k], points[i + 1][kLeft][k], points[i + 1][kPoint][k], count, k,
               points_.data() + begin);
  }
  const float before = radii[i == 0 ? 0 : i - 1];
  const float after = radii[std::min(i + 2, points.size() - 1)];
  const float share = 1.0F / static_cast<float>(count);
  float t = 0;
  for (int step = 0; step < count; ++step, t += share) {
    if (spline.radius_interpolation == RadiusInterpolation::ease) {
      radii_.push_back(radii[i] + (radii[i + 1] - radii[i]) * (3.0F * t * t - 2.0F * t * t * t));
      continue;
    }
    const std::array<float, 4> weights = radius_weights(spline.radius_interpolation, t);
    radii_.push_back(weights[0] * before + weights[1] * radii[i] + weights[2] * radii[i + 1] + weights[3] * after);
  }
}

void SplinePath::build(const Spline& spline, std::span<const std::array<Vec3, 3>> points, const float* radii) {
  points_.clear();
  radii_.clear();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool is_straight =
        spline.is_poly || i + 1 == points.size() ||
        (spline.handles[i][1] == SplineHandle::vector && spline.handles[i + 1][0] == SplineHandle::vector);
    if (is_straight) {
      points_.push_back(points[i][kPoint]);
      radii_.push_back(radii[i]);
    } else {
      add_segment(spline, points, radii, i);
    }
  }
  remove_doubles(spline.resolution);
  lengths_.clear();
  float length = 0;
  for (std::size_t i = 0; i + 1 < points_.size(); ++i) {
    length += distance(points_[i], points_[i + 1]);
    lengths_.push_back(length);
  }
}

void SplinePath::remove_doubles(int resolution) {
  const float most = 0.00001F / static_cast<float>(resolution);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (i + 1 < points_.size() && are_near(points_[i], points_[i + 1], most)) continue;
    points_[kept] = points_[i];
    radii_[kept++] = radii_[i];
  }
  points_.resize(kept);
  radii_.resize(kept);
}

PathPlace SplinePath::at(float share) const {
  const float wanted = share * length();
  int piece = 0;
  if (share <= 0 || share >= 1) {
    piece = static_cast<int>(clamped(share, 0, 1) * static_cast<float>(pieces() - 1));
  } else {
    piece = static_cast<int>(std::ranges::upper_bound(lengths_, wanted) - lengths_.begin());
    piece = std::min(piece, pieces() - 1);
  }
  const float before = piece == 0 ? 0 : lengths_[piece - 1];
  const float t = piece == 0 ? wanted / lengths_[0] : (wanted - before) / (lengths_[piece] - before);
  const float s = -t + 1.0F;
  const Vec3& a = points_[piece];
  const Vec3& b = points_[piece + 1];
  return {a * s + b * t, clamped(s, 0, 1) * radii_[piece] + clamped(t, 0, 1) * radii_[piece + 1]};
}

int SplinePath::leave_ball(const Vec3& centre, float size, int from, float& share, PathPlace& place) const {
  const int last = pieces() - 1;
  const float guess = share * length();
  int piece = from;
  while (piece < last && guess > lengths_[piece]) ++piece;
  int end = piece + 1;  // of the piece that is looked at
  int begin = piece;
  while (distance(centre, points_[end]) < size && end <= last) begin = end++;

  // The secant method.
  const Vec3& target = points_[end];
  const Vec3& start = from == end - 1 ? centre : points_[begin];
  const float precision = std::max({1.0F, rig::length(centre), rig::length(target)}) * FLT_EPSILON;
  float x0 = 0;
  float x1 = 1;
  Vec3 found{};
  for (int i = 0; i < 10; ++i) {
    found = lerp(start, target, x1);
    const float f0 = size - distance(centre, lerp(start, target, x0));
    const float f1 = size - distance(centre, found);
    if (std::fabs(f1) <= precision || f0 == f1) break;
    const float x2 = x1 - f1 * (x1 - x0) / (f1 - f0);
    x0 = x1;
    x1 = x2;
  }
  const float before = end < 2 ? 0 : lengths_[end - 2];
  const float along = distance(points_[begin], found);
  const float t = along / distance(points_[begin], target);
  share = (before + along) / length();
  place = {found, share > 1.0F ? radii_[end] : (1.0F - t) * radii_[begin] + t * radii_[end]};
  return end - 1;
}

void move_by_hook(const SplineHook& hook, const Mat4& matrix, std::span<std::array<Vec3, 3>> points) {
  if (hook.strength == 0) return;
  for (const int handle : hook.points) {
    Vec3& point = points[handle / 3][handle % 3];
    point = lerp(point, transformed_point(matrix, point), hook.strength);
  }
}

void place_handles(const Spline& spline, std::span<std::array<Vec3, 3>> points) {
  if (spline.is_poly || points.size() < 2) return;
  const auto length_or_one = [](const Vec3& way) {
    const float size = length(way);
    return size == 0 ? 1.0F : size;
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto& [left, right] = spline.handles[i];
    const Vec3& point = points[i][kPoint];
    const auto beyond = [&](const Vec3& other) { return point * 2.0F - other; };
    const Vec3 next = i + 1 < points.size() ? points[i + 1][kPoint] : beyond(points[i - 1][kPoint]);
    const Vec3 previous = i > 0 ? points[i - 1][kPoint] : beyond(next);
    const Vec3 in = point - previous;
    const Vec3 out = next - point;
    float in_length = length_or_one(in);
    float out_length = length_or_one(out);
    if (left == SplineHandle::automatic || right == SplineHandle::automatic) {
      Vec3 direction;
      for (int k = 0; k < 3; ++k) direction[k] = out[k] / out_length + in[k] / in_length;
      constexpr float kAutomatic = 2.5614F;
      const float size = length(direction) * kAutomatic;
      if (size != 0) {
        in_length = std::min(in_length, 5.0F * out_length);
        out_length = std::min(out_length, 5.0F * in_length);
        if (left == SplineHandle::automatic) points[i][kLeft] = point + direction * -(in_length / size);
        if (right == SplineHandle::automatic) points[i][kRight] = point + direction * (out_length / size);
      }
    }
    if (left == SplineHandle::vector) points[i][kLeft] = point + in * (-1.0F / 3.0F);
    if (right == SplineHandle::vector) points[i][kRight] = point + out * (1.0F / 3.0F);
  }
}

}  // namespace sinew::rig
