#include "rig/rotation.h"

#include <numbers>
#include <utility>

namespace sinew::rig {
namespace {

struct Axes {
  int i, j, k;
  bool is_odd;  ///< an odd permutation of X Y Z
};

Axes axes_of(EulerOrder order) {
  switch (order) {
    case EulerOrder::xzy:
      return {0, 2, 1, true};
    case EulerOrder::yxz:
      return {1, 0, 2, true};
    case EulerOrder::yzx:
      return {1, 2, 0, false};
    case EulerOrder::zxy:
      return {2, 0, 1, false};
    case EulerOrder::zyx:
      return {2, 1, 0, true};
    default:
      return {0, 1, 2, false};
  }
}

#ifdef _WIN32
float hypotenuse(float a, float b) { return std::hypot(a, b); }
#else
/// As hypotf of the C library, whose newer version would ask for a newer library.
float hypotenuse(double a, double b) { return static_cast<float>(std::sqrt(a * a + b * b)); }
#endif

/// The two triples of angles that give a matrix of unit columns.
std::pair<Vec3, Vec3> both_eulers(const Mat3& m, EulerOrder order) {
  const auto [i, j, k, is_odd] = axes_of(order);
  Vec3 first;
  Vec3 second;
  const float cosine = hypotenuse(m[i][i], m[i][j]);
  if (cosine > 0.0000375F) {
    first[i] = std::atan2(m[j][k], m[k][k]);
    first[j] = std::atan2(-m[i][k], cosine);
    first[k] = std::atan2(m[i][j], m[i][i]);
    second[i] = std::atan2(-m[j][k], -m[k][k]);
    second[j] = std::atan2(-m[i][k], -cosine);
    second[k] = std::atan2(-m[i][j], -m[i][i]);
  } else {
    first[i] = std::atan2(-m[k][j], m[j][j]);
    first[j] = std::atan2(-m[i][k], cosine);
    first[k] = 0;
    second = first;
  }
  if (is_odd) return {-first, -second};
  return {first, second};
}

float axis_distance(const Vec3& a, const Vec3& b) {
  return std::fabs(a[0] - b[0]) + std::fabs(a[1] - b[1]) + std::fabs(a[2] - b[2]);
}

float absolute_sum(const Vec3& a) { return std::fabs(a[0]) + std::fabs(a[1]) + std::fabs(a[2]); }

}  // namespace

Mat3 matrix_of(const Vec3& euler, EulerOrder order) {
  const auto [i, j, k, is_odd] = axes_of(order);
  const float sign = is_odd ? -1.0F : 1.0F;
  const double ti = sign * euler[i];
  const double tj = sign * euler[j];
  const double tk = sign * euler[k];
  const double ci = std::cos(ti);
  const double cj = std::cos(tj);
  const double ck = std::cos(tk);
  const double si = std::sin(ti);
  const double sj = std::sin(tj);
  const double sk = std::sin(tk);
  const double cc = ci * ck;
  const double cs = ci * sk;
  const double sc = si * ck;
  const double ss = si * sk;
  Mat3 m;
  m[i][i] = static_cast<float>(cj * ck);
  m[j][i] = static_cast<float>(sj * sc - cs);
  m[k][i] = static_cast<float>(sj * cc + ss);
  m[i][j] = static_cast<float>(cj * sk);
  m[j][j] = static_cast<float>(sj * ss + cc);
  m[k][j] = static_cast<float>(sj * cs - sc);
  m[i][k] = static_cast<float>(-sj);
  m[j][k] = static_cast<float>(cj * si);
  m[k][k] = static_cast<float>(cj * ci);
  return m;
}

Mat3 matrix_of(const Quat& unit) {
  const double w = std::numbers::sqrt2 * unit[0];
  const double x = std::numbers::sqrt2 * unit[1];
  const double y = std::numbers::sqrt2 * unit[2];
  const double z = std::numbers::sqrt2 * unit[3];
  const double wx = w * x;
  const double wy = w * y;
  const double wz = w * z;
  const double xx = x * x;
  const double xy = x * y;
  const double xz = x * z;
  const double yy = y * y;
  const double yz = y * z;
  const double zz = z * z;
  Mat3 m;
  m[0][0] = static_cast<float>(1.0 - yy - zz);
  m[0][1] = static_cast<float>(wz + xy);
  m[0][2] = static_cast<float>(-wy + xz);
  m[1][0] = static_cast<float>(-wz + xy);
  m[1][1] = static_cast<float>(1.0 - xx - zz);
  m[1][2] = static_cast<float>(wx + yz);
  m[2][0] = static_cast<float>(wy + xz);
  m[2][1] = static_cast<float>(-wx + yz);
  m[2][2] = static_cast<float>(1.0 - xx - yy);
  return m;
}

Mat3 axis_rotation(const Vec3& axis, float angle) {
  const float sine = std::sin(angle);
  const float cosine = std::cos(angle);
  const float rest = 1.0F - cosine;
  const Vec3 n = axis * sine;
  const float n00 = (axis[0] * axis[0]) * rest;
  const float n01 = (axis[0] * axis[1]) * rest;
  const float n11 = (axis[1] * axis[1]) * rest;
  const float n02 = (axis[0] * axis[2]) * rest;
  const float n12 = (axis[1] * axis[2]) * rest;
  const float n22 = (axis[2] * axis[2]) * rest;
  return {{{n00 + cosine, n01 + n[2], n02 - n[1]},
           {n01 - n[2], n11 + cosine, n12 + n[0]},
           {n02 + n[1], n12 - n[0], n22 + cosine}}};
}

Quat operator*(const Quat& a, const Quat& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3], a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1]};
}

