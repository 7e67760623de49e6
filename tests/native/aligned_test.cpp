#include "base/aligned.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <new>

namespace sinew {
namespace {

TEST(Aligned, BeginsWhereARegisterMay) {
  for (const std::size_t count : {0, 1, 7, 4096}) {
    const auto numbers = aligned<float>(count);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(numbers.get()) % 64, 0u);
    for (std::size_t i = 0; i < count; ++i) numbers[i] = 1;
  }
}

TEST(Aligned, MemoryThatCannotBeHadIsAnException) {
  constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
  EXPECT_THROW(aligned<float>(kAll / 8), std::bad_alloc);
  EXPECT_THROW(aligned<float>(kAll / 2), std::bad_alloc);  // more bytes than can be counted
}

}  // namespace
}  // namespace sinew
