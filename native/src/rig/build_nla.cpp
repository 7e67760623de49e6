#include <algorithm>
#include <cmath>
#include <string_view>
#include <unordered_map>

#include "rig/build.h"

namespace sinew::rig {
namespace {

constexpr int kMostNested = 8;  // meta strips in each other

class Builder {
 public:
  Builder(const RigDescription& rig, const ValueMap& map) : rig_(rig), map_(map) {}

  Nla build() {
    for (const MixedPropertyDescription& property : rig_.mixed) add_property(property);
    for (const std::vector<AnimatedValue>& action : rig_.actions) add_action(action);
    is_set_.resize(nla_.defaults.size());
    for (const std::vector<StripDescription>& track : rig_.tracks) nla_.tracks.push_back(strips_of(track, 0));
    for (std::size_t i = 0; i < nla_.properties.size(); ++i) {
      const MixedProperty& property = nla_.properties[i];
      for (int k = 0; k < property.count; ++k) {
        const int place = property.first + k;
        if (is_set_[place]) nla_.numbers.push_back({values_[i] + k, static_cast<int>(i), place});
      }
    }
    return std::move(nla_);
  }

 private:
  void add_property(const MixedPropertyDescription& given) {
    const ValueMap::Found found = map_.find(given.path);
    if (found.first < 0) fail("strips set ", given.path, ", which the rig does not have");
    if (std::ssize(given.defaults) != found.count) {
      fail("strips set ", given.path, ", which has ", plural(static_cast<long long>(given.defaults.size()), "default"),
           "; expected ", found.count);
    }
    check_finite(given.defaults, "the default of " + given.path);
    if (given.mix == PropertyMix::quaternion && found.count != 4) {
      fail(given.path, " is mixed as a quaternion and has ", plural(found.count, "number"), "; expected 4");
    }
    if (!properties_.emplace(given.path, static_cast<int>(nla_.properties.size())).second) {
      fail("strips set ", given.path, " twice; describe it once");
    }
    nla_.properties.push_back({static_cast<int>(nla_.defaults.size()), found.count, given.mix});
    nla_.defaults.insert(nla_.defaults.end(), given.defaults.begin(), given.defaults.end());
    values_.push_back(found.first);
  }

  void add_action(const std::vector<AnimatedValue>& curves) {
    std::vector<StripCurve> action;
    for (const AnimatedValue& curve : curves) {
      const auto found = properties_.find(curve.value.path);
      if (found == properties_.end()) {
        fail("a strip sets ", curve.value.path, ", which is not among what strips mix; describe it there");
      }
      const MixedProperty& property = nla_.properties[found->second];
      if (curve.value.index < 0 || curve.value.index >= property.count) {
        fail("a strip sets number ", curve.value.index, " of ", curve.value.path, ", which has ", property.count);
      }
      const int value = values_[found->second] + curve.value.index;
      const auto owner = [&] { return "the curve of " + map_.name(value); };
      action.push_back({found->second, property.first + curve.value.index,
                        named(owner, [&] { return FCurve(curve.curve, map_.values()[value].kind); })});
    }
    nla_.actions.push_back(std::move(action));
  }

  std::vector<Strip> strips_of(const std::vector<StripDescription>& given, int depth) {
    if (depth > kMostNested) fail("meta strips are nested more than ", kMostNested, " times; ungroup some");
    std::vector<Strip> strips;
    for (const StripDescription& each : given) strips.push_back(strip_of(each, depth));
    for (std::size_t i = 0; i < strips.size(); ++i) {
      if (i > 0 && strips[i].start < strips[i - 1].start) {
        fail("a strip begins on frame ", strips[i].start,
             ", before the one in front of it; sort the strips of a track");
      }
      if (strips[i].type != StripType::transition) continue;
      const auto is_clip = [&](std::size_t k) { return k >= strips.size() || strips[k].type == StripType::clip; };
      if (!is_clip(i - 1) || !is_clip(i + 1)) {  // in front of the first one there is none
        fail("a transition is beside a meta strip or another transition, which is not computed; ungroup the strips");
      }
    }
    return strips;
  }

  Strip strip_of(const StripDescription& given, int depth) {
    check_finite(std::array{given.start, given.end, given.action_start, given.action_end, given.scale, given.repeat,
                            given.blend_in, given.blend_out, given.influence.value_or(0), given.time.value_or(0)},
                 "a strip");
    if (given.end < given.start || (given.type != StripType::clip && given.end == given.start)) {
      fail("a strip is from frame ", given.start, " to ", given.end, "; it has to end after it begins");
    }
    Strip strip{given, {}, {}, {}};
    const auto curve_of = [](const CurveDescription& curve) -> std::optional<FCurve> {
      if (curve.keys.empty()) return std::nullopt;
      return named([] { return "a curve of a strip"; }, [&] { return FCurve(curve); });
    };
    strip.influence_curve = curve_of(given.influence_curve);
    strip.time_curve = curve_of(given.time_curve);
    if (given.action < -1 || given.action >= std::ssize(rig_.actions)) {
      fail("a strip plays action ", given.action, "; the rig has ", rig_.actions.size());
    }
    if (given.action >= 0) note_set(given.action);
    strip.strips = strips_of(given.strips, depth + 1);
    return strip;
  }

  /// Blender resets what some strip sets on all frames, whether that plays or not.
  void note_set(int action) {
    for (const StripCurve& curve : nla_.actions[action]) {
      const MixedProperty& property = nla_.properties[curve.property];
      const bool is_whole = property.mix == PropertyMix::quaternion;
      std::fill_n(is_set_.begin() + (is_whole ? property.first : curve.place), is_whole ? property.count : 1, 1);
    }
  }

  const RigDescription& rig_;
  const ValueMap& map_;
  Nla nla_;
  std::unordered_map<std::string_view, int> properties_;
  std::vector<int> values_;  // of each property, the first of its numbers in the rig
  std::vector<char> is_set_;
};

}  // namespace

Nla build_nla(const RigDescription& rig, const ValueMap& map) { return Builder(rig, map).build(); }

}  // namespace sinew::rig
