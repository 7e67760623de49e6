#include "sinew/skinning.h"

#include <gtest/gtest.h>

#include "failures.h"
#include "rigs.h"
#include "sinew/threads.h"

namespace sinew {
namespace {

using Floats = std::vector<float>;

/// Characters of all sizes, one of them long enough to be cut into batches, with their own results.
struct Crowd {
  std::vector<Skin> skins;
  std::vector<std::unique_ptr<rigs::Stack<float>>> matrices;
  std::vector<SkinningMethod> methods;
  std::vector<Floats> alone;

  Crowd() {
    rigs::Random random(5);
    add(random, 9000, 20, 1, SkinningMethod::linear);
    add(random, 0, 3, 2, SkinningMethod::linear);
    add(random, 40, 7, 3, SkinningMethod::dual_quaternion);
    add(random, 70, 500, 300, SkinningMethod::linear);  // 150,000 matrices
    add(random, 30000, 30, 12, SkinningMethod::dual_quaternion);
    add(random, 5, 2, 0, SkinningMethod::linear);
    add(random, 30001, 30, 9, SkinningMethod::linear);
  }

  void add(rigs::Random& random, std::ptrdiff_t vertices, std::int32_t joints, std::ptrdiff_t frames,
           SkinningMethod method) {
    skins.push_back(rigs::coherent_skin(random, vertices, joints, std::min(joints, 3)));
    matrices.push_back(std::make_unique<rigs::Stack<float>>(frames, joints));
    for (std::ptrdiff_t f = 0; f < frames; ++f) {
      for (std::int32_t j = 0; j < joints; ++j) {
        matrices.back()->view().at(f, j) = rigs::random_rigid(random).cast<float>();
      }
    }
    methods.push_back(method);
    alone.emplace_back(3 * vertices * frames, -1.0f);
    if (method == SkinningMethod::linear) {
      skin_linear(skins.back(), matrices.back()->read(), alone.back());
    } else {
      skin_dual_quaternion(skins.back(), matrices.back()->read(), alone.back());
    }
  }

  std::vector<SkinningJob> jobs(std::vector<Floats>& results) {
    results.clear();
    for (const Floats& own : alone) results.emplace_back(own.size(), -77.0f);
    std::vector<SkinningJob> jobs;
    for (std::size_t i = 0; i < skins.size(); ++i) {
      jobs.push_back({&skins[i], matrices[i]->read(), results[i], methods[i], {}});
    }
    return jobs;
  }
};

TEST(SkinAll, IsOneCallAJobWithAnyNumberOfThreads) {
  const ThreadsOfATest threads_of_a_test;
  Crowd crowd;
  for (const int threads : {1, 2, 3, 8}) {
    set_thread_count(threads);
    std::vector<Floats> results;
    skin_all(crowd.jobs(results));
    EXPECT_EQ(results, crowd.alone) << threads << " threads";
  }
}

TEST(SkinAll, OneSkinInManyPoses) {
  rigs::Random random(6);
  const Skin skin = rigs::coherent_skin(random, 500, 10, 3);
  rigs::Stack<float> poses(rigs::random_pose(random, 10 * 8), 8);
  Floats expected(8 * 1500), results(8 * 1500);
  skin_linear(skin, poses.read(), expected);
  std::vector<SkinningJob> jobs;
  for (int f = 0; f < 8; ++f) {
    MatrixStack<const float> frame = poses.read();
    frame.data += f * frame.frame_stride;
    frame.frames = 1;
    jobs.push_back({&skin, frame, std::span(results).subspan(f * 1500, 1500), SkinningMethod::linear, {}});
  }
  skin_all(jobs);
  EXPECT_EQ(results, expected);
}

TEST(SkinAll, NoJobsWriteNothing) {
  Crowd crowd;
  std::vector<Floats> results;
  skin_all(crowd.jobs(results));
  for (Floats& result : results) std::ranges::fill(result, -77.0f);
  skin_all({});  // nor what was done before once more
  for (const Floats& result : results) EXPECT_EQ(result, Floats(result.size(), -77));
}

TEST(SkinAll, NothingIsWrittenIfAJobIsWrong) {
  Crowd crowd;
  std::vector<Floats> results;
  auto jobs = crowd.jobs(results);
  jobs[2].positions = jobs[2].positions.first(9);
  EXPECT_EQ(complaint([&] { skin_all(jobs); }), "job 2: the result holds 9 numbers; expected 360 (3 x 40 x 3)");
  for (const Floats& result : results) {
    EXPECT_TRUE(std::ranges::all_of(result, [](float number) { return number == -77; }));
  }
  jobs = crowd.jobs(results);
  jobs[3].matrices.joints = 499;
  EXPECT_EQ(complaint([&] { skin_all(jobs); }), "job 3: there are 499 matrices per frame; the skin has 500 joints");
}

TEST(SkinAll, ResultsThatOverlapAreRefused) {
  rigs::Random random(7);
  const Skin skin = rigs::coherent_skin(random, 10, 4, 2);
  rigs::Stack<float> pose(rigs::random_pose(random, 4), 1);
  Floats memory(90);
  const auto job = [&](std::size_t first) {
    return SkinningJob{&skin, pose.read(), std::span(memory).subspan(first, 30), SkinningMethod::linear, {}};
  };
  skin_all(std::vector{job(60), job(0), job(30)});
  EXPECT_EQ(complaint([&] {
              skin_all(std::vector{job(60), job(0), job(31)});
            }),
            "the results of job 0 and job 2 overlap");
}

}  // namespace
}  // namespace sinew
