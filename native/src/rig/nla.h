/// The NLA: strips that play actions, mixed from the lowest track to the highest, with the bits of Blender's anim_sys.cc
/// and nla.cc.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "rig/fcurve.h"
#include "rig/value_map.h"
#include "sinew/rig_description.h"

namespace sinew::rig {

/// A property that strips set.
struct MixedProperty {
  int first = 0;  ///< of its numbers in Nla::defaults
  int count = 1;
  PropertyMix mix = PropertyMix::add;
};

/// One of its numbers.
struct MixedNumber {
  int value = 0;  ///< among the rig's
  int property = 0;
  int place = 0;  ///< in Nla::defaults
};

struct Strip : StripSettings {
  std::optional<FCurve> influence_curve;
  std::optional<FCurve> time_curve;
  std::vector<Strip> strips;
};

struct StripCurve {
  int property = 0;
  int place = 0;
  FCurve curve;
};

struct Nla {
  std::vector<MixedProperty> properties;
  std::vector<float> defaults;
  std::vector<MixedNumber> numbers;  ///< that are set, by whatever strip plays
  std::vector<std::vector<StripCurve>> actions;
  std::vector<std::vector<Strip>> tracks;
};

/// Throws InputError.
Nla build_nla(const RigDescription& rig, const ValueMap& map);

/// What strips make of the properties on a frame. Nothing is allocated after it was made.
class MixedStrips {
 public:
  explicit MixedStrips(const Nla& nla);

  void mix(const Nla& nla, float frame);
  float number(const Nla& nla, const MixedNumber& number) const;

 private:
  /// Some of the properties. What it does not have is as in `below`, if there is that, or has its default.
  struct Layer {
    const Layer* below = nullptr;
    std::vector<float> numbers;
    std::vector<char> has;   ///< of each property
    std::vector<char> sets;  ///< of each number, whether a strip sets it
  };
  /// A strip on a frame.
  struct Playing {
    const Strip* strip = nullptr;
    const Strip* before = nullptr;  ///< its neighbors
    const Strip* after = nullptr;
    float influence = 0;
    float time = 0;
  };

  static std::optional<Playing> playing(std::span<const Strip> strips, float frame);
  static Playing at(const Strip& strip, float frame);
  void add(const Nla& nla, const Playing& playing, Layer& onto, std::size_t depth);
  void add_clip(const Nla& nla, const Playing& playing, Layer& onto, std::size_t depth);
  void add_transition(const Nla& nla, const Playing& playing, Layer& onto, std::size_t depth);
  void blend(const Nla& nla, const Layer& lower, const Layer& upper, StripBlend how, float influence, Layer& out);
  static const float* find(const Nla& nla, const Layer* layer, int property);
  void clear(Layer& layer, const Layer* below);
  static void ensure(const Nla& nla, Layer& layer, int property);

  Layer result_;
  std::array<Layer, 3> layers_;  ///< a transition's two ends, and a clip
  std::vector<char> is_known_;   ///< of each property, whether a strip has set it on this frame
};

}  // namespace sinew::rig
