/// Matrices of floats, with the order of operations that Blender's results show (see vector.h).
#pragma once

#include <array>
#include <span>

#include "rig/vector.h"

namespace sinew::rig {

/// Three columns.
struct Mat3 {
  Vec3 columns[3];

  Vec3& operator[](int column) { return columns[column]; }
  const Vec3& operator[](int column) const { return columns[column]; }
};

/// Four columns of four numbers. The fourth row is kept and computed with, as in Blender: after several products it is
/// not exactly 0 0 0 1, and inverses show it.
struct alignas(16) Mat4 {
  float columns[4][4];

  float* operator[](int column) { return columns[column]; }
  const float* operator[](int column) const { return columns[column]; }

  Vec3 axis(int column) const { return {columns[column][0], columns[column][1], columns[column][2]}; }
  Vec3 location() const { return axis(3); }
  void set_axis(int column, const Vec3& value) {
    for (int k = 0; k < 3; ++k) columns[column][k] = value[k];
  }
  void set_location(const Vec3& value) { set_axis(3, value); }

  /// Multiplies the first three numbers of a column.
  void scale_axis(int column, float factor) {
    for (int k = 0; k < 3; ++k) columns[column][k] *= factor;
  }
  void scale_axes(const Vec3& factors) {
    for (int i = 0; i < 3; ++i) scale_axis(i, factors[i]);
  }
};

inline constexpr Mat3 kIdentity3 = {{{{1, 0, 0}}, {{0, 1, 0}}, {{0, 0, 1}}}};
inline constexpr Mat4 kIdentity4 = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}};

/// From 16 numbers, column after column.
inline Mat4 matrix_of(std::span<const float, 16> numbers) {
  Mat4 matrix;
  for (int i = 0; i < 16; ++i) matrix[i / 4][i % 4] = numbers[i];
  return matrix;
}

/// Whether all 16 numbers are equal.
inline bool operator==(const Mat4& a, const Mat4& b) {
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 4; ++k) {
      if (a[i][k] != b[i][k]) return false;
    }
  }
  return true;
}

/// Each column is (b0 a0 + b1 a1) + (b2 a2 + b3 a3).
inline Mat4 operator*(const Mat4& a, const Mat4& b) {
  Mat4 product;
  for (int i = 0; i < 4; ++i) {
    const float b0 = b[i][0];
    const float b1 = b[i][1];
    const float b2 = b[i][2];
    const float b3 = b[i][3];
    for (int k = 0; k < 4; ++k) {
      product[i][k] = (b0 * a[0][k] + b1 * a[1][k]) + (b2 * a[2][k] + b3 * a[3][k]);
    }
  }
  return product;
}

inline Vec3 operator*(const Mat3& a, const Vec3& v) {
  Vec3 product;
  for (int k = 0; k < 3; ++k) product[k] = v[0] * a[0][k] + v[1] * a[1][k] + v[2] * a[2][k];
  return product;
}

inline Mat3 operator*(const Mat3& a, const Mat3& b) { return {{a * b[0], a * b[1], a * b[2]}}; }

/// Multiplies the upper 3x3 part; location and fourth row stay.
inline Mat4 rotated(const Mat3& a, const Mat4& b) {
  Mat4 product = b;
  for (int i = 0; i < 3; ++i) product.set_axis(i, a * b.axis(i));
  return product;
}

inline Vec3 transformed_point(const Mat4& m, const Vec3& v) {
  Vec3 point;
  for (int k = 0; k < 3; ++k) point[k] = v[0] * m[0][k] + v[1] * m[1][k] + m[2][k] * v[2] + m[3][k];
  return point;
}

inline Vec3 transformed_direction(const Mat4& m, const Vec3& v) {
  Vec3 direction;
  for (int k = 0; k < 3; ++k) direction[k] = v[0] * m[0][k] + v[1] * m[1][k] + m[2][k] * v[2];
  return direction;
}

/// a * b, with the location computed as a point. This is how a bone's matrix goes through its parent's.
inline Mat4 chained(const Mat4& a, const Mat4& b) {
  Mat4 product = a * b;
  product.set_location(transformed_point(a, b.location()));
  return product;
}

inline Mat3 upper(const Mat4& m) { return {{m.axis(0), m.axis(1), m.axis(2)}}; }

inline Mat4 widened(const Mat3& m, const Vec3& location = {0, 0, 0}) {
  Mat4 wide = kIdentity4;
  for (int i = 0; i < 3; ++i) wide.set_axis(i, m[i]);
  wide.set_location(location);
  return wide;
}

inline Mat4 diagonal(const Vec3& sizes) {
  Mat4 matrix = kIdentity4;
  for (int i = 0; i < 3; ++i) matrix[i][i] = sizes[i];
  return matrix;
}

inline float determinant(const Mat3& m) {
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[1][0] * (m[0][1] * m[2][2] - m[0][2] * m[2][1]) +
         m[2][0] * (m[0][1] * m[1][2] - m[0][2] * m[1][1]);
}

/// Adjoint times 1 / determinant; the adjoint alone if the determinant is 0.
Mat3 inverse(const Mat3& m);

/// All zero if the matrix has no inverse.
Mat4 inverse(const Mat4& m);

/// The columns' lengths.
inline Vec3 sizes_of(const Mat4& m) { return {length(m.axis(0)), length(m.axis(1)), length(m.axis(2))}; }

/// The columns' lengths, adjusted so that their product is the volume.
Vec3 sizes_without_shear(const Mat4& m);

inline Mat3 unit_columns(const Mat3& m) {
  return {{normalized(m[0]).unit, normalized(m[1]).unit, normalized(m[2]).unit}};
}

/// Gives the columns unit length, dividing the fourth row's numbers too. Returns the lengths that they had.
Vec3 normalize_columns(Mat4& m);

struct Parts {
  Vec3 location;
  Mat3 rotation;  ///< unit columns, determinant not negative
  Vec3 size;      ///< all three negative for a matrix that mirrors
};

Parts decomposed(const Mat4& m);
Mat4 composed(const Parts& parts);

/// Makes the columns orthogonal. The Y axis keeps its direction; shear between X and Z is shared by both. The volume
/// stays, or with `is_unit` the columns get unit length.
void orthogonalize_y(Mat4& m, bool is_unit);

/// t = 0 gives `a`, 1 gives `b`. Rotations are interpolated on the sphere, sizes and locations linearly.
Mat4 blended(const Mat4& a, const Mat4& b, float t);

}  // namespace sinew::rig
