// The student report's experiments: weak scaling, strong scaling and the share of each stage, for
// its serial program, its parallel one and this library. Writes CSV to standard output.
#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "baselines.h"
#include "sinew/forward_kinematics.h"
#include "sinew/skinning.h"
#include "sinew/threads.h"

namespace sinew::bench {
namespace {

constexpr int kFrames = 64;

struct Program {
  const char* name;
  bool is_sinew;
  bool is_parallel;
  std::ptrdiff_t frames_a_call = 1;
};
constexpr Program kPrograms[] = {{"report, serial", false, false},
                                 {"report, TBB", false, true},
                                 {"sinew", true, true},
                                 {"sinew, 64 frames a call", true, true, kFrames}};

/// Wall time and the processor time of all threads, in seconds.
struct Times {
  double wall = 0, cpu = 0;
};

Times now() {
  std::timespec cpu{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &cpu);
  const auto wall = std::chrono::steady_clock::now().time_since_epoch();
  return {std::chrono::duration<double>(wall).count(),
          static_cast<double>(cpu.tv_sec) + 1e-9 * static_cast<double>(cpu.tv_nsec)};
}

template <class Work>
Times measured(const Work& work) {
  const Times begin = now();
  work();
  const Times end = now();
  return {end.wall - begin.wall, end.cpu - begin.cpu};
}

/// A rig with all that the three programs' loops need.
struct Stage {
  std::string name;
  Character character;
  Rig rig;
  Eigen::MatrixXd dense_positions;
  std::vector<float> positions;
  std::vector<std::int32_t> joint_of;  ///< a column of weights: the joint

  explicit Stage(const std::filesystem::path& folder)
      : name(folder.filename()),
        character(read_character(folder, 0, 0, 0, kFrames)),
        rig(read_walking_rig(folder)),
        dense_positions(character.rest.rows(), 3),
        positions(3 * character.skin.vertex_count() * kFrames),
        joint_of(joints_of_columns(rig)) {}

  /// Skins `frames` frames of the walk from `first` on: of a program that skins one a call, one.
  void skin(const Program& program, int threads, std::ptrdiff_t first, std::ptrdiff_t frames) {
    if (program.is_sinew) {
      MatrixStack<const float> matrices = character.frame(first % kFrames);
      matrices.frames = frames;
      skin_linear(character.skin, matrices, std::span(positions).first(3 * frames * character.skin.vertex_count()));
    } else {
      report_skin(character, first % kFrames, dense_positions, program.is_parallel ? threads : 0);
    }
  }
};

Times skin_calls(Stage& stage, const Program& program, int threads, std::ptrdiff_t calls) {
  set_thread_count(threads);
  stage.skin(program, threads, 0, program.frames_a_call);  // threads start, memory is there
  return measured([&] {
    for (std::ptrdiff_t done = 0; done < calls; done += program.frames_a_call) {
      stage.skin(program, threads, done, std::min(program.frames_a_call, calls - done));
    }
  });
}

void print(const char* experiment, const Stage& stage, const Program& program, int threads, std::ptrdiff_t calls,
           const char* what, const Times& times) {
  std::printf("%s,%s,\"%s\",%d,%td,%s,%.6f,%.6f\n", experiment, stage.name.c_str(), program.name, threads, calls, what,
              times.wall, times.cpu);
  std::fflush(stdout);
}

/// The report's loop: pose, forward kinematics, skinning.
void whole_loop(Stage& stage, const Program& program, int cores) {
  const RigSkeleton& skeleton = stage.rig.skeleton;
  const PoseClip& clip = *stage.rig.poses;
  const std::ptrdiff_t joints = skeleton.joint_count();
  const std::size_t count = static_cast<std::size_t>(joints);
  std::vector<Eigen::Quaterniond> rotations(count);
  std::vector<Matrix4<double>> local(count), world(count);
  std::vector<Matrix4<float>> matrices(count), used(stage.joint_of.size());
  set_thread_count(program.is_parallel ? cores : 1);
  const std::ptrdiff_t frames = program.is_sinew ? 5000 : 500;
  Times pose, kinematics, skinning;
  const auto add = [](Times& sum, const Times& more) {
    sum.wall += more.wall;
    sum.cpu += more.cpu;
  };
  for (std::ptrdiff_t f = 0; f < frames; ++f) {
    add(pose, measured([&] {
          clip.sample(static_cast<double>(f % 1000) / 10, true, rotations);
          rotation_transforms<double>(rotations, MatrixStack<double>::of(local.data(), 1, joints));
        }));
    add(kinematics, measured([&] {
          if (program.is_sinew) {
            forward_kinematics<double>(skeleton, MatrixStack<const double>::of(local.data(), 1, joints),
                                       MatrixStack<double>::of(world.data(), 1, joints));
            skinning_matrices<double>(skeleton, MatrixStack<const double>::of(world.data(), 1, joints),
                                      MatrixStack<float>::of(matrices.data(), 1, joints));
          } else {
            for (const std::int32_t j : skeleton.order()) {
              const Matrix4<double> own = skeleton.rest<double>()[j] * local[j];
              const std::int32_t parent = skeleton.parents()[j];
              world[j] = parent < 0 ? own : Matrix4<double>(world[parent] * own);
            }
          }
        }));
    add(skinning, measured([&] {
          if (program.is_sinew) {
            for (std::size_t c = 0; c < used.size(); ++c) used[c] = matrices[stage.joint_of[c]];
            skin_linear(stage.character.skin, MatrixStack<const float>::of(used.data(), 1, std::ssize(used)),
                        std::span(stage.positions).first(3 * stage.character.skin.vertex_count()));
          } else {
            for (std::size_t c = 0; c < used.size(); ++c) {
              stage.character.transforms[c] = world[stage.joint_of[c]];
            }
            report_skin(stage.character, 0, stage.dense_positions, program.is_parallel ? cores : 0);
          }
        }));
  }
  const int threads = program.is_parallel ? cores : 1;
  print("loop", stage, program, threads, frames, "pose", pose);
  print("loop", stage, program, threads, frames, "forward kinematics", kinematics);
  print("loop", stage, program, threads, frames, "skinning", skinning);
}

void run(Stage& stage, int cores, int largest_power, std::ptrdiff_t strong_calls) {
  for (const Program& program : kPrograms) {
    const int threads = program.is_parallel ? cores : 1;
    for (int n = 1; n <= largest_power; ++n) {
      const std::ptrdiff_t calls = std::ptrdiff_t{1} << n;
      print("weak", stage, program, threads, calls, "skinning", skin_calls(stage, program, threads, calls));
    }
  }
  for (const Program& program : kPrograms) {
    for (int threads = 1; threads <= (program.is_parallel ? 8 : 1); ++threads) {
      print("strong", stage, program, threads, strong_calls, "skinning",
            skin_calls(stage, program, threads, strong_calls));
    }
  }
  for (const Program& program : kPrograms) {
    if (program.frames_a_call == 1) whole_loop(stage, program, cores);
  }
}

}  // namespace
}  // namespace sinew::bench

int main(int count, char** arguments) {
  using namespace sinew::bench;
  if (count < 4) {
    std::fprintf(stderr, "usage: report_bench LARGEST_POWER STRONG_CALLS FOLDER...\n");
    return 2;
  }
  sinew::set_thread_count(0);
  const int cores = sinew::thread_count();
  std::printf("experiment,rig,program,threads,calls,stage,wall,cpu\n");
  for (int i = 3; i < count; ++i) {
    Stage stage(arguments[i]);
    run(stage, cores, std::stoi(arguments[1]), std::stoll(arguments[2]));
  }
}
