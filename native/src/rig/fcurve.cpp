#include "rig/fcurve.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/check.h"
#include "rig/curve_modifier.h"
#include "rig/easing.h"
#include "rig/vector.h"

// The order of operations is that of Blender's fcurve.cc and fmodifier.cc, since each of them rounds. CMakeLists.txt has
// this file compiled without fused multiply-adds.

namespace sinew::rig {
namespace {

using Point = const float (&)[2];  // frame and value

/// Keys that are nearer than this are where the time is.
constexpr float kSameFrame = 0.0001f;

bool is_same_frame(float a, float b) { return (a > b ? a - b : b - a) <= kSameFrame; }

double cube_root(double x) {
  if (x == 0) return 0;
  return x < 0 ? -std::exp(std::log(-x) / 3) : std::exp(std::log(x) / 3);
}

bool is_in_part(float root) { return root >= -1.0e-10f && root <= 1.000001f; }

/// Returns the first of the roots, rounded, that lies in [0, 1].
template <class... Roots>
std::optional<float> first_inside(Roots... roots) {
  for (const double root : {roots...}) {
    if (is_in_part(static_cast<float>(root))) return static_cast<float>(root);
  }
  return std::nullopt;
}

std::optional<float> root_of_square(double a, double b, double c) {
  if (a != 0) {
    const double p = b * b - 4 * a * c;
    if (p > 0) return first_inside((-b - std::sqrt(p)) / (2 * a), (-b + std::sqrt(p)) / (2 * a));
    if (p == 0) return first_inside(-b / (2 * a));
    return std::nullopt;
  }
  if (b != 0) return first_inside(-c / b);
  return c == 0 ? std::optional(0.0f) : std::nullopt;
}

void check_finite(const CurveKey& key, std::size_t index) {
  for (const float number : {key.left[0], key.left[1], key.point[0], key.point[1], key.right[0], key.right[1],
                             key.amplitude, key.period, key.back}) {
    if (!std::isfinite(number)) {
      fail("Key ", grouped(static_cast<long long>(index)), " of a curve has a number that is not finite. Give finite ",
           "numbers.");
    }
  }
}

}  // namespace

float stored_value(ValueKind kind, float low, float high, float value) {
  switch (kind) {
    case ValueKind::real:
      return clamped(value, low, high);
    case ValueKind::whole:
      return clamped(static_cast<float>(truncated(value)), low, high);
    case ValueKind::boolean:
      return value > 1.0f - std::numeric_limits<float>::epsilon() ? 1.0f : 0.0f;
    default:
      return static_cast<float>(truncated(value));
  }
}

FCurve::FCurve(const CurveDescription& data, ValueKind kind)
    : has_steps_(!data.is_free && (kind == ValueKind::boolean || kind == ValueKind::choice)),
      is_rounded_(!data.is_free && kind != ValueKind::real) {
  const std::vector<CurveKey>& keys = data.keys;
  frames_.reserve(keys.size());
  if (!keys.empty()) parts_.reserve(keys.size() - 1);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    check_finite(keys[i], i);
    if (i > 0 && keys[i].point[0] < keys[i - 1].point[0]) {
      fail("Key ", grouped(static_cast<long long>(i)), " of a curve is at frame ", keys[i].point[0],
           ", before the key in front of it, at frame ", keys[i - 1].point[0], ". Sort the keys by frame.");
    }
    frames_.push_back(keys[i].point[0]);
    last_value_ = keys[i].point[1];
    if (i + 1 < keys.size()) parts_.push_back(part_of(keys[i], keys[i + 1]));
  }
  for (const CurveModifier& modifier : data.modifiers) {
    check_modifier(modifier);
    const bool is_first = &modifier == &data.modifiers.front();
    if (modifier.type == CurveModifier::Type::cycles && !is_first) {
      fail("The modifier Cycles of a curve is not its first one. Move it to the top, or remove it.");
    }
    modifiers_.push_back(modifier);
  }
  if (keys.empty() || !data.is_extrapolated || has_steps_) return;
  // The slope of the line through the end and its outer handle, or through its neighbour if the end is linear.
  const auto slope = [](Point end, Point other, bool is_from_end) {
    const float run = is_from_end ? end[0] - other[0] : other[0] - end[0];
    if (run == 0) return 0.0f;
    return (is_from_end ? end[1] - other[1] : other[1] - end[1]) / run;
  };
  const auto slope_of_end = [&](const CurveKey& end, Point handle, const CurveKey& neighbour) {
    if (end.interpolation == KeyInterpolation::constant) return 0.0f;
    if (end.interpolation == KeyInterpolation::linear) return slope(end.point, neighbour.point, false);
    return slope(end.point, handle, true);
  };
  slopes_[0] = slope_of_end(keys.front(), keys.front().left, keys[keys.size() > 1 ? 1 : 0]);
  slopes_[1] = slope_of_end(keys.back(), keys.back().right, keys[keys.size() > 1 ? keys.size() - 2 : 0]);
}

