#include "rig/matrix.h"

#include <Eigen/Dense>
#include <cfloat>
#include <cstring>
#include <limits>

#include "rig/rotation.h"

namespace sinew::rig {
namespace {

/// m = rotation * stretch.
struct Polar {
  Mat3 rotation;
  Mat3 stretch;
};

Mat3 matrix3_of(const Eigen::Matrix3f& eigen) {
  Mat3 m;
  for (int i = 0; i < 3; ++i) m[i] = {eigen(0, i), eigen(1, i), eigen(2, i)};
  return m;
}

/// The rotation never mirrors.
Polar polar(const Mat3& m) {
  Eigen::Matrix3f matrix;
  for (int i = 0; i < 3; ++i) matrix.col(i) << m[i][0], m[i][1], m[i][2];
  if (!matrix.allFinite()) {  // of which Eigen leaves the result undefined
    const Mat3 unknown = matrix3_of(Eigen::Matrix3f::Constant(std::numeric_limits<float>::quiet_NaN()));
    return {unknown, unknown};
  }
  // The decomposition decides the last bits: it has to be Jacobi's, without a QR step before it.
  const Eigen::JacobiSVD<Eigen::Matrix3f, Eigen::NoQRPreconditioner> svd(matrix,
                                                                         Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Mat3 v = matrix3_of(svd.matrixV());
  const Mat3 transposed = matrix3_of(svd.matrixV().transpose());
  const Mat3 singular = {
      {{svd.singularValues()[0], 0, 0}, {0, svd.singularValues()[1], 0}, {0, 0, svd.singularValues()[2]}}};
  Polar result{matrix3_of(svd.matrixU()) * transposed, (v * singular) * transposed};
  if (determinant(result.rotation) < 0) {
    for (int i = 0; i < 3; ++i) {
      result.rotation[i] = result.rotation[i] * -1.0F;
      result.stretch[i] = result.stretch[i] * -1.0F;
    }
  }
  return result;
}

}  // namespace

Mat3 inverse(const Mat3& m) {
  Mat3 r;
  r[0][0] = m[1][1] * m[2][2] - m[1][2] * m[2][1];
  r[0][1] = -m[0][1] * m[2][2] + m[0][2] * m[2][1];
  r[0][2] = m[0][1] * m[1][2] - m[0][2] * m[1][1];
  r[1][0] = -m[1][0] * m[2][2] + m[1][2] * m[2][0];
  r[1][1] = m[0][0] * m[2][2] - m[0][2] * m[2][0];
  r[1][2] = -m[0][0] * m[1][2] + m[0][2] * m[1][0];
  r[2][0] = m[1][0] * m[2][1] - m[1][1] * m[2][0];
  r[2][1] = -m[0][0] * m[2][1] + m[0][1] * m[2][0];
  r[2][2] = m[0][0] * m[1][1] - m[0][1] * m[1][0];
  const float volume = determinant(m);
  if (volume != 0) {
    for (Vec3& column : r.columns) column = column * (1.0F / volume);
  }
  return r;
}

Mat4 inverse(const Mat4& m) {
  Mat4 result;
  Eigen::Map<Eigen::Matrix4f, Eigen::Aligned16> written(&result.columns[0][0]);
  const Eigen::Map<const Eigen::Matrix4f, Eigen::Aligned16> read(&m.columns[0][0]);
  Eigen::Matrix4f inverted;
  bool has_inverse = true;
  read.computeInverseWithCheck(inverted, has_inverse, 0.0F);
  if (!has_inverse) inverted.setZero();
  written = inverted;
  return result;
}

Vec3 sizes_without_shear(const Mat4& m) {
  const Vec3 size = sizes_of(m);
  const float volume = size[0] * size[1] * size[2];
  if (volume == 0) return size;
  return size * std::cbrt(std::fabs(determinant(upper(m)) / volume));
}

Vec3 normalize_columns(Mat4& m) {
  Vec3 sizes;
  for (int i = 0; i < 3; ++i) {
    const Direction direction = normalized(m.axis(i));
    m.set_axis(i, direction.unit);
    sizes[i] = direction.length;
    if (direction.length != 0) m[i][3] /= direction.length;
  }
  return sizes;
}

Parts decomposed(const Mat4& m) {
  Parts parts;
  for (int i = 0; i < 3; ++i) {
    const Direction direction = normalized(m.axis(i));
    parts.rotation[i] = direction.unit;
    parts.size[i] = direction.length;
  }
  if (determinant(parts.rotation) < 0) {
    for (Vec3& column : parts.rotation.columns) column = -column;
    parts.size = -parts.size;
  }
  parts.location = m.location();
  return parts;
}

Mat4 composed(const Parts& parts) {
  Mat4 m = widened(parts.rotation, parts.location);
  m.scale_axes(parts.size);
  return m;
}

void orthogonalize_y(Mat4& m, bool is_unit) {
  Vec3 y = m.axis(1);
  Vec3 x = m.axis(0);
  Vec3 z = m.axis(2);
  const float squared = dot(y, y);
  if (squared > 0) {
    x = x + y * (-dot(x, y) / squared);
    z = z + y * (-dot(z, y) / squared);
    if (is_unit) y = y * (1.0F / std::sqrt(squared));
  }
  auto [unit_x, size_x] = normalized(x);
  auto [unit_z, size_z] = normalized(z);
  const float cosine = dot(unit_x, unit_z);
  if (std::fabs(cosine) > 1e-4F && std::fabs(cosine) < 1.0F - FLT_EPSILON) {
    // Both axes turn by half of what is missing to a right angle.
    const float angle = std::acos(cosine);
    const float target = angle + (kHalfPi - angle) / 2;
    unit_x = unit_x + unit_z * -cosine;
    unit_x = unit_x * (std::sin(target) / length(unit_x));
    unit_x = unit_x + unit_z * std::cos(target);
    unit_z = normalized(cross(cross(unit_x, unit_z), unit_x)).unit;
    if (!is_unit) {
      const float factor = std::sqrt(std::sin(angle));
      x = unit_x * (size_x * factor);
      z = unit_z * (size_z * factor);
    }
  }
  m.set_axis(1, y);
  m.set_axis(0, is_unit ? unit_x : x);
  m.set_axis(2, is_unit ? unit_z : z);
}

Mat4 blended(const Mat4& a, const Mat4& b, float t) {
  const Polar from = polar(upper(a));
  const Polar to = polar(upper(b));
  const Quat rotation =
      slerp(quaternion_of_unit(unit_columns(from.rotation)), quaternion_of_unit(unit_columns(to.rotation)), t);
  Mat3 stretch;
  for (int i = 0; i < 3; ++i) stretch[i] = lerp(from.stretch[i], to.stretch[i], t);
  return widened(matrix_of(rotation) * stretch, lerp(a.location(), b.location(), t));
}

}  // namespace sinew::rig
