#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "peak.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes first.
#include <hwy/highway.h>

#include <algorithm>
#include <chrono>

#include "peak.h"

HWY_BEFORE_NAMESPACE();
namespace sinew::bench {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Two units, each four cycles from start to end, are busy with eight that do not wait for each
// other.
constexpr int kAtOnce = 10;
constexpr int kRounds = 1'000'000;

double one_try() {
  const hn::CappedTag<float, 16> tag;
  // Ten different numbers: of equal ones the compiler would keep one.
  auto a = hn::Iota(tag, 1.0f), b = hn::Iota(tag, 2.0f), c = hn::Iota(tag, 3.0f);
  auto d = hn::Iota(tag, 4.0f), e = hn::Iota(tag, 5.0f), f = hn::Iota(tag, 6.0f);
  auto g = hn::Iota(tag, 7.0f), h = hn::Iota(tag, 8.0f), i = hn::Iota(tag, 9.0f);
  auto j = hn::Iota(tag, 10.0f);
  const auto factor = hn::Set(tag, 1.0f - 1e-7f), term = hn::Set(tag, 1e-9f);
  const auto begin = std::chrono::steady_clock::now();
  for (int round = 0; round < kRounds; ++round) {
    a = hn::MulAdd(a, factor, term), b = hn::MulAdd(b, factor, term);
    c = hn::MulAdd(c, factor, term), d = hn::MulAdd(d, factor, term);
    e = hn::MulAdd(e, factor, term), f = hn::MulAdd(f, factor, term);
    g = hn::MulAdd(g, factor, term), h = hn::MulAdd(h, factor, term);
    i = hn::MulAdd(i, factor, term), j = hn::MulAdd(j, factor, term);
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  const auto sum =
      hn::Add(hn::Add(hn::Add(hn::Add(a, b), hn::Add(c, d)), hn::Add(e, f)), hn::Add(hn::Add(g, h), hn::Add(i, j)));
  // The sum is read, so the loop is not dropped.
  const bool positive = hn::GetLane(sum) > 0;
  return positive * static_cast<double>(hn::Lanes(tag)) * kAtOnce * kRounds / took.count();
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew::bench
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sinew::bench {

HWY_EXPORT(one_try);

double multiply_adds_a_second() {
  double best = 0;
  for (int i = 0; i < 9; ++i) best = std::max(best, HWY_DYNAMIC_DISPATCH(one_try)());
  return best;
}

}  // namespace sinew::bench
#endif
