// Skinning: sizes x influences x methods x instruction sets x threads, caches warm and cold, beside
// the bound that memory sets and the student report's loop. One run, interleaved, so that what the
// machine does meanwhile falls on all alike.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cstdio>
#include <functional>
#include <string>
#include <thread>

#include "baselines.h"
#include "chain_rows.h"
#include "peak.h"
#include "sinew/deformer.h"
#include "sinew/instruction_set.h"
#include "sinew/skinning.h"
#include "sinew/threads.h"

namespace sinew::bench {
namespace {

using Clock = std::chrono::steady_clock;
using SkinFunction = void (*)(const Skin&, MatrixStack<const float>, std::span<float>);

constexpr int kFrames = 32;
constexpr std::size_t kColdBytes = 96 << 20;
// Emptying the caches takes a hundred times as long as what is measured then.
constexpr int kColdCalls = 60;

/// What happens between two calls.
enum class Between { nothing, caches_cold, threads_asleep };

struct Subject {
  std::string mesh;
  Character character;
  std::vector<float> positions;  ///< kFrames at most
  double union_size;             ///< joints of a block, mean
  std::size_t packed_bytes;
  BlendShares shares;                           ///< all between the two
  RotationCenters centers;                      ///< of all vertices that two joints move
  std::shared_ptr<const DirectDeltaMush> mush;  ///< or null