Quat normalized(const Quat& q) {
  const float size = std::sqrt(dot(q, q));
  if (size == 0) return {0, 1, 0, 0};
  const float factor = 1.0F / size;
  return {q[0] * factor, q[1] * factor, q[2] * factor, q[3] * factor};
}

Quat turn_about(const Vec3& axis, float angle) {
  const Direction about = normalized(axis);
  if (about.length == 0) return {1, 0, 0, 0};
  const float half = 0.5F * angle;
  const Vec3 v = about.unit * std::sin(half);
  return {std::cos(half), v[0], v[1], v[2]};
}

Vec3 turned(const Quat& q, const Vec3& v) {
  const auto& [w, x, y, z] = q.v;
  const float a = -x * v[0] - y * v[1] - z * v[2];
  const Vec3 b = {w * v[0] + y * v[2] - z * v[1], w * v[1] + z * v[0] - x * v[2], w * v[2] + x * v[1] - y * v[0]};
  return {a * -x + b[0] * w - b[1] * z + b[2] * y, a * -y + b[1] * w - b[2] * x + b[0] * z,
          a * -z + b[2] * w - b[0] * y + b[1] * x};
}

Quat slerp(const Quat& a, const Quat& b, float t) {
  float cosine = dot(a, b);
  Quat from = a;
  if (cosine < 0) {
    cosine = -cosine;
    for (float& element : from.v) element = -element;
  }
  float from_weight = 1.0F - t;
  float to_weight = t;
  if (std::fabs(cosine) < 1.0F - 1e-4F) {
    const float angle = std::acos(cosine);
    const float sine = std::sin(angle);
    from_weight = std::sin((1.0F - t) * angle) / sine;
    to_weight = std::sin(t * angle) / sine;
  }
  Quat result;
  for (int i = 0; i < 4; ++i) result[i] = from_weight * from[i] + to_weight * b[i];
  return result;
}

