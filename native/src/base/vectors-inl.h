// Vectors of three numbers, one in each lane. Included once for each instruction set.
#if defined(SINEW_VECTORS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SINEW_VECTORS_INL_H
#undef SINEW_VECTORS_INL_H
#else
#define SINEW_VECTORS_INL_H
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// V: one of Highway's vectors.
template <class V>
struct VectorsOf {
  V x, y, z;
};

template <class V>
HWY_INLINE VectorsOf<V> operator+(const VectorsOf<V>& a, const VectorsOf<V>& b) {
  return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}

template <class V>
HWY_INLINE VectorsOf<V> operator-(const VectorsOf<V>& a, const VectorsOf<V>& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}

template <class V>
HWY_INLINE VectorsOf<V> operator*(const VectorsOf<V>& a, V f) {
  return {hn::Mul(a.x, f), hn::Mul(a.y, f), hn::Mul(a.z, f)};
}

template <class V>
HWY_INLINE V dot(const VectorsOf<V>& a, const VectorsOf<V>& b) {
  return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}

template <class V>
HWY_INLINE VectorsOf<V> cross(const VectorsOf<V>& a, const VectorsOf<V>& b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)), hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}

template <class Mask, class V>
HWY_INLINE VectorsOf<V> choose(Mask mask, const VectorsOf<V>& yes, const VectorsOf<V>& no) {
  return {hn::IfThenElse(mask, yes.x, no.x), hn::IfThenElse(mask, yes.y, no.y), hn::IfThenElse(mask, yes.z, no.z)};
}

template <class D>
HWY_INLINE VectorsOf<hn::Vec<D>> zeros(D d) {
  return {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
}

/// Returns vectors of length 1; zeros where the squared length is not above `shortest`, also where a number is NaN.
template <class D>
HWY_INLINE VectorsOf<hn::Vec<D>> directions(D d, const VectorsOf<hn::Vec<D>>& a, hn::TFromD<D> shortest) {
  const auto squared = dot(a, a);
  const auto inverse = hn::Div(hn::Set(d, 1), hn::Sqrt(squared));
  return choose(hn::Gt(squared, hn::Set(d, shortest)), a * inverse, zeros(d));
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew
HWY_AFTER_NAMESPACE();
#endif
