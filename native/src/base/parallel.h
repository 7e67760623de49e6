/// The library's only way to run things at once. Everything about TBB stands in parallel.cpp.
#pragma once

#include <cstddef>

namespace sinew {

namespace detail {
using RangeBody = void (*)(const void* closure, std::size_t begin, std::size_t end);
void parallel_ranges(std::size_t count, std::size_t grain, RangeBody body, const void* closure);

/// Whether the system gives that many threads of TBB's more, as it does not without memory for their stacks: starts
/// one, with a stack as large as all of theirs.
bool can_start(int count);
}  // namespace detail

/// Whether threads are likely to finish work sooner that takes one thread so long. A thread that
/// sleeps has to be woken, one that has just worked has not: so it depends on when the last region
/// ended. Says no where there is but one thread.
bool threads_pay(double microseconds);

/// For tests: from now on threads_pay says yes however short the work, or looks at it again.
void set_threads_always_pay(bool always);

/// Calls body(begin, end) on disjoint ranges of at most `grain` items that together cover
/// [0, count), and returns when all have run. The ranges may run at once and in any order, so a
/// body writes only what belongs to its own range; then the result cannot depend on the number of
/// threads. With one range, or one thread, all runs on the calling thread and TBB is not touched.
/// What a body throws, such as bad_alloc, comes out here when no range runs any more; some ranges
/// may not have run then.
template <class Body>
void parallel_for(std::size_t count, std::size_t grain, const Body& body) {
  detail::parallel_ranges(
      count, grain,
      [](const void* closure, std::size_t begin, std::size_t end) { (*static_cast<const Body*>(closure))(begin, end); },
      &body);
}

}  // namespace sinew
