/// Memory aligned for loading SIMD registers.
#pragma once

#include <cstddef>
#include <memory>

namespace sinew {

namespace detail {
void* allocate_aligned(std::size_t count, std::size_t size);
void free_aligned(const void* memory);
}  // namespace detail

struct AlignedFree {
  void operator()(const void* memory) const { detail::free_aligned(memory); }
};

/// Numbers, or arrays of numbers.
template <class T>
using Aligned = std::unique_ptr<T[], AlignedFree>;

/// Allocates uninitialised memory for `count` T; count may be 0. Throws bad_alloc.
template <class T>
Aligned<T> aligned(std::size_t count) {
  return Aligned<T>(static_cast<T*>(detail::allocate_aligned(count, sizeof(T))));
}

}  // namespace sinew
