#include "base/aligned.h"

#include <hwy/aligned_allocator.h>

#include <algorithm>
#include <limits>
#include <new>

namespace sinew {

void* detail::allocate_aligned(std::size_t count, std::size_t size) {
  if (count > std::numeric_limits<std::size_t>::max() / size) throw std::bad_alloc();
  void* const memory = hwy::AllocateAlignedBytes(std::max<std::size_t>(count, 1) * size, nullptr, nullptr);
  if (!memory) throw std::bad_alloc();
  return memory;
}

void detail::free_aligned(const void* memory) { hwy::FreeAlignedBytes(memory, nullptr, nullptr); }

}  // namespace sinew
