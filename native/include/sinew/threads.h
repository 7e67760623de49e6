/// How many threads the library may use.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace sinew {

/// Lets every later call use at most `count` threads, the calling one included, and never more than
/// the machine has; 0 means as many as it has. Safe at any time and from any thread: running calls
/// keep their limit. Results never depend on it. Throws InputError if count is negative.
void set_thread_count(int count);

/// Returns the number of threads that the next call may use, at least 1.
int thread_count();

/// Calls work(i) for each i in [0, count), in any order and on several threads, and returns when all calls have ended. A
/// call must write only what no other one touches. For works of some 20 microseconds and more. An exception that one of
/// them throws is rethrown here; some may then never have run.
void run_parallel(std::size_t count, const std::function<void(std::size_t)>& work);

/// Works that other threads do while the caller does something else. A work must not throw.
class Meanwhile {
 public:
  /// Has work(i) called for each i in [0, count). What no thread has begun until then, wait() does.
  Meanwhile(std::size_t count, std::function<void(std::size_t)> work);
  Meanwhile(const Meanwhile&) = delete;
  /// Waits for the works that have begun, and leaves out the others.
  ~Meanwhile();
  /// Returns when all works are done.
  void wait();

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace sinew
