// Forward kinematics: shapes of trees x sizes x frames, the library on one thread and on all,
// beside the plain loop.
#include <benchmark/benchmark.h>

#include <Eigen/Geometry>
#include <functional>
#include <numeric>
#include <string>
#include <thread>

#include "peak.h"
#include "sinew/forward_kinematics.h"
#include "sinew/instruction_set.h"
#include "sinew/threads.h"

namespace sinew::bench {
namespace {

using Parents = std::vector<std::int32_t>;

struct Tree {
  std::string name;
  Parents parents;
};

Parents chain(std::int32_t count) {
  Parents parents(count);
  std::iota(parents.begin(), parents.end(), -1);
  return parents;
}

/// `strands` chains that hang on one root, as hair does.
Parents hair(std::int32_t strands, std::int32_t length) {
  Parents parents{-1};
  for (std::int32_t j = 0; j < strands * length; ++j) parents.push_back(j % length == 0 ? 0 : j);
  return parents;
}

Parents bushy(std::int32_t count) {
  Parents parents(count, -1);
  for (std::int32_t j = 1; j < count; ++j) parents[j] = (j - 1) / 3;
  return parents;
}

/// A spine of five, two arms and two legs of four, a neck and a head; a crowd of them.
Parents humanoids(std::int32_t count) {
  constexpr std::int32_t kOne[] = {-1, 0, 1, 2, 3, 3, 5, 6, 7, 3, 9, 10, 11, 4, 0, 14, 15, 16, 0, 18, 19, 20, 13};
  Parents parents;
  for (std::int32_t i = 0; i < count; ++i) {
    for (const std::int32_t parent : kOne) parents.push_back(parent < 0 ? -1 : 23 * i + parent);
  }
  return parents;
}

struct Motion {
  Skeleton skeleton;
  std::vector<Matrix4<float>> local, world;
  std::ptrdiff_t frames;

  Motion(const Parents& parents, std::ptrdiff_t frame_count)
      : skeleton(parents, rest(parents.size())),
        local(parents.size() * frame_count),
        world(parents.size() * frame_count, Matrix4<float>::Identity()),
        frames(frame_count) {
    for (std::size_t i = 0; i < local.size(); ++i) {
      const auto angle = 0.1f + 0.01f * static_cast<float>(i % 50);
      local[i].setIdentity();
      local[i].topLeftCorner<3, 3>() =
          Eigen::AngleAxisf(angle, Eigen::Vector3f(1, 2, 3).normalized()).toRotationMatrix();
    }
  }

  static std::vector<Matrix4<double>> rest(std::size_t count) {
    Matrix4<double> step = Matrix4<double>::Identity();
    step.topRightCorner<3, 1>() = Eigen::Vector3d(0.001, 0.002, 0.003);
    return std::vector<Matrix4<double>>(count, step);
  }

  void by_the_library() {
    const auto joints = skeleton.joint_count();
    forward_kinematics<float>(skeleton, MatrixStack<const float>::of(local.data(), frames, joints),
                              MatrixStack<float>::of(world.data(), frames, joints));
  }

  /// Parents come before their children in these trees.
  void by_the_plain_loop() {
    const auto joints = skeleton.joint_count();
    const auto parents = skeleton.parents();
    const auto rest_of = skeleton.rest<float>();
    for (std::ptrdiff_t frame = 0; frame < frames; ++frame) {
      const Matrix4<float>* own = local.data() + frame * joints;
      Matrix4<float>* out = world.data() + frame * joints;
      for (std::ptrdiff_t j = 0; j < joints; ++j) {
        const Matrix4<float> moved = rest_of[j] * own[j];
        if (parents[j] < 0) {
          out[j] = moved;
        } else {
          out[j].noalias() = out[parents[j]] * moved;
        }
      }
    }
  }
};

void add(const Tree& tree, std::ptrdiff_t frames, int cores) {
  const auto joints = std::to_string(tree.parents.size());
  const auto row = [&](const std::string& what, int threads, void (Motion::*pose)()) {
    const std::string name =
        what + "|" + tree.name + "|" + joints + "|" + std::to_string(frames) + "|" + std::to_string(threads);
    benchmark::RegisterBenchmark(name.c_str(), [=, &tree](benchmark::State& state) {
      Motion motion(tree.parents, frames);
      set_thread_count(threads);
      for (auto _ : state) {
        (motion.*pose)();
        benchmark::ClobberMemory();
      }
      set_thread_count(0);
      state.counters["joints"] = static_cast<double>(tree.parents.size());
      state.counters["frames"] = static_cast<double>(frames);
    })->UseRealTime();
  };
  row("plain loop", 1, &Motion::by_the_plain_loop);
  row("sinew", 1, &Motion::by_the_library);
  if (cores > 1) row("sinew", cores, &Motion::by_the_library);
}

}  // namespace
}  // namespace sinew::bench

int main(int count, char** arguments) {
  using namespace sinew::bench;
  benchmark::Initialize(&count, arguments);
  benchmark::AddCustomContext("multiply_adds_a_second", std::to_string(multiply_adds_a_second()));
  benchmark::AddCustomContext("instruction_set", sinew::instruction_sets().front());
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  const std::vector<Tree> trees{
      {"humanoid", humanoids(1)},
      {"chain", chain(100)},
      {"bushy", bushy(1000)},
      {"crowd of humanoids", humanoids(100)},
      {"chain", chain(10'000)},
      {"bushy", bushy(10'000)},
      {"hair", hair(100, 100)},
      {"chain", chain(100'000)},
      {"bushy", bushy(100'000)},
      {"hair", hair(1000, 100)},
      {"crowd of humanoids", humanoids(4348)},
  };
  for (const Tree& tree : trees) {
    for (const std::ptrdiff_t frames : {1, 10, 100, 1000}) {
      if (tree.parents.size() * frames <= 1'000'000) add(tree, frames, cores);
    }
  }
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
