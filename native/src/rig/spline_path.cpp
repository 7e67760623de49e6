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
  tilts_.reserve(points_.capacity());
  lengths_.reserve(points_.capacity());
  directions_.reserve(points_.capacity());
  rotations_.reserve(points_.capacity());
}

void SplinePath::add_segment(const Spline& spline, std::span<const std::array<Vec3, 3>> points, const float* radii,
                             std::size_t i) {
  const int count = spline.resolution;
  const std::size_t last = points.size() - 1;
  const std::size_t next = i == last ? 0 : i + 1;
  const std::size_t begin = points_.size();
  points_.resize(begin + count);
  for (int k = 0; k < 3; ++k) {
    add_bezier(points[i][kPoint][k], points[i][kRight][k], points[next][kLeft][k], points[next][kPoint][k], count, k,
               points_.data() + begin);
  }
  const std::size_t before = i > 0 ? i - 1 : spline.is_closed ? last : 0;
  const std::size_t after = next < last ? next + 1 : spline.is_closed ? 0 : last;
  const auto add = [&](const float* numbers, RadiusInterpolation interpolation, float t, std::vector<float>& added) {
    if (interpolation == RadiusInterpolation::ease) {
      added.push_back(numbers[i] + (numbers[next] - numbers[i]) * (3.0F * t * t - 2.0F * t * t * t));
      return;
    }
    const std::array<float, 4> weights = radius_weights(interpolation, t);
    added.push_back(weights[0] * numbers[before] + weights[1] * numbers[i] + weights[2] * numbers[next] +
                    weights[3] * numbers[after]);
  };
  const float share = 1.0F / static_cast<float>(count);
  float t = 0;
  for (int step = 0; step < count; ++step, t += share) {
    add(radii, spline.radius_interpolation, t, radii_);
    add(spline.tilts.data(), spline.tilt_interpolation, t, tilts_);
  }
}

void SplinePath::add_place(const Spline& spline, std::span<const std::array<Vec3, 3>> points, const float* radii,
                           const NurbsPlace& place) {
  Vec3 found = {0, 0, 0};
  float tilt = 0;
  float radius = 0;
  std::size_t i = place.first % points.size();
  for (const float share : place.shares) {
    if (share != 0) {
      found = found + points[i][kPoint] * share;
      tilt += share * spline.tilts[i];
      radius += share * radii[i];
    }
    if (++i == points.size()) i = 0;
  }
  points_.push_back(found);
  tilts_.push_back(tilt);
  radii_.push_back(radius);
}

void SplinePath::build(const Spline& spline, std::span<const std::array<Vec3, 3>> points, const float* radii) {
  is_closed_ = spline.is_closed;
  points_.clear();
  radii_.clear();
  tilts_.clear();
  rotations_.clear();
  const std::size_t count = points.size();
  const bool is_bezier = spline.type == SplineType::bezier;
  for (const NurbsPlace& place : spline.places) add_place(spline, points, radii, place);
  // A closed Bezier curve begins with the segment that ends at its first point.
  const std::size_t first = is_closed_ && is_bezier ? count - 1 : 0;
  for (std::size_t step = 0; step < count && spline.type != SplineType::nurbs; ++step) {
    const std::size_t i = (first + step) % count;
    const std::size_t next = (i + 1) % count;
    const bool is_straight =
        !is_bezier || (!is_closed_ && next == 0) ||
        (spline.handles[i][1] == SplineHandle::vector && spline.handles[next][0] == SplineHandle::vector);
    if (is_straight) {
      points_.push_back(points[i][kPoint]);
      radii_.push_back(radii[i]);
      tilts_.push_back(spline.tilts[i]);
    } else {
      add_segment(spline, points, radii, i);
    }
  }
  const auto way = [&](const Vec3& from, const Vec3& to) { return normalized(to - from).unit; };
  const auto& end = points[count - 1];
  ends_ = {way(points[0][kPoint], is_bezier ? points[0][kRight] : points[1][kPoint]),
           way(is_bezier ? end[kLeft] : points[count - 2][kPoint], end[kPoint])};
  remove_doubles(spline.resolution);
  lengths_.clear();
  float length = 0;
  for (std::size_t i = 0; i + 1 < points_.size(); ++i) {
    length += distance(points_[i], points_[i + 1]);
    lengths_.push_back(length);
  }
  if (is_closed_ && is_there()) lengths_.push_back(length + distance(points_.front(), points_.back()));
}

void SplinePath::remove_doubles(int resolution) {
  const float most = 0.00001F / static_cast<float>(resolution);
  const std::size_t count = points_.size();
  const auto is_double = [&](std::size_t i) {
    if (!is_closed_) return i + 1 < count && are_near(points_[i], points_[i + 1], most);
    if (i + 1 == count) return count > 1 && are_near(points_[i], points_[0], most);
    return i + 2 < count && are_near(points_[i], points_[i + 1], most);  // as Blender, which leaves out one pair
  };
  const bool drops_last = is_closed_ && is_double(count - 1);
  if (!is_closed_ && is_double(0)) ends_[0] = {0, 0, 0};
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (is_closed_ && i + 1 == count ? drops_last : is_double(i)) continue;
    points_[kept] = points_[i];
    tilts_[kept] = tilts_[i];
    radii_[kept++] = radii_[i];
  }
  points_.resize(kept);
  radii_.resize(kept);
  tilts_.resize(kept);
}

SplinePath::Along SplinePath::piece_at(float share) const {
  if (is_closed_ && (share < 0 || share > 1)) share -= std::floor(share);
  const float wanted = share * length();
  int piece = 0;
  if (share <= 0 || share >= 1) {
    piece = static_cast<int>(clamped(share, 0, 1) * static_cast<float>(pieces() - 1));
  } else {
    piece = static_cast<int>(std::ranges::upper_bound(lengths_, wanted) - lengths_.begin());
    piece = std::min(piece, pieces() - 1);
  }
  const float before = piece == 0 ? 0 : lengths_[piece - 1];
  return {piece, piece == 0 ? wanted / lengths_[0] : (wanted - before) / (lengths_[piece] - before)};
}

PathPlace SplinePath::place_in(const Along& along) const {
  const float t = along.share;
  const float s = -t + 1.0F;
  const int end = end_of(along.piece);
  const Vec3& a = points_[along.piece];
  const Vec3& b = points_[end];
  return {a * s + b * t, clamped(s, 0, 1) * radii_[along.piece] + clamped(t, 0, 1) * radii_[end]};
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
  if (spline.type != SplineType::bezier || points.size() < 2) return;
  const auto length_or_one = [](const Vec3& way) {
    const float size = length(way);
    return size == 0 ? 1.0F : size;
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto& [left, right] = spline.handles[i];
    const Vec3& point = points[i][kPoint];
    const auto beyond = [&](const Vec3& other) { return point * 2.0F - other; };
    const std::size_t last = points.size() - 1;
    const bool ends = i == last && !spline.is_closed;
    const bool begins = i == 0 && !spline.is_closed;
    const Vec3 next = ends ? beyond(points[i - 1][kPoint]) : points[i == last ? 0 : i + 1][kPoint];
    const Vec3 previous = begins ? beyond(next) : points[i == 0 ? last : i - 1][kPoint];
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
