#include "rig/nla.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "rig/rotation.h"
#include "rig/vector.h"

namespace sinew::rig {
namespace {

bool is_zero(float number) { return std::abs(number) < std::numeric_limits<float>::epsilon(); }
bool are_equal(float a, float b) { return is_zero(a - b); }

float blended_influence(const Strip& strip, float frame) {
  const float in = std::abs(strip.blend_in);
  const float out = std::abs(strip.blend_out);
  if (!is_zero(in) && frame <= strip.start + in) return std::abs(frame - strip.start) / in;
  if (!is_zero(out) && frame >= strip.end - out) return std::abs(strip.end - frame) / out;
  return 1;
}

/// The frame of the action that a clip plays.
float clip_time(const Strip& strip, float frame) {
  const float repeat = is_zero(strip.repeat) ? 1 : strip.repeat;
  const float scale = is_zero(strip.scale) ? 1 : std::abs(strip.scale);
  const float length = strip.action_end <= strip.action_start ? 1 : strip.action_end - strip.action_start;
  // After whole repeats it ends on the last frame, not on the first.
  const bool is_at_end = are_equal(frame, strip.end) && are_equal(repeat, std::floor(repeat));
  if (is_at_end) return strip.is_reversed ? strip.action_start : strip.action_end;
  const float since = std::fmod(frame - strip.start, length * scale) / scale;
  return strip.is_reversed ? strip.action_end - since : strip.action_start + since;
}

float time_of(const Strip& strip, float frame) {
  if (strip.type == StripType::clip) return clip_time(strip, frame);
  return (strip.is_reversed ? strip.end - frame : frame - strip.start) / (strip.end - strip.start);
}

float blended(StripBlend how, float lower, float upper, float influence) {
  if (is_zero(influence)) return lower;
  switch (how) {
    case StripBlend::add:
      return lower + (upper * influence);
    case StripBlend::subtract:
      return lower - (upper * influence);
    case StripBlend::multiply:
      return influence * (lower * upper) + (1 - influence) * lower;
    default:
      return lower * (1.0F - influence) + (upper * influence);
  }
}

float combined(PropertyMix mix, float base, float lower, float upper, float influence) {
  if (is_zero(influence)) return lower;
  if (mix != PropertyMix::multiply) return lower + (upper - base) * influence;
  return lower * std::pow(upper / (is_zero(base) ? 1.0F : base), influence);
}

/// A rotation that turns by a part of the angle.
Quat power(const Quat& unit, float exponent) {
  const float angle = exponent * safe_acos(unit[0]);
  const float sine = std::sin(angle);
  const Vec3 axis = {unit[1], unit[2], unit[3]};
  const float squared = dot(axis, axis);
  const Vec3 turned = squared > 1.0e-35F ? axis * (sine / std::sqrt(squared)) : Vec3{0, 0, 0};
  return {{std::cos(angle), turned[0], turned[1], turned[2]}};
}

}  // namespace

MixedStrips::MixedStrips(const Nla& nla) : is_known_(nla.properties.size()) {
  const auto reserve = [&](Layer& layer) {
    layer.numbers.resize(nla.defaults.size());
    layer.has.resize(nla.properties.size());
    layer.sets.resize(nla.defaults.size());
  };
  reserve(result_);
  for (Layer& layer : layers_) reserve(layer);
}

void MixedStrips::mix(const Nla& nla, float frame) {
  if (nla.tracks.empty()) return;
  clear(result_, nullptr);
  std::ranges::fill(is_known_, 0);
  for (const std::vector<Strip>& track : nla.tracks) {
    if (const std::optional<Playing> found = playing(track, frame)) add(nla, *found, result_, 0);
  }
}

float MixedStrips::number(const Nla& nla, const MixedNumber& number) const {
  return (result_.has[number.property] ? result_.numbers : nla.defaults)[number.place];
}

/// Which strip of a track counts, if any.
std::optional<MixedStrips::Playing> MixedStrips::playing(std::span<const Strip> strips, float frame) {
  std::ptrdiff_t found = -1;
  for (std::ptrdiff_t i = 0; i < std::ssize(strips); ++i) {
    const Strip& strip = strips[i];
    const bool holds = strip.extrapolation == StripExtrapolation::hold;
    bool is_inside = frame >= strip.start && frame <= strip.end;
    if (strip.keeps_frames && holds) is_inside = true;
    if (strip.keeps_frames && strip.extrapolation == StripExtrapolation::hold_forward) is_inside = frame >= strip.start;
    if (is_inside) {
      found = i;
      break;
    }
    if (frame < strip.start) {
      if (i == 0) {
        if (holds) found = 0;
        frame = strip.start;
      } else {
        if (strips[i - 1].extrapolation != StripExtrapolation::nothing) found = i - 1;
        frame = strips[i - 1].end;
      }
      break;
    }
    if (frame > strip.end && i + 1 == std::ssize(strips)) {
      if (strip.extrapolation != StripExtrapolation::nothing) found = i;
      frame = strip.end;
      break;
    }
  }
  if (found < 0 || strips[found].is_muted) return std::nullopt;
  const Strip& strip = strips[found];
  Playing playing = at(strip, frame);
  if (playing.influence <= 0) return std::nullopt;
  if (found > 0) playing.before = &strips[found - 1];
  if (found + 1 < std::ssize(strips)) playing.after = &strips[found + 1];
  if (strip.type == StripType::transition && !(playing.before && playing.after)) return std::nullopt;
  return playing;
}

MixedStrips::Playing MixedStrips::at(const Strip& strip, float frame) {
  Playing playing{.strip = &strip};
  playing.influence = strip.influence ? *strip.influence : blended_influence(strip, frame);
  if (strip.influence && strip.influence_curve) {
    playing.influence = clamped(strip.influence_curve->value(frame), 0, 1);
  }
  if (strip.keeps_frames) {
    playing.time = frame;
    return playing;
  }
  if (!strip.time) {
    playing.time = time_of(strip, frame);
    return playing;
  }
  playing.time = strip.time_curve ? strip.time_curve->value(frame) : *strip.time;
  if (strip.is_time_cyclic) {
    playing.time = std::fmod(playing.time - strip.action_start, strip.action_end - strip.action_start);
  }
  return playing;
}

void MixedStrips::add(const Nla& nla, const Playing& playing, Layer& onto, std::size_t depth) {
  const Strip& strip = *playing.strip;
  if (strip.type == StripType::clip) return add_clip(nla, playing, onto, depth);
  if (strip.type == StripType::transition) return add_transition(nla, playing, onto, depth);
  const float frame = (playing.time * (strip.end - strip.start)) + strip.start;
  const std::optional<Playing> child = MixedStrips::playing(strip.strips, frame);
  if (child) add(nla, *child, onto, depth);
}

void MixedStrips::add_clip(const Nla& nla, const Playing& playing, Layer& onto, std::size_t depth) {
  if (playing.strip->action < 0) return;
  Layer& own = layers_[depth];
  clear(own, nullptr);
  FCurve::KnownRoot known;
  for (const StripCurve& curve : nla.actions[playing.strip->action]) {
    const MixedProperty& property = nla.properties[curve.property];
    ensure(nla, own, curve.property);
    is_known_[curve.property] = 1;
    own.numbers[curve.place] = curve.curve.value(playing.time, 0, &known);
    if (property.mix == PropertyMix::quaternion) {
      std::fill_n(own.sets.begin() + property.first, property.count, 1);
    } else {
      own.sets[curve.place] = 1;
    }
  }
  blend(nla, onto, own, playing.strip->blend, playing.influence, onto);
}

/// From the last frame of the strip before it to the first one of the strip after it.
void MixedStrips::add_transition(const Nla& nla, const Playing& playing, Layer& onto, std::size_t depth) {
  const Strip& strip = *playing.strip;
  std::array<Playing, 2> ends = {at(*playing.before, strip.start), at(*playing.after, strip.end)};
  if (strip.is_reversed) std::swap(ends[0], ends[1]);
  for (std::size_t i = 0; i < 2; ++i) {
    clear(layers_[depth + i], &onto);
    add_clip(nla, ends[i], layers_[depth + i], depth + 2);
  }
  Layer& second = layers_[depth + 1];
  for (std::size_t i = 0; i < nla.properties.size(); ++i) {
    if (is_known_[i]) ensure(nla, second, static_cast<int>(i));
  }
  std::ranges::fill(second.sets, 1);
  blend(nla, layers_[depth], second, StripBlend::replace, playing.time, onto);
}

void MixedStrips::blend(const Nla& nla, const Layer& lower, const Layer& upper, StripBlend how, float influence,
                        Layer& out) {
  for (std::size_t i = 0; i < nla.properties.size(); ++i) {
    if (!is_known_[i] || !(lower.has[i] || upper.has[i])) continue;
    const int index = static_cast<int>(i);
    const MixedProperty& property = nla.properties[i];
    const float* const below = find(nla, &lower, index);
    ensure(nla, out, index);
    float* const mixed = out.numbers.data() + property.first;
    if (!upper.has[i] || is_zero(influence)) {
      std::copy_n(below, property.count, mixed);
      continue;
    }
    const float* const above = upper.numbers.data() + property.first;
    const char* const sets = upper.sets.data() + property.first;
    if (how == StripBlend::combine && property.mix == PropertyMix::quaternion) {
      const auto unit = [](const float* q) { return normalized(Quat{{q[0], q[1], q[2], q[3]}}); };
      const Quat turned =
          sets[0] ? unit(below) * power(unit(above), influence) : Quat{{below[0], below[1], below[2], below[3]}};
      std::copy_n(turned.v, 4, mixed);
      continue;
    }
    const float* const base = nla.defaults.data() + property.first;
    for (int k = 0; k < property.count; ++k) {
      mixed[k] = !sets[k]                     ? below[k]
                 : how == StripBlend::combine ? combined(property.mix, base[k], below[k], above[k], influence)
                                              : blended(how, below[k], above[k], influence);
    }
  }
}

const float* MixedStrips::find(const Nla& nla, const Layer* layer, int property) {
  const int first = nla.properties[property].first;
  for (; layer != nullptr; layer = layer->below) {
    if (layer->has[property]) return layer->numbers.data() + first;
  }
  return nla.defaults.data() + first;
}

void MixedStrips::ensure(const Nla& nla, Layer& layer, int property) {
  if (layer.has[property]) return;
  const MixedProperty& own = nla.properties[property];
  std::copy_n(find(nla, layer.below, property), own.count, layer.numbers.begin() + own.first);
  layer.has[property] = 1;
}

void MixedStrips::clear(Layer& layer, const Layer* below) {
  layer.below = below;
  std::ranges::fill(layer.has, 0);
  std::ranges::fill(layer.sets, 0);
}

}  // namespace sinew::rig