Quat quaternion_of_unit(const Mat3& given) {
  Mat3 m = given;
  const float volume = determinant(m);
  if (!std::isfinite(volume)) {
    m = kIdentity3;
  } else if (volume < 0) {
    for (Vec3& column : m.columns) column = -column;
  }
  // Starts from the largest of the four elements.
  int largest = 0;
  if (m[2][2] < 0) {
    largest = m[0][0] > m[1][1] ? 1 : 2;
  } else if (m[0][0] < -m[1][1]) {
    largest = 3;
  }
  Quat q;
  float trace = 0;
  if (largest == 0) {
    trace = 1.0F + m[0][0] + m[1][1] + m[2][2];
    float s = 2.0F * std::sqrt(trace);
    q[0] = 0.25F * s;
    s = 1.0F / s;
    q[1] = (m[1][2] - m[2][1]) * s;
    q[2] = (m[2][0] - m[0][2]) * s;
    q[3] = (m[0][1] - m[1][0]) * s;
  } else {
    const int i = largest - 1;
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    // The diagonal's elements are added in the order X Y Z.
    const auto signed_diagonal = [&](int axis) { return axis == i ? m[axis][axis] : -m[axis][axis]; };
    trace = 1.0F + signed_diagonal(0) + signed_diagonal(1) + signed_diagonal(2);
    float s = 2.0F * std::sqrt(trace);
    if (m[j][k] < m[k][j]) s = -s;
    q[i + 1] = 0.25F * s;
    s = 1.0F / s;
    q[0] = (m[j][k] - m[k][j]) * s;
    q[j + 1] = (m[i][j] + m[j][i]) * s;
    q[k + 1] = (m[k][i] + m[i][k]) * s;
  }
  bool is_alone = trace == 1.0F;
  for (int i = 0; i < 4; ++i) is_alone = is_alone && (i == largest || q[i] == 0);
  if (is_alone) q[largest] = 1;
  if (std::fabs(dot(q, q) - 1.0F) >= 0.0002F * 3) q = normalized(q);
  return q;
}

Vec3 euler_of_unit(const Mat3& m, EulerOrder order) {
  const auto [first, second] = both_eulers(m, order);
  return absolute_sum(first) > absolute_sum(second) ? second : first;
}

Vec3 made_compatible(Vec3 euler, const Vec3& old) {
  constexpr float kTurn = 2.0F * kPi;
  Vec3 difference;
  for (int i = 0; i < 3; ++i) {
    difference[i] = euler[i] - old[i];
    if (difference[i] > kPi) {
      euler[i] -= std::floor((difference[i] / kTurn) + 0.5F) * kTurn;
      difference[i] = euler[i] - old[i];
    } else if (difference[i] < -kPi) {
      euler[i] += std::floor((-difference[i] / kTurn) + 0.5F) * kTurn;
      difference[i] = euler[i] - old[i];
    }
  }
  for (int i = 0; i < 3; ++i) {
    const float others[] = {difference[(i + 1) % 3], difference[(i + 2) % 3]};
    const auto is_near = [](float angle) { return std::fabs(angle) < std::numbers::pi / 2; };
    if (std::fabs(difference[i]) > std::numbers::pi && is_near(others[0]) && is_near(others[1])) {
      euler[i] += difference[i] > 0 ? -kTurn : kTurn;
    }
  }
  return euler;
}

Vec3 compatible_euler_of(const Mat4& m, EulerOrder order, const Vec3& old) {
  auto [first, second] = both_eulers(unit_columns(upper(m)), order);
  first = made_compatible(first, old);
  second = made_compatible(second, old);
  return axis_distance(first, old) > axis_distance(second, old) ? second : first;
}

Vec3 rotated_euler(const Vec3& euler, EulerOrder order, int axis, float angle) {
  Vec3 turn = {0, 0, 0};
  turn[axis] = angle;
  return euler_of_unit(unit_columns(matrix_of(euler, order) * matrix_of(turn, order)), order);
}

float twist_of(const Quat& q, int axis) {
  const float sign = q[0] < 0 ? -1.0F : 1.0F;
  return 2.0F * std::atan2(sign * q[axis + 1], sign * q[0]);
}

SwingTwist swing_twist(const Quat& given, int axis) {
  Quat q = given;
  if (given[0] < 0) {
    for (float& element : q.v) element = -element;
  }
  const float half = std::atan2(q[axis + 1], q[0]);
  Quat back = {std::cos(half), 0, 0, 0};
  back[axis + 1] = -std::sin(half);
  return {q * back, 2.0F * half};
}

}  // namespace sinew::rig
