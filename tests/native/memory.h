/// What a call takes from memory, as the address sanitizer's allocator sees it.
#pragma once

#if defined(__SANITIZE_ADDRESS__)
#define SINEW_COUNTS_MEMORY 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define SINEW_COUNTS_MEMORY 1
#endif
#endif

#ifdef SINEW_COUNTS_MEMORY
#include <cstddef>

// GCC has the function, but not the header that declares it.
extern "C" int __sanitizer_install_malloc_and_free_hooks(void (*taken)(const volatile void*, std::size_t),
                                                         void (*given_back)(const volatile void*));

namespace sinew {

/// Bytes that the call allocates on this thread, one request after the other, whether they are freed meanwhile or not:
/// no call can do much more work than it has memory for.
template <class Call>
std::size_t bytes_allocated_by(const Call& call) {
  static thread_local std::size_t bytes = 0;
  [[maybe_unused]] static const int installed = __sanitizer_install_malloc_and_free_hooks(
      [](const volatile void*, std::size_t size) { bytes += size; }, [](const volatile void*) {});
  const std::size_t before = bytes;
  call();
  return bytes - before;
}

/// What a reader may allocate for files of that many bytes together. A line of ten bytes may be a joint with its four
/// matrices; the rest is for streams and messages.
constexpr std::size_t most_bytes_to_read(std::size_t file_bytes) { return 512 * file_bytes + (64 << 10); }

}  // namespace sinew
#endif
