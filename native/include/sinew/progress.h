/// The progress of a long computation, and a way to cancel it.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <limits>

namespace sinew {

/// Shared by the thread that computes and those that watch. Any of them may call any function at any time.
class Progress {
 public:
  /// 0 to 1; never decreases during a computation.
  double fraction() const {
    const auto total = total_.load(std::memory_order_relaxed);
    if (total == 0) return 0;
    const auto done = done_.load(std::memory_order_relaxed);
    return std::min(1.0, static_cast<double>(done) / static_cast<double>(total));
  }

  /// Asks the running computation, or the next one, to stop soon without a result.
  void cancel() { cancel_after(0); }
  /// The same once it has looked so many times, for tests.
  void cancel_after(std::int64_t looks) { looks_left_.store(looks, std::memory_order_relaxed); }
  bool is_cancelled() const { return looks_left_.fetch_sub(1, std::memory_order_relaxed) <= 0; }

  /// For the computation: start() sets the number of steps ahead, advance() counts those that are done.
  void start(std::int64_t steps) {
    done_.store(0, std::memory_order_relaxed);
    total_.store(steps, std::memory_order_relaxed);
  }
  void advance(std::int64_t steps) { done_.fetch_add(steps, std::memory_order_relaxed); }

 private:
  std::atomic<std::int64_t> total_ = 0, done_ = 0;
  mutable std::atomic<std::int64_t> looks_left_ = std::numeric_limits<std::int64_t>::max();
};

}  // namespace sinew
