/// Vectors of three floats, with the order of operations that Blender's results show.
///
/// Everything in this folder is single precision, rounded after each operation: no fused multiply-add, sums from left
/// to right unless stated. That makes the last bit of a pose Blender's.
#pragma once

#include <cmath>

namespace sinew::rig {

struct Vec3 {
  float v[3];

  float& operator[](int i) { return v[i]; }
  float operator[](int i) const { return v[i]; }
  bool operator==(const Vec3&) const = default;
};

inline constexpr float kPi = 3.14159265358979323846F;
inline constexpr float kHalfPi = 1.57079632679489661923F;

inline Vec3 operator+(const Vec3& a, const Vec3& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
inline Vec3 operator-(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline Vec3 operator-(const Vec3& a) { return {-a[0], -a[1], -a[2]}; }
inline Vec3 operator*(const Vec3& a, float factor) { return {a[0] * factor, a[1] * factor, a[2] * factor}; }
inline Vec3 operator*(const Vec3& a, const Vec3& b) { return {a[0] * b[0], a[1] * b[1], a[2] * b[2]}; }

inline float dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline float length(const Vec3& a) { return std::sqrt(dot(a, a)); }

inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// The cross product computed in double precision.
inline Vec3 precise_cross(const Vec3& a, const Vec3& b) {
  const auto element = [&](int i, int k) {
    return static_cast<float>(static_cast<double>(a[i]) * b[k] - static_cast<double>(a[k]) * b[i]);
  };
  return {element(1, 2), element(2, 0), element(0, 1)};
}

/// A direction and the length it had. Both are zero for a vector that is too short to have a direction.
struct Direction {
  Vec3 unit;
  float length;
};

inline Direction normalized(const Vec3& a) {
  const float squared = dot(a, a);
  if (!(squared > 1.0e-35F)) return {{0, 0, 0}, 0};
  const float size = std::sqrt(squared);
  return {a * (1.0F / size), size};
}

inline float lerp(float a, float b, float t) { return (1.0F - t) * a + t * b; }

inline Vec3 lerp(const Vec3& a, const Vec3& b, float t) {
  const float s = 1.0F - t;
  return {s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2]};
}

/// The part of `a` along `axis`, which need not be a unit vector.
inline Vec3 projected(const Vec3& a, const Vec3& axis) {
  if (axis == Vec3{0, 0, 0}) return axis;
  return axis * (dot(a, axis) / dot(axis, axis));
}

inline float clamped(float value, float low, float high) { return value < low ? low : value > high ? high : value; }
inline float safe_acos(float cosine) { return std::acos(clamped(cosine, -1, 1)); }
inline float safe_asin(float sine) { return std::asin(clamped(sine, -1, 1)); }

}  // namespace sinew::rig
