// Highway compiles this file once for each instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mush/implicit_smoothing_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes first.
#include <hwy/highway.h>

#include "mush/implicit_smoothing.h"

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::CappedTag<double, 4>;
constexpr Tag kTag;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kTag));
constexpr int kParts = kFields / kLanes;

void clenshaw_step(const ScaledRows& rows, const double* coefficients, double factor, const double* fields,
                   const double* now, double* next) {
  using Doubles = hn::Vec<Tag>;
  Doubles own[kParts];
  for (int part = 0; part < kParts; ++part) own[part] = hn::LoadU(kTag, coefficients + part * kLanes);
  for (std::size_t row = 0; row < rows.count(); ++row) {
    const std::size_t at = row * kFields;
    Doubles sum[kParts];
    for (int part = 0; part < kParts; ++part) sum[part] = hn::Zero(kTag);
    const auto add = [&](double value, const double* from) HWY_ATTR {
      const Doubles scale = hn::Set(kTag, value);
      for (int part = 0; part < kParts; ++part) {
        sum[part] = hn::MulAdd(scale, hn::LoadU(kTag, from + part * kLanes), sum[part]);
      }
    };
    add(rows.diagonal[row], now + at);
    for (std::uint32_t i = rows.begin[row]; i < rows.begin[row + 1]; ++i) {
      add(rows.values[i], now + std::size_t{rows.columns[i]} * kFields);
    }
    const Doubles twice = hn::Set(kTag, factor);
    for (int part = 0; part < kParts; ++part) {
      const std::size_t place = at + part * kLanes;
      const Doubles old = hn::MulSub(twice, sum[part], hn::LoadU(kTag, next + place));
      hn::StoreU(hn::MulAdd(own[part], hn::LoadU(kTag, fields + place), old), kTag, next + place);
    }
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sinew {

HWY_EXPORT(clenshaw_step);

void clenshaw_step(const ScaledRows& rows, const double* coefficients, double factor, const double* fields,
                   const double* now, double* next) {
  HWY_DYNAMIC_DISPATCH(clenshaw_step)(rows, coefficients, factor, fields, now, next);
}

}  // namespace sinew
#endif
