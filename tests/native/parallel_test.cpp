#include "base/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <limits>
#include <new>
#include <thread>
#include <vector>

#include "failures.h"

// Sanitizers stand in for the same function.
#if defined(__linux__) && defined(__GLIBC__) && !defined(__SANITIZE_THREAD__) && !defined(__SANITIZE_ADDRESS__)
#define SINEW_COUNTS_THREADS
#include <dlfcn.h>
#include <pthread.h>

namespace {
std::atomic<int> threads_started = 0;
}  // namespace

// In place of the C library's, or of a sanitizer's, which it calls.
extern "C" int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*run)(void*),
                              void* argument) noexcept {
  static const auto next = reinterpret_cast<decltype(&pthread_create)>(dlsym(RTLD_NEXT, "pthread_create"));
  ++threads_started;
  return next(thread, attributes, run, argument);
}
#endif

namespace sinew {
namespace {

TEST(Parallel, RangesCoverEverythingOnce) {
  const ThreadsOfATest threads_of_a_test;
  for (const int threads : {1, 2, 3, 8}) {
    set_thread_count(threads);
    for (const std::size_t count : {0, 1, 7, 8, 9, 1000, 4096}) {
      std::vector<int> visits(count, 0);
      std::atomic<bool> too_long = false;
      parallel_for(count, 8, [&](std::size_t begin, std::size_t end) {
        if (threads > 1 && end - begin > 8) too_long = true;
        for (std::size_t i = begin; i < end; ++i) ++visits[i];
      });
      EXPECT_EQ(visits, std::vector<int>(count, 1)) << threads << " threads, " << count << " items";
      EXPECT_FALSE(too_long) << threads << " threads, " << count << " items";
    }
  }
}

TEST(Parallel, EachWorkRunsOnceAndWhatOneThrowsComesToTheCaller) {
  const ThreadsOfATest threads_of_a_test;
  for (const int threads : {1, 3}) {
    set_thread_count(threads);
    for (const std::size_t count : {0, 1, 40}) {
      std::vector<int> visits(count, 0);
      run_parallel(count, [&](std::size_t i) { ++visits[i]; });
      EXPECT_EQ(visits, std::vector<int>(count, 1));
    }
    EXPECT_THROW(run_parallel(5, [](std::size_t) { throw std::bad_alloc(); }), std::bad_alloc);
  }
}

TEST(Parallel, OneRangeOrOneThreadStaysOnTheCallingThread) {
  const ThreadsOfATest threads_of_a_test;
  const auto caller = std::this_thread::get_id();
  const auto expect_caller = [&](std::size_t count, std::size_t grain) {
    int calls = 0;
    parallel_for(count, grain, [&](std::size_t begin, std::size_t end) {
      ++calls;
      EXPECT_EQ(std::this_thread::get_id(), caller);
      EXPECT_EQ(begin, 0u);
      EXPECT_EQ(end, count);
    });
    EXPECT_EQ(calls, 1);
  };
  set_thread_count(4);
  expect_caller(100, 100);
  set_thread_count(1);
  expect_caller(100, 1);
}

TEST(Parallel, ThreadsPayForLongWorkAlone) {
  const ThreadsOfATest threads_of_a_test;
  EXPECT_TRUE(threads_pay(0));
  set_threads_always_pay(false);
  set_thread_count(4);
  EXPECT_FALSE(threads_pay(5));
  EXPECT_TRUE(threads_pay(1e6));
  set_thread_count(1);
  EXPECT_FALSE(threads_pay(1e6));
}

TEST(Parallel, ThreadsPayEarlierIfMuchWorkFollows) {
  const ThreadsOfATest threads_of_a_test;
  set_threads_always_pay(false);
  set_thread_count(4);
  std::this_thread::sleep_for(std::chrono::milliseconds(10));  // until those that have worked before are asleep
  EXPECT_FALSE(threads_pay(50));
  {
    const WorkAhead much(1e6), little(1);
    EXPECT_TRUE(threads_pay(50));
    EXPECT_FALSE(threads_pay(5));
  }
  EXPECT_FALSE(threads_pay(50));
  const WorkAhead little(1);
  EXPECT_FALSE(threads_pay(50));
}

TEST(Parallel, WhatABodyThrowsComesToTheCaller) {
  const ThreadsOfATest threads_of_a_test;
  for (const int threads : {1, 4}) {
    set_thread_count(threads);
    std::atomic<int> running = 0;
    const auto run_out_of_memory = [&](std::size_t begin, std::size_t) {
      ++running;
      const bool fails = begin % 8 == 0;
      --running;
      if (fails) throw std::bad_alloc();
    };
    EXPECT_THROW(parallel_for(64, 1, run_out_of_memory), std::bad_alloc);
    EXPECT_EQ(running, 0);
    std::vector<int> visits(64, 0);  // the threads are none the worse for it
    parallel_for(64, 1, [&](std::size_t i, std::size_t end) {
      for (; i < end; ++i) ++visits[i];
    });
    EXPECT_EQ(visits, std::vector<int>(64, 1));
  }
}

#ifdef SINEW_COUNTS_THREADS
TEST(Parallel, OneThreadIsStartedToAskForMany) {
  const int before = threads_started;
  EXPECT_TRUE(detail::can_start(16));
  EXPECT_EQ(threads_started - before, 1);
}

TEST(Parallel, NoThreadsWithoutMemoryForTheirStacks) {
  EXPECT_FALSE(detail::can_start(std::numeric_limits<int>::max()));
}
#endif

TEST(Parallel, MayBeCalledInsideItself) {
  const ThreadsOfATest threads_of_a_test;
  set_thread_count(4);
  std::vector<int> visits(64 * 64, 0);
  parallel_for(64, 1, [&](std::size_t outer, std::size_t) {
    parallel_for(64, 1, [&](std::size_t inner, std::size_t) { ++visits[64 * outer + inner]; });
  });
  EXPECT_EQ(visits, std::vector<int>(64 * 64, 1));
}

}  // namespace
}  // namespace sinew
