/// F-curves: a number over time, with the bits that Blender computes.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

namespace sinew {

/// How a curve goes from a key to the next one.
enum class Interpolation : std::uint8_t {
  constant,
  linear,
  bezier,
  sine,
  quad,
  cubic,
  quart,
  quint,
  expo,
  circ,
  back,
  bounce,
  elastic
};

/// Which end of an interpolation other than constant, linear and Bezier is slow. Automatic is out for back, bounce and
/// elastic, and in for the others.
enum class Easing : std::uint8_t { automatic, in, out, in_out };

/// A point of a curve. The arrays hold frame and value.
struct CurveKey {
  std::array<float, 2> left{};
  std::array<float, 2> at{};
  std::array<float, 2> right{};
  Interpolation interpolation = Interpolation::bezier;
  Easing easing = Easing::automatic;
  float amplitude = 0;  ///< of elastic; 0 is the smallest that reaches the next key
  float period = 0;     ///< of elastic, in frames; 0 is a part of the time between the keys
  float back = 1.70158f;

  bool operator==(const CurveKey&) const = default;
};

/// What a curve does beyond its first or last key.
enum class CycleMode : std::uint8_t { none, repeat, repeat_with_offset, mirror };

/// The modifier Cycles. A count of 0 has no end.
struct CurveCycles {
  CycleMode before = CycleMode::repeat;
  CycleMode after = CycleMode::repeat;
  std::int32_t count_before = 0;
  std::int32_t count_after = 0;

  bool operator==(const CurveCycles&) const = default;
};

/// The modifier Generator: a polynomial of the time, added to the curve or instead of it.
struct CurveGenerator {
  std::vector<float> coefficients;  ///< of t^0, t^1, ...
  bool is_additive = false;

  bool operator==(const CurveGenerator&) const = default;
};

/// The data of a curve. `cycles` acts before the generators.
struct FCurveData {
  std::vector<CurveKey> keys;      ///< their frames never decrease
  bool is_linear_outside = false;  ///< goes on with the slope of its end; otherwise with the end's value
  std::optional<CurveCycles> cycles;
  std::vector<CurveGenerator> generators;

  bool operator==(const FCurveData&) const = default;
};

/// The type of a property.
enum class ValueKind : std::uint8_t { real, integer, boolean, enumeration };

/// A property that curves and drivers set: its type and limits.
struct PropertyType {
  ValueKind kind = ValueKind::real;
  float lowest = -std::numeric_limits<float>::max();
  float highest = std::numeric_limits<float>::max();

  /// Returns what the property holds after `value` was written to it.
  float stored(float value) const;

  bool operator==(const PropertyType&) const = default;
};

/// A curve, ready to be evaluated. Immutable.
class FCurve {
 public:
  /// kind  the type of what the curve sets: curves of integers are rounded, those of booleans and enumerations step.
  /// Throws InputError for a number that is not finite and for keys that are not in order.
  explicit FCurve(const FCurveData& data, ValueKind kind = ValueKind::real);

  /// Returns the value at a time in frames. A curve without keys is `without_keys`, then the generators act.
  float value(float time, float without_keys = 0) const;

 private:
  /// The part of the curve from one key to the next.
  struct Part {
    Interpolation interpolation;
    Easing easing;
    bool is_flat;  // of a Bezier curve: without height
    float begin;   // value
    float change;  // of the value until the next key
    float duration;
    float amplitude, period, back;
    std::array<float, 3> height;  // Bezier: the value's polynomial, without the constant term
    // Bezier: the time's polynomial is divided by its cubic coefficient and has the roots of x^3 + 3 p x + 2 q, moved
    // by -a. Without a cubic term `cubic` is 0.
    double cubic, square, slope, a, p, p_cubed, q_base;
  };

  float of_keys(float time) const;
  float outside(float time, bool is_before) const;
  float inside(std::size_t part, float time) const;
  std::pair<float, float> cycled(float time) const;
  static Part part_of(const CurveKey& key, const CurveKey& next);
  static float bezier(const Part& part, float time_left);

  std::vector<float> frames_;
  std::vector<Part> parts_;
  std::vector<float> values_;
  std::array<float, 2> slopes_{};  // before the first and after the last key
  std::optional<CurveCycles> cycles_;
  std::vector<CurveGenerator> generators_;
  bool has_steps_ = false;
  bool is_rounded_ = false;
};

}  // namespace sinew
