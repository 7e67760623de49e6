#include "sinew/threads.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <thread>
#include <vector>

#include "failures.h"
#include "rigs.h"
#include "sinew/forward_kinematics.h"
#include "sinew/skinning.h"

namespace sinew {
namespace {

TEST(Threads, CountIsWhatWasAskedForOrWhatTheMachineHas) {
  const ThreadsOfATest threads_of_a_test;
  set_thread_count(0);
  const int machine = thread_count();
  EXPECT_GE(machine, 1);
  for (const int count : {1, 2, 3, 1024}) {
    set_thread_count(count);
    EXPECT_EQ(thread_count(), std::min(count, machine));
  }
}

TEST(Threads, NegativeCountIsRefusedAndChangesNothing) {
  const ThreadsOfATest threads_of_a_test;
  set_thread_count(1);
  EXPECT_EQ(complaint([] { set_thread_count(-1); }), "the thread count is -1; expected 0 (all) or a positive number");
  EXPECT_EQ(thread_count(), 1);
}

TEST(Threads, AnyPositiveCountWorks) {
  const ThreadsOfATest threads_of_a_test;
  rigs::Random random(1);
  const Skin skin = rigs::random_skin(random, 20000, 3);
  rigs::Stack<float> matrices(rigs::random_pose(random, 3), 1);
  std::vector<float> one(3 * 20000), many(3 * 20000);
  set_thread_count(1);
  skin_linear(skin, matrices.read(), one);
  set_thread_count(std::numeric_limits<int>::max());
  skin_linear(skin, matrices.read(), many);
  EXPECT_EQ(one, many);
}

TEST(Threads, MeanwhileDoesEachWorkOnceUntilItIsWaitedFor) {
  const ThreadsOfATest threads_of_a_test;
  for (const int threads : {1, 2, 3, 8}) {
    set_thread_count(threads);
    for (const std::size_t count : {0, 1, 2, 5, 100}) {
      std::vector<std::atomic<int>> times(count);
      Meanwhile meanwhile(count, [&](std::size_t i) { ++times[i]; });
      meanwhile.wait();
      for (const auto& each : times) EXPECT_EQ(each, 1);
      meanwhile.wait();
      for (const auto& each : times) EXPECT_EQ(each, 1);
    }
  }
}

TEST(Threads, MeanwhileThatNobodyWaitsForLeavesNothingRunning) {
  const ThreadsOfATest threads_of_a_test;
  for (const int threads : {1, 2, 8}) {
    set_thread_count(threads);
    for (int round = 0; round < 50; ++round) {
      std::vector<std::atomic<int>> times(20);
      std::atomic<int> running = 0;
      {
        const Meanwhile meanwhile(times.size(), [&](std::size_t i) {
          ++running;
          ++times[i];
          --running;
        });
        if (round % 2 == 0) std::this_thread::yield();
        set_thread_count(threads);  // the threads that it has begun with go on
      }
      EXPECT_EQ(running, 0);
      for (const auto& each : times) EXPECT_LE(each, 1);
    }
  }
}

/// Characters are independent: several threads may deform at once, each with the whole library,
/// while another changes the number of threads. (What the thread sanitizer looks at.)
TEST(Threads, CallersDoNotDisturbEachOther) {
  const ThreadsOfATest threads_of_a_test;
  constexpr std::int32_t kJoints = 40, kVertices = 9000;
  rigs::Random random(2);
  const auto parents = rigs::random_forest(random, kJoints);
  const Skeleton skeleton(parents, rigs::random_pose(random, kJoints));
  const Skin skin = rigs::random_skin(random, kVertices, kJoints);
  rigs::Stack<float> local(rigs::random_pose(random, 2 * kJoints), 2);

  const auto deform = [&] {
    rigs::Stack<float> world(2, kJoints), matrices(2, kJoints);
    std::vector<float> linear(2 * 3 * kVertices), dual(2 * 3 * kVertices);
    forward_kinematics(skeleton, local.read(), world.view());
    skinning_matrices(skeleton, world.read(), matrices.view());
    skin_linear(skin, matrices.read(), linear);
    skin_dual_quaternion(skin, matrices.read(), dual);
    linear.insert(linear.end(), dual.begin(), dual.end());
    return linear;
  };
  const std::vector<float> expected = deform();
  std::vector<std::vector<float>> results(4);
  std::vector<std::thread> callers;
  for (auto& result : results) {
    callers.emplace_back([&] {
      for (int turn = 0; turn < 3; ++turn) result = deform();
    });
  }
  for (int count = 1; count < 20; ++count) set_thread_count(count % 4);
  for (std::thread& caller : callers) caller.join();
  for (const auto& result : results) EXPECT_EQ(result, expected);
}

}  // namespace
}  // namespace sinew