FCurve::Part FCurve::part_of(const CurveKey& key, const CurveKey& next) {
  Part part{};
  part.interpolation = key.interpolation;
  part.easing = key.easing;
  part.begin = key.point[1];
  part.change = next.point[1] - key.point[1];
  part.duration = next.point[0] - key.point[0];
  part.height = {key.amplitude, key.period, key.back};
  if (part.duration == 0) part.interpolation = KeyInterpolation::constant;
  if (part.interpolation != KeyInterpolation::bezier) return part;

  const auto array_of = [](Point point) { return std::array{point[0], point[1]}; };
  std::array<float, 2> p1 = array_of(key.point), p2 = array_of(key.right), p3 = array_of(next.left),
                       p4 = array_of(next.point);
  constexpr float kEpsilon = std::numeric_limits<float>::epsilon();
  part.is_flat =
      std::abs(p1[1] - p4[1]) < kEpsilon && std::abs(p2[1] - p3[1]) < kEpsilon && std::abs(p3[1] - p4[1]) < kEpsilon;
  // A handle that is longer than the part is shortened: time goes forward.
  const auto shorten = [&](std::array<float, 2>& handle, const std::array<float, 2>& end) {
    const std::array<float, 2> way{end[0] - handle[0], end[1] - handle[1]};
    const float length = std::abs(way[0]);
    if (!(length > part.duration)) return;
    const float factor = part.duration / length;
    handle = {end[0] - factor * way[0], end[1] - factor * way[1]};
  };
  shorten(p2, p1);
  shorten(p3, p4);

  part.time = {3.0f * (p2[0] - p1[0]), 3.0f * (p1[0] - 2.0f * p2[0] + p3[0]), p4[0] - p1[0] + 3.0f * (p2[0] - p3[0])};
  part.height = {3.0f * (p2[1] - p1[1]), 3.0f * (p1[1] - 2.0f * p2[1] + p3[1]), p4[1] - p1[1] + 3.0f * (p2[1] - p3[1])};
  return part;
}

/// Where between the keys a time is, 0 to 1: the root of a polynomial.
std::optional<float> FCurve::root_of(double cubic, double square, double slope, double constant) {
  if (cubic == 0) return root_of_square(square, slope, constant);
  // Cardano's formula.
  const double a = square / cubic / 3, b = slope / cubic, c = constant / cubic, p = b / 3 - a * a;
  const double q = (2 * a * a * a - a * b + c) / 2, d = q * q + p * p * p;
  if (d > 0) {
    const double t = std::sqrt(d);
    return first_inside(cube_root(-q + t) + cube_root(-q - t) - a);
  }
  if (d == 0) {
    const double t = cube_root(-q);
    return first_inside(2 * t - a, -t - a);
  }
  const double phi = std::acos(-q / std::sqrt(-(p * p * p))), t = std::sqrt(-p);
  const double cosine = std::cos(phi / 3), r = std::sqrt(3 - 3 * cosine * cosine);
  return first_inside(2 * t * cosine - a, -t * (cosine + r) - a, -t * (cosine - r) - a);
}

/// negative_time  the part's first frame minus the time.
float FCurve::bezier(const Part& part, float negative_time, KnownRoot* known) {
  if (part.is_flat) return part.begin;
  KnownRoot own;
  KnownRoot& last = known != nullptr ? *known : own;
  if (!last.is_known || last.constant != negative_time || last.time != part.time) {
    last = {part.time, negative_time, true, root_of(part.time[2], part.time[1], part.time[0], negative_time)};
  }
  if (!last.root) return 0;
  const float t = *last.root;
  return part.begin + t * part.height[0] + t * t * part.height[1] + t * t * t * part.height[2];
}

