// Highway compiles this file once for each instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cages/mesh_deform_kernel.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes first.
#include <hwy/highway.h>

#include "cages/mesh_deform_kernel.h"

// CMakeLists.txt has this file compiled without fused multiply-adds: Blender rounds in between.

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kVertices = CagedBlock::kVertices;

using Wide = hn::CappedTag<float, kVertices>;
using Floats = hn::Vec<Wide>;

template <bool is_finite>
HWY_INLINE void sum_all(const CagedBlock& block, const float* HWY_RESTRICT moved, float* HWY_RESTRICT sums) {
  constexpr Wide wide;
  constexpr std::size_t kLanes = hn::MaxLanes(wide), kRegisters = kVertices / kLanes;
  const Floats zero = hn::Zero(wide);
  Floats totals[3][kRegisters];
  for (auto& axis : totals) {
    for (Floats& total : axis) total = zero;
  }
  const float* HWY_RESTRICT weights = block.weights;
  for (const std::uint32_t place : block.cage) {
    const Floats point[3] = {hn::Set(wide, moved[place]), hn::Set(wide, moved[place + 1]),
                             hn::Set(wide, moved[place + 2])};
    for (std::size_t r = 0; r < kRegisters; ++r) {
      const Floats weight = hn::Load(wide, weights + r * kLanes);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        Floats share = hn::Mul(weight, point[axis]);
        // 0 times infinity is not a number.
        if constexpr (!is_finite) share = hn::IfThenElseZero(hn::Ne(weight, zero), share);
        totals[axis][r] = hn::Add(totals[axis][r], share);
      }
    }
    weights += kVertices;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t r = 0; r < kRegisters; ++r) hn::Store(totals[axis][r], wide, sums + axis * kVertices + r * kLanes);
  }
}

void sum_block(const CagedBlock& block, const float* moved, bool is_finite, float* sums) {
  if (is_finite) {
    sum_all<true>(block, moved, sums);
  } else {
    sum_all<false>(block, moved, sums);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sinew {

HWY_EXPORT(sum_block);

void sum_influences(const CagedBlock& block, const float* moved, bool is_finite, float* sums) {
  HWY_DYNAMIC_DISPATCH(sum_block)(block, moved, is_finite, sums);
}

}  // namespace sinew
#endif
