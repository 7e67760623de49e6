#include "rig/spline.h"

#include <algorithm>
#include <array>

#include "rig/rotation.h"

namespace sinew::rig {
namespace {

constexpr int kLargestPieces = 32;
constexpr int kSteps = 32;

/// Points of a cubic curve at equal steps of its parameter, by forward differences.
std::array<float, kSteps + 1> stepped(float p0, float p1, float p2, float p3) {
  float factor = static_cast<float>(kSteps);
  const float a = p0;
  const float b = 3.0F * (p1 - p0) / factor;
  factor *= factor;
  const float c = 3.0F * (p0 - 2.0F * p1 + p2) / factor;
  factor *= kSteps;
  const float d = (p3 - p0 + 3.0F * (p1 - p2)) / factor;
  float point = a;
  float first = b + c + d;
  float second = 2 * c + 6 * d;
  const float third = 6 * d;
  std::array<float, kSteps + 1> points;
  for (float& written : points) {
    written = point;
    point += first;
    first += second;
    second += third;
  }
  return points;
}

/// The curve's parameters at which its pieces end. sizes: each piece's share of the length.
void share_length(const std::array<Vec3, 4>& curve, std::span<const float> sizes, std::span<float> parameters) {
  std::array<std::array<float, kSteps + 1>, 3> axes;
  for (int k = 0; k < 3; ++k) axes[k] = stepped(curve[0][k], curve[1][k], curve[2][k], curve[3][k]);
  std::array<float, kSteps + 1> lengths;
  lengths[0] = 0;
  for (int i = 0; i < kSteps; ++i) {
    const Vec3 step = {axes[0][i + 1] - axes[0][i], axes[1][i + 1] - axes[1][i], axes[2][i + 1] - axes[2][i]};
    lengths[i + 1] = lengths[i] + length(step);
  }
  float total = 0;
  for (const float size : sizes) total += size;
  const float scale = lengths[kSteps] / total;
  float distance = 0;
  parameters[0] = 0;
  int next = 1;
  for (std::size_t i = 1; i <= sizes.size(); ++i) {
    distance += sizes[i - 1] * scale;
    while (next < kSteps && distance >= lengths[next]) ++next;
    const float fraction = (lengths[next] - distance) / (lengths[next] - lengths[next - 1]);
    parameters[i] = (static_cast<float>(next) - fraction) / kSteps;
  }
  parameters[sizes.size()] = 1;
}

/// The tangent at an end, moved a little towards the next one if the handle there is too short to give a direction.
Vec3 end_tangent(const Vec3& tangent, const Vec3& change) {
  constexpr float kShortest = 0.1F;
  const float squared = dot(change, change);
  if (squared == 0) return tangent;
  const float ratio = dot(tangent, tangent) / squared;
  if (ratio >= kShortest * kShortest) return tangent;
  return tangent + change * (kShortest - std::sqrt(ratio));
}

}  // namespace

Mat3 matrix_of_direction(const Vec3& given, float roll) {
  constexpr float kSafe = 6.1e-3F;
  constexpr float kCritical = 2.5e-4F;
  const Vec3 direction = normalized(given).unit;
  const auto [x, y, z] = direction.v;
  const float squared = x * x + z * z;
  float theta = 1.0F + y;
  Mat3 m = kIdentity3;
  if (theta > kSafe || squared > kCritical * kCritical) {
    if (theta <= kSafe) theta = squared * 0.5F + squared * squared * 0.125F;
    m[0] = {1 - x * x / theta, -x, -x * z / theta};
    m[1] = {x, y, z};
    m[2] = {-x * z / theta, -z, 1 - z * z / theta};
  } else {
    m[0][0] = -1;
    m[1][1] = -1;
  }
  return axis_rotation(direction, roll) * m;
}

float roll_about(const Mat3& m, const Vec3& direction) {
  return twist_of(quaternion_of_unit(unit_columns(inverse(matrix_of_direction(direction, 0)) * m)), 1);
}

float handle_share(const Vec3& start, const Vec3& end) {
  const float cosine = dot(start, end);
  if (cosine > 1.0F - 1e-5F) return (1.0F / 3.0F) * 0.75F;
  if (cosine < -1.0F + 1e-5F) return 0.5F;
  const float angle = std::acos(cosine) / 2.0F;
  const float sine = std::sin(angle);
  return ((1.0F - std::cos(angle)) / (sine * 2.0F)) / sine;
}

void bend_along(const SplineEnds& ends, float size, const UnevenScale& uneven, std::span<Mat4> segments) {
  const int pieces = static_cast<int>(segments.size()) - 1;
  const Vec3 tip = {0, size, 0};
  const std::array<Vec3, 4> curve = {Vec3{0, 0, 0}, ends.handles[0], tip + ends.handles[1], tip};

  // From one end to the other the pieces' lengths change by equal factors.
  const float first = std::log(std::max(ends.scales[0][1], 0.0001F));
  const float last = std::log(std::max(ends.scales[1][1], 0.0001F));
  std::array<float, kLargestPieces> sizes;
  for (int i = 0; i < pieces; ++i) {
    const float share = static_cast<float>(i) / static_cast<float>(pieces - 1);
    sizes[i] = std::exp(lerp(first, last, share));
  }
  std::array<float, kLargestPieces + 1> parameters;
  share_length(curve, {sizes.data(), static_cast<std::size_t>(pieces)}, parameters);

  const Vec3 tangents[] = {curve[1] - curve[0], curve[2] - curve[1], curve[3] - curve[2]};
  const Vec3 changes[] = {tangents[1] - tangents[0], tangents[2] - tangents[1]};
  const auto write = [&](int i, const Vec3& point, const Vec3& tangent, float roll, float x_size, float z_size) {
    Mat4& m = segments[i];
    m = widened(matrix_of_direction(tangent, roll), point);
    if (uneven.is_uneven) m = (uneven.to_even * m) * uneven.to_uneven;
    m.scale_axis(0, x_size);
    m.scale_axis(2, z_size);
  };
  write(0, curve[0], end_tangent(tangents[0], changes[0]), ends.rolls[0], ends.scales[0][0], ends.scales[0][2]);
  for (int i = 1; i < pieces; ++i) {
    const float t = parameters[i];
    const Vec3 a = lerp(curve[0], curve[1], t);
    const Vec3 b = lerp(curve[1], curve[2], t);
    const Vec3 c = lerp(curve[2], curve[3], t);
    const Vec3 from = lerp(a, b, t);
    const Vec3 tangent = lerp(b, c, t) - from;
    const float share = static_cast<float>(i) / static_cast<float>(pieces);
    write(i, from + tangent * t, tangent, lerp(ends.rolls[0], ends.rolls[1], share),
          lerp(ends.scales[0][0], ends.scales[1][0], share), lerp(ends.scales[0][2], ends.scales[1][2], share));
  }
  write(pieces, curve[3], end_tangent(tangents[2], -changes[1]), ends.rolls[1], ends.scales[1][0], ends.scales[1][2]);
}

}  // namespace sinew::rig
