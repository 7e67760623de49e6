#include "rig/easing.h"

#include <cmath>

#include "rig/vector.h"

// The order of operations is that of Blender's easing.c, since each of them rounds. CMakeLists.txt has this file
// compiled without fused multiply-adds.

namespace sinew::rig {
namespace {

/// Returns factor * t * t ..., with `times` multiplications.
float multiplied(float factor, float t, int times) {
  for (int i = 0; i < times; ++i) factor *= t;
  return factor;
}

float quad(KeyEasing easing, float t, const Eased& e) {
  const float c = e.change;
  if (easing == KeyEasing::in) return multiplied(c, t / e.duration, 2) + e.begin;
  if (easing == KeyEasing::out) {
    t /= e.duration;
    return -c * t * (t - 2) + e.begin;
  }
  t /= e.duration / 2;
  if (t < 1) return multiplied(c / 2, t, 2) + e.begin;
  t -= 1;
  return -c / 2 * (t * (t - 2) - 1) + e.begin;
}

/// The powers from the third on.
float power(int degree, KeyEasing easing, float t, const Eased& e) {
  const float sign = degree % 2 == 0 ? -1.0f : 1.0f;
  if (easing == KeyEasing::in) return multiplied(e.change, t / e.duration, degree) + e.begin;
  if (easing == KeyEasing::out) {
    t = t / e.duration - 1;
    return sign * e.change * (multiplied(t, t, degree - 1) + sign) + e.begin;
  }
  t /= e.duration / 2;
  if (t < 1) return multiplied(e.change / 2, t, degree) + e.begin;
  t -= 2;
  return sign * e.change / 2 * (multiplied(t, t, degree - 1) + sign * 2) + e.begin;
}

float sine(KeyEasing easing, float t, const Eased& e) {
  if (easing == KeyEasing::in) return -e.change * std::cos(t / e.duration * kHalfPi) + e.change + e.begin;
  if (easing == KeyEasing::out) return e.change * std::sin(t / e.duration * kHalfPi) + e.begin;
  return -e.change / 2 * (std::cos(kPi * t / e.duration) - 1) + e.begin;
}

float circ(KeyEasing easing, float t, const Eased& e) {
  if (easing == KeyEasing::in) {
    t /= e.duration;
    return -e.change * (std::sqrt(1 - t * t) - 1) + e.begin;
  }
  if (easing == KeyEasing::out) {
    t = t / e.duration - 1;
    return e.change * std::sqrt(1 - t * t) + e.begin;
  }
  t /= e.duration / 2;
  if (t < 1) return -e.change / 2 * (std::sqrt(1 - t * t) - 1) + e.begin;
  t -= 2;
  return e.change / 2 * (std::sqrt(1 - t * t) + 1) + e.begin;
}

// 2^-10, where the exponential begins, and what stretches the rest so that it reaches 1.
constexpr float kSmallest = 0.0009765625f;
constexpr float kStretch = 1.0f / (1.0f - kSmallest);

float expo_in(float t, float begin, float change, float duration) {
  if (t == 0) return begin;
  return change * (std::pow(2.0f, 10 * (t / duration - 1)) - kSmallest) * kStretch + begin;
}

float expo_out(float t, float begin, float change, float duration) {
  if (t == 0) return begin;
  return change * (1 - (std::pow(2.0f, -10 * t / duration) - kSmallest) * kStretch) + begin;
}

float expo(KeyEasing easing, float t, const Eased& e) {
  if (easing == KeyEasing::in) return expo_in(t, e.begin, e.change, e.duration);
  if (easing == KeyEasing::out) return expo_out(t, e.begin, e.change, e.duration);
  const float half = e.duration / 2, change = e.change / 2;
  return t <= half ? expo_in(t, e.begin, change, half) : expo_out(t - half, e.begin + change, change, half);
}

float back(KeyEasing easing, float t, const Eased& e) {
  float over = e.back;
  if (easing == KeyEasing::in) {
    t /= e.duration;
    return e.change * t * t * ((over + 1) * t - over) + e.begin;
  }
  if (easing == KeyEasing::out) {
    t = t / e.duration - 1;
    return e.change * (t * t * ((over + 1) * t + over) + 1) + e.begin;
  }
  over *= 1.525f;
  t /= e.duration / 2;
  if (t < 1) return e.change / 2 * (t * t * ((over + 1) * t - over)) + e.begin;
  t -= 2;
  return e.change / 2 * (t * t * ((over + 1) * t + over) + 2) + e.begin;
}

float bounce_out(float t, float begin, float change, float duration) {
  t /= duration;
  if (t < 1 / 2.75f) return change * (7.5625f * t * t) + begin;
  if (t < 2 / 2.75f) {
    t -= 1.5f / 2.75f;
    return change * (7.5625f * t * t + 0.75f) + begin;
  }
  if (t < 2.5f / 2.75f) {
    t -= 2.25f / 2.75f;
    return change * (7.5625f * t * t + 0.9375f) + begin;
  }
  t -= 2.625f / 2.75f;
  return change * (7.5625f * t * t + 0.984375f) + begin;
}

float bounce_in(float t, float begin, float change, float duration) {
  return change - bounce_out(duration - t, 0, change, duration) + begin;
}

float bounce(KeyEasing easing, float t, const Eased& e) {
  if (easing == KeyEasing::in) return bounce_in(t, e.begin, e.change, e.duration);
  if (easing == KeyEasing::out) return bounce_out(t, e.begin, e.change, e.duration);
  if (t < e.duration / 2) return bounce_in(t * 2, 0, e.change, e.duration) * 0.5f + e.begin;
  return bounce_out(t * 2 - e.duration, 0, e.change, e.duration) * 0.5f + e.change * 0.5f + e.begin;
}

/// Returns how much of the wave is left near its start, where it would jump if its amplitude is smaller than the change.
float elastic_blend(float t, const Eased& e, float shift) {
  if (e.change == 0) return 1;
  const float share = e.amplitude != 0 ? e.amplitude / std::abs(e.change) : 0.0f;
  const float reach = std::abs(shift), at = std::abs(t * e.duration);
  if (!(at < reach)) return share;
  const float left = at / reach;
  return share * left + (1 - left);
}

float elastic(KeyEasing easing, float t, const Eased& e) {
  if (t == 0) return e.begin;
  const bool is_both = easing == KeyEasing::in_out;
  t /= is_both ? e.duration / 2 : e.duration;
  if (t == (is_both ? 2.0f : 1.0f)) return e.begin + e.change;
  t = easing == KeyEasing::out ? -t : t - 1;

  const float period = e.period != 0 ? e.period : e.duration * (is_both ? 0.3f * 1.5f : 0.3f);
  float amplitude = e.amplitude, shift, blend = 1;
  if (amplitude == 0 || amplitude < std::abs(e.change)) {
    shift = period / 4;
    // In the second half the wave runs the other way; the blend looks at the same distance from its start.
    blend = elastic_blend(t, e, shift);
    amplitude = e.change;
  } else {
    shift = period / (2 * kPi) * std::asin(e.change / amplitude);
  }
  const auto wave = [&](float at) {
    return amplitude * std::pow(2.0f, 10 * at) * std::sin((at * e.duration - shift) * (2 * kPi) / period);
  };
  if (easing == KeyEasing::in) return -blend * wave(t) + e.begin;
  if (easing == KeyEasing::out) return blend * wave(t) + e.change + e.begin;
  blend *= 0.5f;
  return t < 0 ? -blend * wave(t) + e.begin : blend * wave(-t) + e.change + e.begin;
}

}  // namespace

float eased(KeyInterpolation interpolation, KeyEasing easing, float time, const Eased& e) {
  if (easing == KeyEasing::automatic) {
    easing = interpolation >= KeyInterpolation::back ? KeyEasing::out : KeyEasing::in;
  }
  switch (interpolation) {
    case KeyInterpolation::sine:
      return sine(easing, time, e);
    case KeyInterpolation::quadratic:
      return quad(easing, time, e);
    case KeyInterpolation::cubic:
      return power(3, easing, time, e);
    case KeyInterpolation::quartic:
      return power(4, easing, time, e);
    case KeyInterpolation::quintic:
      return power(5, easing, time, e);
    case KeyInterpolation::exponential:
      return expo(easing, time, e);
    case KeyInterpolation::circular:
      return circ(easing, time, e);
    case KeyInterpolation::back:
      return back(easing, time, e);
    case KeyInterpolation::bounce:
      return bounce(easing, time, e);
    default:
      return elastic(easing, time, e);
  }
}

}  // namespace sinew::rig
