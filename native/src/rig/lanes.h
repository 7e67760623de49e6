/// Several numbers that go through the same computation side by side: each lane has the bits that it has alone.
///
/// What a computation decides by a number, it writes as either(condition, a, b), for one number or many.
#pragma once

#include <cmath>
#include <cstdint>

namespace sinew::rig {

inline double magnitude(double x) { return std::fabs(x); }
inline double root(double x) { return std::sqrt(x); }
inline double either(bool condition, double a, double b) { return condition ? a : b; }
inline bool is_either(bool a, bool b) { return a || b; }
inline bool is_any(bool condition) { return condition; }
inline bool is_every(bool condition) { return condition; }

/// P registers of two doubles, which all 64-bit machines have. The syntax is GCC's and Clang's.
template <int P>
class Lanes {
  using Pair = double __attribute__((vector_size(16)));
  using Bits = std::int64_t __attribute__((vector_size(16)));

 public:
  static constexpr int kCount = 2 * P;

  /// Of each lane, all bits or none.
  struct Mask {
    Bits pairs[P];

    friend Mask is_either(const Mask& a, const Mask& b) {
      return made([&](int i) { return a.pairs[i] | b.pairs[i]; });
    }
    friend bool is_any(const Mask& a) {
      Bits all = a.pairs[0];
      for (int i = 1; i < P; ++i) all |= a.pairs[i];
      return (all[0] | all[1]) != 0;
    }
    friend bool is_every(const Mask& a) {
      Bits all = a.pairs[0];
      for (int i = 1; i < P; ++i) all &= a.pairs[i];
      return (all[0] & all[1]) != 0;
    }

    template <class Make>
    static Mask made(const Make& make) {
      Mask mask;
      for (int i = 0; i < P; ++i) mask.pairs[i] = make(i);
      return mask;
    }
  };

  Lanes() = default;
  Lanes(double x) {  // NOLINT(google-explicit-constructor): as a number becomes a wider one
    for (Pair& pair : pairs_) pair = Pair{x, x};
  }

  /// kCount numbers.
  static Lanes read(const double* numbers) {
    return made([&](int i) { return Pair{numbers[2 * i], numbers[2 * i + 1]}; });
  }
  void write(double* numbers) const {
    for (int i = 0; i < kCount; ++i) numbers[i] = pairs_[i / 2][i % 2];
  }

  friend Lanes operator+(const Lanes& a, const Lanes& b) {
    return made([&](int i) { return a.pairs_[i] + b.pairs_[i]; });
  }
  friend Lanes operator-(const Lanes& a, const Lanes& b) {
    return made([&](int i) { return a.pairs_[i] - b.pairs_[i]; });
  }
  friend Lanes operator*(const Lanes& a, const Lanes& b) {
    return made([&](int i) { return a.pairs_[i] * b.pairs_[i]; });
  }
  friend Lanes operator/(const Lanes& a, const Lanes& b) {
    return made([&](int i) { return a.pairs_[i] / b.pairs_[i]; });
  }
  friend Lanes operator-(const Lanes& a) {
    return made([&](int i) { return -a.pairs_[i]; });
  }
  friend Mask operator<(const Lanes& a, const Lanes& b) {
    return Mask::made([&](int i) -> Bits { return a.pairs_[i] < b.pairs_[i]; });
  }
  friend Mask operator<=(const Lanes& a, const Lanes& b) {
    return Mask::made([&](int i) -> Bits { return a.pairs_[i] <= b.pairs_[i]; });
  }
  friend Mask operator==(const Lanes& a, const Lanes& b) {
    return Mask::made([&](int i) -> Bits { return a.pairs_[i] == b.pairs_[i]; });
  }
  friend Lanes magnitude(const Lanes& a) {
    constexpr Bits kWithoutSign = {INT64_MAX, INT64_MAX};
    return made([&](int i) { return reinterpret_cast<Pair>(reinterpret_cast<Bits>(a.pairs_[i]) & kWithoutSign); });
  }
  friend Lanes root(const Lanes& a) {
    return made([&](int i) { return Pair{std::sqrt(a.pairs_[i][0]), std::sqrt(a.pairs_[i][1])}; });
  }
  friend Lanes either(const Mask& condition, const Lanes& a, const Lanes& b) {
    return made([&](int i) {
      const Bits chosen = (reinterpret_cast<Bits>(a.pairs_[i]) & condition.pairs[i]) |
                          (reinterpret_cast<Bits>(b.pairs_[i]) & ~condition.pairs[i]);
      return reinterpret_cast<Pair>(chosen);
    });
  }

 private:
  template <class Make>
  static Lanes made(const Make& make) {
    Lanes lanes;
    for (int i = 0; i < P; ++i) lanes.pairs_[i] = make(i);
    return lanes;
  }

  Pair pairs_[P];
};

/// As std::max, also with numbers that are none.
template <class R>
R larger(const R& a, const R& b) {
  return either(a < b, b, a);
}

}  // namespace sinew::rig
