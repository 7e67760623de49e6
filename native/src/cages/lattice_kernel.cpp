// Highway compiles this file once for each instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cages/lattice_kernel.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes first.
#include <hwy/highway.h>

#include "cages/lattice_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kNumbers = LatticeBlock::kNumbers, kRow = LatticeBlock::kMost * kNumbers;

using Wide = hn::CappedTag<float, kRow>;
using Point = hn::CappedTag<float, kNumbers>;
using Floats = hn::Vec<Wide>;

/// Rows of so many registers.
template <std::size_t registers>
HWY_INLINE void sum_rows(const LatticeBlock& block, float* HWY_RESTRICT sum) {
  constexpr Wide wide;
  constexpr std::size_t kLanes = hn::MaxLanes(wide);
  Floats total = hn::Zero(wide);
  for (std::size_t k = 0; k < block.counts[2]; ++k) {
    const float* row = block.first + k * block.layer_size;
    Floats of_layer = hn::Zero(wide);
    for (std::size_t j = 0; j < block.counts[1]; ++j, row += block.row_size) {
      Floats of_row = hn::Mul(hn::Load(wide, block.along_u), hn::LoadU(wide, row));
      for (std::size_t r = 1; r < registers; ++r) {
        of_row = hn::MulAdd(hn::Load(wide, block.along_u + r * kLanes), hn::LoadU(wide, row + r * kLanes), of_row);
      }
      of_layer = hn::MulAdd(hn::Set(wide, block.along_v[j]), of_row, of_layer);
    }
    total = hn::MulAdd(hn::Set(wide, block.along_w[k]), of_layer, total);
  }
  alignas(64) float lanes[kRow];
  hn::Store(total, wide, lanes);
  constexpr Point point;
  auto folded = hn::Load(point, lanes);
  for (std::size_t i = kNumbers; i < kLanes; i += kNumbers) folded = hn::Add(folded, hn::Load(point, lanes + i));
  hn::StoreU(folded, point, sum);
}

void sum_block(const LatticeBlock& block, float* HWY_RESTRICT sum) {
  constexpr std::size_t kLanes = hn::MaxLanes(Wide());
  switch ((block.counts[0] * kNumbers + kLanes - 1) / kLanes) {
    case 1:
      return sum_rows<1>(block, sum);
    case 2:
      return sum_rows<2>(block, sum);
    case 3:
      return sum_rows<3>(block, sum);
    default:
      return sum_rows<4>(block, sum);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sinew {

HWY_EXPORT(sum_block);

void sum_block(const LatticeBlock& block, float* sum) { HWY_DYNAMIC_DISPATCH(sum_block)(block, sum); }

}  // namespace sinew
#endif
