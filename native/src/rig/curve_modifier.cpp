#include "rig/curve_modifier.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/check.h"

namespace sinew::rig {
namespace {

using Type = CurveModifier::Type;

bool acts_at(const CurveModifier& modifier, float time) {
  return !modifier.has_range || (modifier.range_start <= time && modifier.range_end >= time);
}

float influence_at(const CurveModifier& modifier, float time) {
  if (!modifier.has_range) return modifier.influence;
  const auto since = [&](float begin, float end) { return modifier.influence * (time - begin) / (end - begin); };
  const float start = modifier.range_start;
  const float end = modifier.range_end;
  if (modifier.blend_in != 0 && time <= start + modifier.blend_in) return since(start, start + modifier.blend_in);
  if (modifier.blend_out != 0 && time >= end - modifier.blend_out) return since(end, end - modifier.blend_out);
  return modifier.influence;
}

float mixed(float changed, float before, float influence) {
  return (changed * influence) + (before * (1.0F - influence));
}

float limited_time(const CurveModifier& limits, float time) {
  if (limits.least_frame && time < *limits.least_frame) return *limits.least_frame;
  if (limits.most_frame && time > *limits.most_frame) return *limits.most_frame;
  return time;
}

float stepped_time(const CurveModifier& stepped, float time) {
  if (stepped.first_stepped && time < *stepped.first_stepped) return time;
  if (stepped.last_stepped && time > *stepped.last_stepped) return time;
  const std::int32_t number = truncated((time - stepped.step_offset) / stepped.step);
  return (static_cast<float>(number) * stepped.step) + stepped.step_offset;
}

float polynomial(const CurveModifier& generator, float time) {
  if (generator.is_factorised) {
    float product = 1;
    for (std::size_t i = 0; i + 1 < generator.coefficients.size(); i += 2) {
      product *= generator.coefficients[i] * time + generator.coefficients[i + 1];
    }
    return product;
  }
  float sum = 0;
  float power = 1;
  for (const float coefficient : generator.coefficients) {
    sum += coefficient * power;
    power *= time;
  }
  return sum;
}

float added(const CurveModifier& modifier, float value, float made) {
  return modifier.is_additive ? value + made : made;
}

/// Where a function has no value the curve is 0, or nothing is added to it.
float function_value(const CurveModifier& modifier, float value, float time) {
  const double x = modifier.phase_multiplier * time + modifier.phase_offset;
  const auto found = [&](double number) {
    return added(modifier, value, modifier.amplitude * static_cast<float>(number) + modifier.value_offset);
  };
  const float none = modifier.is_additive ? value : 0;
  switch (modifier.function) {
    case CurveFunction::sine:
      return found(std::sin(x));
    case CurveFunction::cosine:
      return found(std::cos(x));
    case CurveFunction::tangent: {
      const double from_pole = std::fmod(x - std::numbers::pi / 2, std::numbers::pi);
      return std::fabs(from_pole) < double{std::numeric_limits<float>::epsilon()} ? none : found(std::tan(x));
    }
    case CurveFunction::square_root:
      return x > 0 ? found(std::sqrt(x)) : none;
    case CurveFunction::natural_logarithm:
      return x > 1 ? found(std::log(x)) : none;
    case CurveFunction::normalized_sine:
      return found(std::fabs(x) < 0.0001 ? 1.0 : std::sin(std::numbers::pi * x) / (std::numbers::pi * x));
  }
  return value;
}

float enveloped(const CurveModifier& envelope, float value, float time) {
  const std::vector<EnvelopePoint>& points = envelope.points;
  if (points.empty()) return value;
  float low = 0;
  float high = 0;
  if (points.front().frame >= time) {
    low = points.front().low;
    high = points.front().high;
  } else if (points.back().frame <= time) {
    low = points.back().low;
    high = points.back().high;
  } else {
    for (std::size_t i = 1; i < points.size(); ++i) {
      const EnvelopePoint& before = points[i - 1];
      const EnvelopePoint& after = points[i];
      if (!(before.frame <= time && after.frame >= time)) continue;
      const float length = after.frame - before.frame;
      const float t = (time - before.frame) / length;
      const float rest = (after.frame - time) / length;
      low = rest * before.low + t * after.low;
      high = rest * before.high + t * after.high;
      break;
    }
  }
  const float share =
      (value - (envelope.reference + envelope.envelope_low)) / (envelope.envelope_high - envelope.envelope_low);
  return low + share * (high - low);
}

float limited_value(const CurveModifier& limits, float value) {
  if (limits.least_value && value < *limits.least_value) value = *limits.least_value;
  if (limits.most_value && value > *limits.most_value) value = *limits.most_value;
  return value;
}

}  // namespace

std::int32_t truncated(float value) {
  // What a conversion gives on x86 for numbers that do not fit, NaN included.
  if (!(value >= -2147483648.0f && value < 2147483648.0f)) return std::numeric_limits<std::int32_t>::min();
  return static_cast<std::int32_t>(value);
}

void check_modifier(const CurveModifier& modifier) {
  std::vector<float> numbers = modifier.coefficients;
  numbers.insert(numbers.end(), {modifier.amplitude, modifier.phase_multiplier, modifier.phase_offset,
                                 modifier.value_offset, modifier.reference, modifier.envelope_low,
                                 modifier.envelope_high, modifier.step, modifier.step_offset, modifier.influence,
                                 modifier.range_start, modifier.range_end, modifier.blend_in, modifier.blend_out});
  for (const EnvelopePoint& point : modifier.points) {
    numbers.insert(numbers.end(), {point.frame, point.low, point.high});
  }
  for (const std::optional<float>& number : {modifier.least_frame, modifier.most_frame, modifier.least_value,
                                             modifier.most_value, modifier.first_stepped, modifier.last_stepped}) {
    numbers.push_back(number.value_or(0));
  }
  if (!std::ranges::all_of(numbers, [](float number) { return std::isfinite(number); })) {
    fail("A modifier of a curve has a number that is not finite. Give finite numbers.");
  }
  if (!std::ranges::is_sorted(modifier.points, {}, &EnvelopePoint::frame)) {
    fail("The points of an Envelope of a curve are not in order. Sort them by frame.");
  }
  if (modifier.type == Type::cycles && (modifier.influence != 1 || modifier.has_range)) {
    fail("The modifier Cycles of a curve has a frame range or an influence. Remove it.");
  }
}

float modified_time(const CurveModifier& modifier, float time) {
  if (!acts_at(modifier, time)) return time;
  float changed = time;
  if (modifier.type == Type::limits) {
    changed = limited_time(modifier, time);
  } else if (modifier.type == Type::stepped) {
    changed = stepped_time(modifier, time);
  } else {
    return time;
  }
  return mixed(changed, time, influence_at(modifier, time));
}

float modified_value(const CurveModifier& modifier, float value, float time) {
  if (!acts_at(modifier, time)) return value;
  float changed = value;
  switch (modifier.type) {
    case Type::generator:
      changed = added(modifier, value, polynomial(modifier, time));
      break;
    case Type::function:
      changed = function_value(modifier, value, time);
      break;
    case Type::envelope:
      changed = enveloped(modifier, value, time);
      break;
    case Type::limits:
      changed = limited_value(modifier, value);
      break;
    default:
      return value;
  }
  return mixed(changed, value, influence_at(modifier, time));
}

}  // namespace sinew::rig
