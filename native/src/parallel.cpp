#include "parallel.h"

#include <algorithm>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "check.h"
#include "sinew/threads.h"

#ifndef SINEW_STD_THREADS
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>
#endif

namespace sinew {
namespace {

#ifdef SINEW_STD_THREADS

// For the thread sanitizer, which cannot see the synchronisation inside TBB's own, uninstrumented
// library and would report it as races: the same ranges, dealt to plain threads.
class Pool {
 public:
  explicit Pool(int threads) : threads_(threads) {}
  int threads() const { return threads_; }

  template <class Chunk>
  void run(std::size_t chunks, const Chunk& chunk) const {
    const std::size_t count = std::min<std::size_t>(threads_, chunks);
    std::vector<std::jthread> workers;
    for (std::size_t worker = 0; worker < count; ++worker) {
      workers.emplace_back([&, worker] {
        for (std::size_t c = worker; c < chunks; c += count) chunk(c);
      });
    }
  }

 private:
  int threads_;
};

int machine_threads() { return std::max(4, static_cast<int>(std::thread::hardware_concurrency())); }

#else

int machine_threads() { return oneapi::tbb::info::default_concurrency(); }

// An arena of our own: neither its size nor its work mixes with other users of TBB in the process,
// Blender among them. TBB has no more workers than the machine has threads; it warns on stderr, and
// takes memory for each, when an arena asks for more.
class Pool {
 public:
  explicit Pool(int threads) : threads_(threads), arena_(std::min(threads, machine_threads())) {}
  int threads() const { return threads_; }

  template <class Chunk>
  void run(std::size_t chunks, const Chunk& chunk) {
    arena_.execute([&] {
      oneapi::tbb::parallel_for(std::size_t{0}, chunks, chunk, oneapi::tbb::simple_partitioner());
    });
  }

 private:
  int threads_;
  oneapi::tbb::task_arena arena_;
};

#endif

std::mutex pool_mutex;
std::shared_ptr<Pool> pool;  // guarded by pool_mutex; a call in flight keeps its own reference

std::shared_ptr<Pool> current_pool() {
  const std::lock_guard lock(pool_mutex);
  if (!pool) pool = std::make_shared<Pool>(machine_threads());
  return pool;
}

}  // namespace

void set_thread_count(int count) {
  if (count < 0) fail("the thread count is ", count, "; expected 0 (all) or a positive number");
  auto fresh = std::make_shared<Pool>(count == 0 ? machine_threads() : count);
  const std::lock_guard lock(pool_mutex);
  pool.swap(fresh);
}

int thread_count() { return current_pool()->threads(); }

void detail::parallel_ranges(std::size_t count, std::size_t grain, RangeBody body,
                             const void* closure) {
  if (count == 0) return;
  const std::size_t chunks = (count + grain - 1) / grain;
  if (chunks == 1) return body(closure, 0, count);
  const std::shared_ptr<Pool> threads = current_pool();
  if (threads->threads() == 1) return body(closure, 0, count);
  threads->run(chunks, [=](std::size_t chunk) {
    body(closure, chunk * grain, std::min(count, (chunk + 1) * grain));
  });
}

}  // namespace sinew
