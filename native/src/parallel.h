/// The library's only way to run things at once. Everything about TBB stands in parallel.cpp.
#pragma once

#include <cstddef>

namespace sinew {

namespace detail {
using RangeBody = void (*)(const void* closure, std::size_t begin, std::size_t end);
void parallel_ranges(std::size_t count, std::size_t grain, RangeBody body, const void* closure);
}  // namespace detail

/// Calls body(begin, end) on disjoint ranges of at most `grain` items that together cover
/// [0, count), and returns when all have run. The ranges may run at once and in any order, so a
/// body writes only what belongs to its own range; then the result cannot depend on the number of
/// threads. With one range, or one thread, all runs on the calling thread and TBB is not touched.
/// `body` must not throw.
template <class Body>
void parallel_for(std::size_t count, std::size_t grain, const Body& body) {
  detail::parallel_ranges(
      count, grain,
      [](const void* closure, std::size_t begin, std::size_t end) {
        (*static_cast<const Body*>(closure))(begin, end);
      },
      &body);
}

}  // namespace sinew
