#include "base/parallel.h"

#ifndef _WIN32
#include <pthread.h>
#endif
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>

#include "base/check.h"
#include "base/per_thread.h"
#include "sinew/threads.h"

namespace sinew {
namespace {

int machine_threads() { return oneapi::tbb::info::default_concurrency(); }

// An arena of our own, so that neither its size nor its work mixes with other users of TBB in the
// process, such as Blender. It never has more threads than the machine: TBB has no more workers, would
// warn on stderr and would take memory for each.
class Pool {
 public:
  explicit Pool(int threads) : threads_(threads), arena_(threads) {}
  int threads() const { return threads_; }

  /// Whether workers can be started. Call it before run: if a worker cannot be started, TBB throws and leaves tasks
  /// behind that refer to objects already destroyed.
  bool has_workers() {
    if (!has_workers_) has_workers_ = detail::can_start(threads_ - 1);
    return has_workers_;
  }

  template <class Work>
  void enqueue(const Work& work) {
    arena_.enqueue(work);
  }

  template <class Chunk>
  void run(std::size_t chunks, const Chunk& chunk) {
    arena_.execute(
        [&] { oneapi::tbb::parallel_for(std::size_t{0}, chunks, chunk, oneapi::tbb::simple_partitioner()); });
  }

 private:
  int threads_;
  std::atomic<bool> has_workers_ = false;
  oneapi::tbb::task_arena arena_;
};

std::mutex pool_mutex;
// Guarded by pool_mutex; a running call keeps its own reference. Never destroyed: when a process ends, its destructors
// run while other threads may still compute.
std::shared_ptr<Pool>& pool = *new std::shared_ptr<Pool>;

// Workers go to sleep about this long after they run out of work.
constexpr std::chrono::microseconds kAwakeFor(100);

// Work that takes one thread this long takes two threads no longer. Measured on two cores of a virtual
// machine: linear skinning on one thread, on two that are awake; after a sleep of 3 ms, on one and on two:
//   34,522 vertices     56   38    112   116 us
//   138,530            220  130    361   370 us
//   553,826            960  530   1220  1120 us
//   2,215,010         4000 2700   4600  3300 us
constexpr double kPaysAwake = 30, kPaysAsleep = 500;  // microseconds

std::atomic<std::chrono::steady_clock::time_point> last_region_end{};

std::atomic<bool> always_pay = false;

/// Of the calling thread, see WorkAhead.
struct Ahead {
  bool wakes_threads = false;
};
bool& wakes_threads() { return per_thread<Ahead>().wakes_threads; }

std::shared_ptr<Pool> current_pool() {
  const std::lock_guard lock(pool_mutex);
  if (!pool) pool = std::make_shared<Pool>(machine_threads());
  return pool;
}

}  // namespace

void set_thread_count(int count) {
  if (count < 0) fail("the thread count is ", count, "; expected 0 (all) or a positive number");
  const int most = machine_threads();
  auto fresh = std::make_shared<Pool>(count == 0 ? most : std::min(count, most));
  const std::lock_guard lock(pool_mutex);
  pool.swap(fresh);
}

int thread_count() { return current_pool()->threads(); }

void run_parallel(std::size_t count, const std::function<void(std::size_t)>& work) {
  parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) work(i);
  });
}

struct Meanwhile::State {
  State(std::size_t works, std::function<void(std::size_t)> one) : count(works), work(std::move(one)) {}

  void run() {
    for (std::size_t i = next.fetch_add(1); i < count; i = next.fetch_add(1)) {
      work(i);
      done.fetch_add(1);
      done.notify_all();
    }
  }

  // Not by std::condition_variable, whose wait() would need the libstdc++ of GCC 12.
  void await(std::size_t begun) {
    for (std::size_t now = done.load(); now < begun; now = done.load()) done.wait(now);
  }

  const std::size_t count;
  const std::function<void(std::size_t)> work;
  std::atomic<std::size_t> next = 0;
  std::atomic<std::size_t> done = 0;
};

Meanwhile::Meanwhile(std::size_t count, std::function<void(std::size_t)> work)
    : state_(std::make_shared<State>(count, std::move(work))) {
  const std::shared_ptr<Pool> threads = current_pool();
  if (threads->threads() == 1 || !threads->has_workers()) return;
  const std::size_t most = static_cast<std::size_t>(threads->threads()) - 1;
  try {
    for (std::size_t i = 0; i < std::min(count, most); ++i) threads->enqueue([state = state_] { state->run(); });
  } catch (...) {  // no memory for the next one: wait() does what those that were begun do not
  }
}

Meanwhile::~Meanwhile() { state_->await(std::min(state_->next.exchange(state_->count), state_->count)); }

void Meanwhile::wait() {
  state_->run();
  state_->await(state_->count);
}

WorkAhead::WorkAhead(double microseconds) : before_(wakes_threads()) {
  if (microseconds >= kPaysAsleep) wakes_threads() = true;
}

WorkAhead::~WorkAhead() { wakes_threads() = before_; }

void set_threads_always_pay(bool always) { always_pay = always; }

bool threads_pay(double microseconds) {
  if (always_pay) return true;
  if (microseconds < kPaysAwake || thread_count() == 1) return false;
  if (microseconds >= kPaysAsleep || wakes_threads()) return true;
  return std::chrono::steady_clock::now() - last_region_end.load(std::memory_order_relaxed) < kAwakeFor;
}

bool detail::can_start([[maybe_unused]] int count) {
#ifdef _WIN32  // where stacks are not allocated like this
  try {
    std::thread([] {}).join();
    return true;
  } catch (const std::exception&) {
    return false;
  }
#else
  const std::size_t stack = oneapi::tbb::global_control::active_value(oneapi::tbb::global_control::thread_stack_size);
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_t thread;
  const bool started = pthread_attr_setstacksize(&attributes, count * stack) == 0 &&
                       pthread_create(
                           &thread, &attributes, [](void*) -> void* { return nullptr; }, nullptr) == 0;
  pthread_attr_destroy(&attributes);
  if (started) pthread_join(thread, nullptr);
  return started;
#endif
}

void detail::parallel_ranges(std::size_t count, std::size_t grain, RangeBody body, const void* closure) {
  if (count == 0) return;
  const std::size_t chunks = (count + grain - 1) / grain;
  if (chunks == 1) return body(closure, 0, count);
  const std::shared_ptr<Pool> threads = current_pool();
  if (threads->threads() == 1 || !threads->has_workers()) return body(closure, 0, count);
  threads->run(chunks, [=](std::size_t chunk) { body(closure, chunk * grain, std::min(count, (chunk + 1) * grain)); });
  last_region_end.store(std::chrono::steady_clock::now(), std::memory_order_relaxed);
}

}  // namespace sinew
