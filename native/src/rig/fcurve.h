/// F-curves: a number over time, with the bits that Blender computes.
#pragma once

#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "sinew/rig_description.h"

namespace sinew::rig {

/// Returns what a property holds after `value` was written to it. low, high  its limits, of numbers.
float stored_value(ValueKind kind, float low, float high, float value);

/// A curve, ready to be evaluated. Immutable.
class FCurve {
 public:
  FCurve() = default;

  /// kind  the type of what the curve sets: curves of whole numbers are rounded, those of booleans and choices step.
  /// Throws InputError for a number that is not finite, for keys that are not in order, and if Cycles is not the first
  /// modifier or does not act everywhere.
  explicit FCurve(const CurveDescription& data, ValueKind kind = ValueKind::real);

  /// The last polynomial of a time that was solved. Channels that are keyed together have the same ones.
  struct KnownRoot {
    std::array<float, 3> time = {};  ///< see Part
    float constant = 0;
    bool is_known = false;
    std::optional<float> root;
  };

  /// Returns the value at a time in frames. A curve without keys is `without_keys`, then the modifiers act.
  ///
  /// known  of the curve before, or null.
  float value(float time, float without_keys = 0, KnownRoot* known = nullptr) const;

  bool has_keys() const { return !frames_.empty(); }

  /// Whether the value is `without_keys` at all times.
  bool is_empty() const { return frames_.empty() && modifiers_.empty() && !is_rounded_; }

 private:
  /// The part of the curve from one key to the next. Small: a rig has thousands, which are not in the caches.
  struct Part {
    KeyInterpolation interpolation;
    KeyEasing easing;
    bool is_flat;  // of a Bezier curve: without height
    float begin;   // value
    float change;  // of the value until the next key
    float duration;
    // Bezier: the polynomials of the value and of the time, without their constant terms, from the linear one on. Else
    // amplitude, period and back.
    std::array<float, 3> height;
    std::array<float, 3> time;
  };

  float of_keys(float time, KnownRoot* known) const;
  float outside(float time, bool is_before) const;
  float inside(std::size_t part, float time, KnownRoot* known) const;
  std::pair<float, float> cycled(const CurveModifier& cycles, float time) const;
  float modified(float time, float without_keys, KnownRoot* known) const;
  static Part part_of(const CurveKey& key, const CurveKey& next);
  static std::optional<float> root_of(double cubic, double square, double slope, double constant);
  static float bezier(const Part& part, float time_left, KnownRoot* known);

  float first_value() const { return parts_.empty() ? last_value_ : parts_.front().begin; }
  float value_of_key(std::size_t key) const { return key < parts_.size() ? parts_[key].begin : last_value_; }

  std::vector<float> frames_;
  std::vector<Part> parts_;
  float last_value_ = 0;
  std::array<float, 2> slopes_{};  // before the first and after the last key
  std::vector<CurveModifier> modifiers_;
  bool has_steps_ = false;
  bool is_rounded_ = false;
};

}  // namespace sinew::rig
