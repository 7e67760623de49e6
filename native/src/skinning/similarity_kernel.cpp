// Highway compiles this file once for each instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "skinning/similarity_kernel.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes first.
#include <hwy/highway.h>

#include "skinning/similarity_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::CappedTag<float, kCellLanes>;
using Floats = hn::Vec<Tag>;
constexpr Tag kTag;

/// exp(x) for x <= 0, with a relative error of about 2e-7; 0 below -87.
HWY_INLINE Floats exponential(Floats x) {
  const auto too_small = hn::Lt(x, hn::Set(kTag, -87.0f));
  x = hn::Max(x, hn::Set(kTag, -87.0f));
  const Floats n = hn::Round(hn::Mul(x, hn::Set(kTag, 1.44269504f)));
  // ln 2 in two parts, the first of which times n is exact.
  Floats r = hn::NegMulAdd(n, hn::Set(kTag, 0.693359375f), x);
  r = hn::NegMulAdd(n, hn::Set(kTag, -2.12194440e-4f), r);
  Floats sum = hn::Set(kTag, 1.0f / 720);
  for (const float factor : {1.0f / 120, 1.0f / 24, 1.0f / 6, 0.5f, 1.0f, 1.0f}) {
    sum = hn::MulAdd(sum, r, hn::Set(kTag, factor));
  }
  const hn::RebindToSigned<Tag> integers;
  const auto exponent = hn::ShiftLeft<23>(hn::Add(hn::ConvertTo(integers, n), hn::Set(integers, 127)));
  return hn::IfThenZeroElse(too_small, hn::Mul(sum, hn::BitCast(kTag, exponent)));
}

std::array<float, 4> similar_sum(float x, float y, const float* cells, std::size_t length) {
  constexpr std::size_t kLanes = hn::MaxLanes(kTag);
  const Floats own_x = hn::Set(kTag, x), own_y = hn::Set(kTag, y);
  Floats sums[4] = {hn::Zero(kTag), hn::Zero(kTag), hn::Zero(kTag), hn::Zero(kTag)};
  for (std::size_t i = 0; i < length; i += kLanes) {
    const Floats across = hn::Mul(own_y, hn::LoadU(kTag, cells + i));
    const Floats apart = hn::MulSub(own_x, hn::LoadU(kTag, cells + length + i), across);
    const Floats likeness = exponential(hn::Neg(hn::Mul(apart, apart)));
    for (int part = 0; part < 4; ++part) {
      sums[part] = hn::MulAdd(likeness, hn::LoadU(kTag, cells + (2 + part) * length + i), sums[part]);
    }
  }
  std::array<float, 4> result;
  for (int part = 0; part < 4; ++part) {
    HWY_ALIGN float lanes[kLanes];
    hn::Store(sums[part], kTag, lanes);
    result[part] = 0;
    for (const float lane : lanes) result[part] += lane;
  }
  return result;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sinew {

HWY_EXPORT(similar_sum);

std::array<float, 4> similar_sum(float x, float y, const float* cells, std::size_t length) {
  return HWY_DYNAMIC_DISPATCH(similar_sum)(x, y, cells, length);
}

}  // namespace sinew
#endif