float FCurve::inside(std::size_t index, float time, KnownRoot* known) const {
  const Part& part = parts_[index];
  if (has_steps_) return part.begin;
  const float since = time - frames_[index];
  switch (part.interpolation) {
    case KeyInterpolation::constant:
      return part.begin;
    case KeyInterpolation::linear:
      return part.change * since / part.duration + part.begin;
    case KeyInterpolation::bezier:
      return bezier(part, frames_[index] - time, known);
    default:
      return eased(part.interpolation, part.easing, since,
                   {part.begin, part.change, part.duration, part.height[0], part.height[1], part.height[2]});
  }
}

float FCurve::outside(float time, bool is_before) const {
  const float end = is_before ? first_value() : last_value_;
  const float slope = slopes_[is_before ? 0 : 1];
  if (slope == 0) return end;
  return end - slope * ((is_before ? frames_.front() : frames_.back()) - time);
}

float FCurve::of_keys(float time, KnownRoot* known) const {
  if (time <= frames_.front()) return outside(time, true);
  if (frames_.back() <= time) return outside(time, false);
  if (is_same_frame(time, frames_.front())) return first_value();
  if (is_same_frame(time, frames_.back())) return last_value_;
  // Blender's search, not std::lower_bound: of several keys nearby it decides which one is found.
  std::ptrdiff_t begin = 0, end = std::ssize(frames_);
  while (begin <= end) {
    const std::ptrdiff_t middle = begin + (end - begin) / 2;
    if (middle == std::ssize(frames_)) {
      end = middle - 1;
      continue;
    }
    const float frame = frames_[middle];
    if (is_same_frame(time, frame)) return value_of_key(middle);
    if (time > frame) {
      begin = middle + 1;
    } else {
      end = middle - 1;
    }
  }
  // A time that is not a number is before the first key.
  return begin == 0 ? first_value() : inside(begin - 1, time, known);
}

/// Returns the time within the keys, and what is added to the value there.
std::pair<float, float> FCurve::cycled(const CurveModifier& cycles, float time) const {
  const float first = frames_.front(), last = frames_.back(), length = last - first;
  const bool is_before = time < first;
  if ((!is_before && !(time > last)) || length == 0) return {time, 0.0f};
  const CycleMode mode = is_before ? cycles.before : cycles.after;
  if (mode == CycleMode::none) return {time, 0.0f};

  const float nearest = is_before ? first : last, farthest = is_before ? last : first;
  const double cycle = (is_before ? -1 : 1) * (double{time} - double{nearest}) / double{length};
  const std::int32_t count = is_before ? cycles.cycles_before : cycles.cycles_after;
  if (count != 0 && cycle > count) return {time, 0.0f};
  float offset = 0;
  if (mode == CycleMode::repeat_with_offset) {
    const float number = (time - nearest) / length;
    offset = (is_before ? std::floor(number) : std::ceil(number)) * (last_value_ - first_value());
  }
  const bool is_mirror = mode == CycleMode::mirror;
  const auto is_odd = [](double number) { return std::fmod(std::trunc(number), 2) != 0; };
  const float within = std::fmod(time - nearest, length);
  float found;
  if (within == 0) {
    found = is_mirror && is_odd(cycle) ? farthest : nearest;
  } else if (is_mirror && is_odd(cycle + 1)) {
    found = nearest - within;
  } else {
    found = first + within;
  }
  if (found < first) found += length;
  return {found, offset};
}

float FCurve::value(float time, float without_keys, KnownRoot* known) const {
  const float value = !modifiers_.empty() ? modified(time, without_keys, known)
                      : !frames_.empty()  ? of_keys(time, known)
                                          : without_keys;
  return is_rounded_ ? std::floor(value + 0.5f) : value;
}

/// From the last modifier to the first each says on which frame it wants the curve; then they change what it has there.
float FCurve::modified(float time, float without_keys, KnownRoot* known) const {
  float offset = 0;
  for (auto modifier = modifiers_.rbegin(); modifier != modifiers_.rend(); ++modifier) {
    if (modifier->type == CurveModifier::Type::cycles) {
      if (has_keys()) std::tie(time, offset) = cycled(*modifier, time);
    } else {
      time = modified_time(*modifier, time);
    }
  }
  float value = has_keys() ? of_keys(time, known) : without_keys;
  for (const CurveModifier& modifier : modifiers_) {
    value = modifier.type == CurveModifier::Type::cycles ? value + offset : modified_value(modifier, value, time);
  }
  return value;
}

}  // namespace sinew::rig
