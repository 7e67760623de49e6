/// The library's only way to run work in parallel. Everything about TBB is in parallel.cpp.
#pragma once

#include <cstddef>

namespace sinew {

namespace detail {
using RangeBody = void (*)(const void* closure, std::size_t begin, std::size_t end);
void parallel_ranges(std::size_t count, std::size_t grain, RangeBody body, const void* closure);

/// Whether the system can start `count` more TBB threads, which it cannot without memory for their stacks. Tests it by
/// starting one thread with a stack as large as all of theirs together.
bool can_start(int count);
}  // namespace detail

/// Whether several threads are likely to finish sooner than one, which needs this many microseconds.
/// A sleeping thread has to be woken, one that has just worked does not, so the answer depends on
/// when the last parallel region ended. Always false if there is only one thread.
bool threads_pay(double microseconds);

/// While it lives, threads_pay() on this thread counts on threads being awake if so much work follows that it will wake
/// them anyway.
class WorkAhead {
 public:
  /// microseconds  that the work to come needs on one thread.
  explicit WorkAhead(double microseconds);
  WorkAhead(const WorkAhead&) = delete;
  ~WorkAhead();

 private:
  bool before_;
};

/// For tests: makes threads_pay return true however short the work is, or decide again as usual.
void set_threads_always_pay(bool always);

/// Calls body(begin, end) on disjoint ranges of at most `grain` items that together cover
/// [0, count), and returns when all have run. The ranges may run in parallel and in any order, so a
/// body must write only what belongs to its own range; then the result cannot depend on the number of
/// threads. With one range, or one thread, everything runs on the calling thread and TBB is not used.
/// An exception that a body throws, such as bad_alloc, is rethrown here once no range is running; some
/// ranges may then never have run.
template <class Body>
void parallel_for(std::size_t count, std::size_t grain, const Body& body) {
  detail::parallel_ranges(
      count, grain,
      [](const void* closure, std::size_t begin, std::size_t end) { (*static_cast<const Body*>(closure))(begin, end); },
      &body);
}

}  // namespace sinew