  /// Where results go: 64-byte aligned, as memory that is written in full lines is.
  std::span<float> out(std::ptrdiff_t frames) {
    auto* first = positions.data();
    while (reinterpret_cast<std::uintptr_t>(first) % 64 != 0) ++first;
    return {first, static_cast<std::size_t>(frames * character.skin.vertex_count() * 3)};
  }
};

RotationCenters centers_for(const Skin& skin) {
  std::vector<std::uint8_t> has_center;
  for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
    has_center.push_back(skin.offsets()[v + 1] - skin.offsets()[v] > 1);
  }
  return {skin.rest_positions(), has_center};
}

Subject subject(const std::string& mesh, Character character) {
  const auto& blocked = character.skin.blocked();
  std::size_t joints = 0;
  for (const Block& block : blocked.blocks) joints += blocked.sets[block.joint_set].count;
  const std::size_t blocks = blocked.blocks.size();
  const auto size = static_cast<std::size_t>(character.skin.vertex_count()) * 3 * kFrames;
  const bool many = character.skin.vertex_count() < 200'000;
  const std::vector<float> halves(character.skin.vertex_count(), 0.5f);
  RotationCenters centers = centers_for(character.skin);
  return {mesh,
          std::move(character),
          std::vector<float>((many ? size : size / kFrames) + 16),
          static_cast<double>(joints) / static_cast<double>(blocks),
          (joints + 3 * blocks) * kBlock * sizeof(float),
          BlendShares(halves),
          std::move(centers),
          nullptr};
}

void between_calls(Between what) {
  if (what == Between::caches_cold) {
    static std::vector<char> other(kColdBytes, 1);
    for (std::size_t i = 0; i < other.size(); i += 64) ++other[i];
    benchmark::ClobberMemory();
  }
  if (what == Between::threads_asleep) std::this_thread::sleep_for(std::chrono::milliseconds(3));
}

/// One row: `run(frame)` skins `frames` frames. The time of a vertex and frame is reckoned from
/// the call alone.
void add(const Subject& subject, const std::string& what, const std::string& set, int threads, Between between,
         std::ptrdiff_t frames, std::function<void(std::ptrdiff_t)> run) {
  const char* states[] = {"warm", "cold", "asleep"};
  const auto vertices = subject.character.skin.vertex_count();
  const std::string name = what + "|" + subject.mesh + "|" + std::to_string(vertices) + "|" + set + "|" +
                           std::to_string(threads) + "|" + states[static_cast<int>(between)] + "|" +
                           std::to_string(frames);
  auto* const row = benchmark::RegisterBenchmark(name.c_str(), [=, &subject](benchmark::State& state) {
    set_thread_count(threads);
    set_instruction_set(set == "-" ? "auto" : set);
    run(0);
    std::ptrdiff_t call = 0;
    for (auto _ : state) {
      between_calls(between);
      const auto begin = Clock::now();
      run(call++ % kFrames);
      state.SetIterationTime(std::chrono::duration<double>(Clock::now() - begin).count());
    }
    set_thread_count(0);
    set_instruction_set("auto");
    state.counters["vertices"] = static_cast<double>(vertices);
    state.counters["frames"] = static_cast<double>(frames);
    state.counters["joints_a_block"] = subject.union_size;
    state.counters["influences"] =
        static_cast<double>(subject.character.skin.influence_count()) / static_cast<double>(vertices);
    state.counters["bytes_a_vertex"] = static_cast<double>(subject.packed_bytes) / static_cast<double>(vertices) + 12;
  });
  row->UseManualTime();
  if (between == Between::caches_cold) row->Iterations(kColdCalls);
}

void add_skinning(Subject& subject, const std::string& method, SkinFunction skin, const std::string& set, int threads,
                  Between between) {
  add(subject, method, set, threads, between, 1, [&subject, skin](std::ptrdiff_t frame) {
    skin(subject.character.skin, subject.character.frame(frame), subject.out(1));
  });
}

/// The methods that have data of their own.
void add_with_data(Subject& subject, const std::string& set, int threads, Between between) {
  add(subject, "blended", set, threads, between, 1, [&subject](std::ptrdiff_t frame) {
    skin_blended(subject.character.skin, subject.shares, subject.character.frame(frame), subject.out(1));
  });
  add(subject, "centres of rotation", set, threads, between, 1, [&subject](std::ptrdiff_t frame) {
    skin_rotation_centers(subject.character.skin, subject.centers, subject.character.frame(frame), subject.out(1));
  });
}

/// Joints of which every other one is stretched: each way of blending stretches, and each method.
void add_stretched(Subject& subject, const std::string& set, int threads, Between between) {
  const auto row = [&](const std::string& what, auto run) {
    add(subject, what, set, threads, between, 1, [&subject, run](std::ptrdiff_t frame) {
      run(subject.character, subject.character.stretched_frame(frame), subject.out(1));
    });
  };
  row("dual quaternion, stretched", [](const Character& own, auto frame, auto out) {
    skin_dual_quaternion(own.skin, frame, out, {Stretch::frame_each, own.rest_frames});
  });
  row("dual quaternion, stretched first", [](const Character& own, auto frame, auto out) {
    skin_dual_quaternion(own.skin, frame, out, {Stretch::frame, own.rest_frames});
  });
  row("blended, stretched", [&subject](const Character& own, auto frame, auto out) {
    skin_blended(own.skin, subject.shares, frame, out, {Stretch::frame_each, own.rest_frames});
  });
  row("centres of rotation, stretched", [&subject](const Character& own, auto frame, auto out) {
    skin_rotation_centers(own.skin, subject.centers, frame, out);
  });
}

std::shared_ptr<const DirectDeltaMush> mush_of(const Character& character, int variant) {
  // The character outlives it; its pointer does not own the skin.
  const std::shared_ptr<const Skin> borrowed(std::shared_ptr<const Skin>(), &character.skin);
  MushSettings settings;
  settings.variant = variant;
  return DirectDeltaMush::compute(borrowed, character.face_offsets, character.face_vertices, settings);
}

void add_mush(Subject& subject, const std::string& set, int threads, Between between) {
  add(subject, "direct delta mush", set, threads, between, 1, [&subject](std::ptrdiff_t frame) {
    if (!subject.mush) subject.mush = mush_of(subject.character, 0);  // before anything is timed
    skin_direct_delta_mush(*subject.mush, subject.character.frame(frame), subject.out(1));
  });
}

/// The variants that keep less.
void add_mush_variants(Subject& subject, const std::string& set) {
  for (int variant = 1; variant <= 5; ++variant) {
    const auto mush = std::make_shared<std::shared_ptr<const DirectDeltaMush>>();
    add(subject, "direct delta mush, variant " + std::to_string(variant), set, 1, Between::nothing, 1,
        [=, &subject](std::ptrdiff_t frame) {
          if (!*mush) *mush = mush_of(subject.character, variant);
          skin_direct_delta_mush(**mush, subject.character.frame(frame), subject.out(1));
        });
  }
}

/// What comes before the first frame.
void add_mush_build(Subject& subject, int threads) {
  add(subject, "build, direct delta mush", "-", threads, Between::nothing, 1,
      [&subject](std::ptrdiff_t) { benchmark::DoNotOptimize(mush_of(subject.character, 0)); });
}

/// The skin as the one layer of a deformer: plain, and on shape keys at work everywhere, of which
/// each changes its own part of the mesh.
void add_deformer(Subject& subject, const std::string& set, int keys, Between between) {
  const auto& skin = subject.character.skin;
  const auto rest = skin.rest_positions();
  std::vector<float> base(rest.begin(), rest.end());
  std::vector<std::vector<float>> shapes(keys + 1, base);
  for (int k = 1; k <= keys; ++k) {
    const std::size_t first = base.size() / 3 * (k - 1) / keys, last = base.size() / 3 * k / keys;
    for (std::size_t i = 3 * first; i < 3 * last; ++i) shapes[k][i] += 0.01f;
  }
  const std::vector<std::span<const float>> positions(shapes.begin(), shapes.end());
  const std::vector<std::int64_t> relative_to(shapes.size(), 0);
  // The subject outlives the benchmark; the layer's pointer does not own the skin.
  const std::shared_ptr<const Skin> borrowed(std::shared_ptr<const Skin>(), &skin);
  const auto deformer = std::make_shared<const Deformer>(
      std::vector<std::shared_ptr<const Layer>>{std::make_shared<Layer>(borrowed, SkinningMethod::linear)},
      keys > 0 ? std::make_shared<const ShapeKeys>(positions, relative_to) : nullptr);
  const std::vector<float> values(keys > 0 ? keys + 1 : 0, 0.5f);
  const std::string what = "deformer" + (keys > 0 ? ", " + std::to_string(keys) + " keys" : "");
  add(subject, what, set, 1, between, 1, [&subject, deformer, values](std::ptrdiff_t frame) {
    const LayerPose pose{subject.character.frame(frame)};
    deformer->deform({&pose, 1}, subject.out(1), values);
  });
}

void add_bound(Subject& subject, int threads, Between between) {
  for (const bool stream : {false, true}) {
    add(subject, stream ? "bound, streamed" : "bound", "-", threads, between, 1,
        [&subject, stream, threads](std::ptrdiff_t) {
          move_bytes(subject.character.skin.blocked(), stream, threads, subject.out(1).data());
        });
  }
}

void add_report(Subject& subject, int threads) {
  add(subject, threads > 1 ? "report, TBB" : "report", "-", threads, Between::nothing, 1,
      [&subject, threads](std::ptrdiff_t frame) {
        static Eigen::MatrixXd positions;
        positions.resize(subject.character.rest.rows(), 3);
        report_skin(subject.character, frame, positions, threads);
      });
}

void add_many_frames(Subject& subject, const std::string& set, int threads) {
  add(subject, "linear", set, threads, Between::nothing, kFrames, [&subject](std::ptrdiff_t) {
    auto stack = subject.character.frame(0);
    stack.frames = kFrames;
    skin_linear(subject.character.skin, stack, subject.out(kFrames));
  });
}

/// Precomputing centres of rotation.
void add_centers(Subject& subject, int threads) {
  add(subject, "build, centres of rotation", "-", threads, Between::nothing, 1, [&subject](std::ptrdiff_t) {
    const Character& character = subject.character;
    benchmark::DoNotOptimize(RotationCenters::compute(character.skin, character.face_offsets, character.face_vertices));
  });
}

/// Building the packed form anew, as weight painting does.
void add_build(Subject& subject, int threads) {
  add(subject, "build", "-", threads, Between::nothing, 1, [&subject](std::ptrdiff_t) {
    const Skin& skin = subject.character.skin;
    const Skin again(skin.rest_positions(), skin.offsets(), skin.joints(), skin.weights(), skin.joint_count());
    benchmark::DoNotOptimize(&again);
  });
}

void add_all(std::vector<Subject>& subjects, int cores) {
  const std::string best = instruction_sets().front();
  for (Subject& one : subjects) {
    const bool natural = one.mesh.find("2 to 4") != std::string::npos;
    const bool smallest = one.character.skin.vertex_count() < 100'000;
    for (const int threads : cores > 1 ? std::vector{1, cores} : std::vector{1}) {
      add_skinning(one, "linear", skin_linear, best, threads, Between::nothing);
      add_skinning(one, "dual quaternion", skin_dual_quaternion, best, threads, Between::nothing);
      add_with_data(one, best, threads, Between::nothing);
      if (natural) add_stretched(one, best, threads, Between::nothing);
      add_bound(one, threads, Between::nothing);
      if (smallest && natural) add_centers(one, threads);
      const bool has_mush = natural && (smallest || one.character.skin.vertex_count() > 500'000) &&
                            one.character.skin.vertex_count() < 1'000'000;
      if (has_mush) add_mush(one, best, threads, Between::nothing);
      if (natural && smallest) add_mush_build(one, threads);
      if (natural) add_build(one, threads);
      if (natural && one.character.rest.rows() > 0 && smallest) add_report(one, threads);
    }
    if (natural && cores > 1) {
      for (const int threads : {1, cores}) {
        add_skinning(one, "linear", skin_linear, best, threads, Between::threads_asleep);
      }
    }
    if (!smallest) continue;
    add_bound(one, 1, Between::caches_cold);
    if (!natural) {
      add_skinning(one, "linear", skin_linear, best, 1, Between::caches_cold);
      continue;
    }
    add_many_frames(one, best, 1);
    add_mush_variants(one, best);
    for (const int keys : {0, 50}) {
      add_deformer(one, best, keys, Between::nothing);
      add_deformer(one, best, keys, Between::caches_cold);
    }
    for (const std::string& set : instruction_sets()) {
      for (const Between between : {Between::nothing, Between::caches_cold}) {
        if (set == best && between == Between::nothing) continue;  // above
        add_skinning(one, "linear", skin_linear, set, 1, between);
        add_skinning(one, "dual quaternion", skin_dual_quaternion, set, 1, between);
        add_with_data(one, set, 1, between);
        add_stretched(one, set, 1, between);
        add_mush(one, set, 1, between);
      }
    }
  }
}

}  // namespace
}  // namespace sinew::bench

int main(int count, char** arguments) {
  using namespace sinew::bench;
  benchmark::Initialize(&count, arguments);
  if (count != 2) {
    std::fprintf(stderr, "usage: kernel_bench FOLDER [--benchmark_...]\n");
    return 2;
  }
  benchmark::AddCustomContext("multiply_adds_a_second", std::to_string(multiply_adds_a_second()));
  benchmark::AddCustomContext("instruction_set", sinew::instruction_sets().front());
  std::vector<Subject> subjects;
  subjects.reserve(8);
  for (int subdivisions = 0; subdivisions < 4; ++subdivisions) {
    subjects.push_back(subject("2 to 4 influences", read_character(arguments[1], subdivisions, 4, 2, kFrames)));
  }
  subjects.push_back(subject("8 influences", read_character(arguments[1], 0, 8, 8, kFrames)));
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  add_all(subjects, cores);
  add_chain_rows(cores);
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
