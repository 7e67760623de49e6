#include "sinew/skinning.h"

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "base/check.h"
#include "base/parallel.h"
#include "base/per_thread.h"
#include "base/steady_instruction_set.h"
#include "deformer/method.h"

namespace sinew {
namespace {

// More matrices are processed in parts, so that the prepared ones take only a few megabytes.
constexpr std::ptrdiff_t kMatricesAtOnce = 1 << 16;

// Preparing a palette takes a few microseconds.
constexpr std::ptrdiff_t kPalettesPerTask = 32;

void check_shapes(const SkinningJob& job, const std::string& where) {
  const Skin& skin = *job.skin;
  check_matrices(skin, job.matrices, where);
  const auto expected = static_cast<std::size_t>(job.matrices.frames * skin.vertex_count() * 3);
  if (job.positions.size() != expected) {
    fail(where, "the result holds ", grouped(job.positions.size()), " numbers; expected ", grouped(expected), " (",
         job.matrices.frames, " x ", skin.vertex_count(), " x 3)");
  }
  check_rest_frames(job.rule, skin.joint_count(), where);
  check_data(skin, job.method, job.data, where);
}

void check(std::span<const SkinningJob> jobs) {
  const auto where = [&](std::size_t i) {
    return jobs.size() == 1 ? std::string() : "job " + std::to_string(i) + ": ";
  };
  for (std::size_t i = 0; i < jobs.size(); ++i) check_shapes(jobs[i], where(i));

  auto& by_address = per_thread<std::vector<std::size_t>>();  // keeps its memory
  by_address.clear();
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    if (!jobs[i].positions.empty()) by_address.push_back(i);
  }
  const auto begin_of = [&](std::size_t i) { return jobs[i].positions.data(); };
  std::ranges::sort(by_address, std::less<const float*>(), begin_of);
  for (std::size_t i = 1; i < by_address.size(); ++i) {
    const std::size_t a = by_address[i - 1], b = by_address[i];
    if (std::less<const float*>()(begin_of(b), begin_of(a) + jobs[a].positions.size())) {
      fail("the results of job ", std::min(a, b), " and job ", std::max(a, b), " overlap");
    }
  }
}

/// Some frames of one job, as part of a batch.
struct Part {
  const SkinningJob* job;
  const BlockedSkin* skin;
  std::ptrdiff_t first_frame;
  std::ptrdiff_t frames;
  std::ptrdiff_t first_palette;  ///< in the batch
  std::ptrdiff_t first_task;     ///< in the batch
  std::ptrdiff_t tiles;          ///< per frame

  std::ptrdiff_t tasks() const { return frames * tiles; }
};

/// The work of one parallel region.
struct Batch {
  std::vector<Part> parts;
  std::vector<Palette> palettes;  ///< never shrunk, so that they keep their memory
  std::ptrdiff_t palette_count = 0;
  std::ptrdiff_t task_count = 0;
  std::ptrdiff_t matrices = 0;
  double microseconds = 0;

  void clear() {
    parts.clear();
    palette_count = task_count = matrices = 0;
    microseconds = 0;
  }

  void add(const SkinningJob& job, std::ptrdiff_t first_frame, std::ptrdiff_t frames) {
    const BlockedSkin& skin = job.skin->blocked();
    parts.push_back({&job, &skin, first_frame, frames, palette_count, task_count,
                     static_cast<std::ptrdiff_t>((skin.blocks.size() + kBlocksPerTile - 1) / kBlocksPerTile)});
    palette_count += frames;
    task_count += parts.back().tasks();
    matrices += frames * (job.matrices.joints + 1);
    microseconds += static_cast<double>(frames * job.skin->vertex_count()) * microseconds_a_vertex(job.method);
  }

  void run_all() {
    if (static_cast<std::ptrdiff_t>(palettes.size()) < palette_count) palettes.resize(palette_count);
    const bool parallel = threads_pay(microseconds);
    const auto prepare_some = [this](std::ptrdiff_t begin, std::ptrdiff_t end) {
      for (std::ptrdiff_t i = begin; i < end; ++i) prepare_palette(i);
    };
    const auto run_some = [this](std::ptrdiff_t begin, std::ptrdiff_t end) {
      for (std::ptrdiff_t i = begin; i < end; ++i) run_task(i);
    };
    parallel_for(palette_count, parallel ? kPalettesPerTask : palette_count, prepare_some);
    parallel_for(task_count, parallel ? 1 : task_count, run_some);
  }

 private:
  /// Returns the last part that begins at `number` or before.
  const Part& part_of(std::ptrdiff_t number, std::ptrdiff_t Part::*first) const {
    return *std::prev(std::ranges::upper_bound(parts, number, {}, first));
  }

  void prepare_palette(std::ptrdiff_t number) {
    const Part& part = part_of(number, &Part::first_palette);
    prepare(*part.skin, part.job->method, part.job->rule, part.job->data, part.job->matrices,
            part.first_frame + number - part.first_palette, palettes[number]);
  }

  /// All frames of one tile come first, then the next tile, so that the tile stays in the cache.
  void run_task(std::ptrdiff_t number) const {
    const Part& part = part_of(number, &Part::first_task);
    const BlockedSkin& skin = *part.skin;
    const std::ptrdiff_t frame = (number - part.first_task) % part.frames;
    const std::size_t begin = (number - part.first_task) / part.frames * kBlocksPerTile;
    const std::size_t of_frame = (part.first_frame + frame) * skin.vertex_count();
    run(skin, part.job->method, palettes[part.first_palette + frame],
        {begin, std::min(skin.blocks.size(), begin + kBlocksPerTile), skin.rest.data() + 3 * begin * kBlock,
         skin.points.get() + begin * kBlockFloats, part.job->positions.data() + 3 * (of_frame + begin * kBlock),
         part.job->data});
  }
};

}  // namespace

void skin_all(std::span<const SkinningJob> jobs) {
  check(jobs);
  const SteadyInstructionSet steady;
  // Kept from call to call, so that a frame allocates nothing. Work that runs in parallel never
  // re-enters this function, so a thread needs only one.
  auto& batch = per_thread<Batch>();
  batch.clear();
  for (const SkinningJob& job : jobs) {
    if (job.skin->vertex_count() == 0) continue;
    for (std::ptrdiff_t frame = 0; frame < job.matrices.frames;) {
      const std::ptrdiff_t space = (kMatricesAtOnce - batch.matrices) / (job.matrices.joints + 1);
      const std::ptrdiff_t frames = std::clamp<std::ptrdiff_t>(space, 1, job.matrices.frames - frame);
      batch.add(job, frame, frames);
      frame += frames;
      if (batch.matrices >= kMatricesAtOnce) {
        batch.run_all();
        batch.clear();
      }
    }
  }
  if (batch.task_count > 0) batch.run_all();
  batch.clear();
}

void skin_linear(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions) {
  const SkinningJob job{&skin, matrices, positions, SkinningMethod::linear, {}};
  skin_all({&job, 1});
}

void skin_dual_quaternion(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions,
                          const StretchRule& rule) {
  const SkinningJob job{&skin, matrices, positions, SkinningMethod::dual_quaternion, rule};
  skin_all({&job, 1});
}

void skin_dual_quaternion(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions) {
  skin_dual_quaternion(skin, matrices, positions, {});
}

void skin_blended(const Skin& skin, const BlendShares& shares, MatrixStack<const float> matrices,
                  std::span<float> positions, const StretchRule& rule) {
  const SkinningJob job{&skin, matrices, positions, SkinningMethod::blended, rule, &shares};
  skin_all({&job, 1});
}

void skin_rotation_centers(const Skin& skin, const RotationCenters& centers, MatrixStack<const float> matrices,
                           std::span<float> positions) {
  const SkinningJob job{&skin, matrices, positions, SkinningMethod::rotation_centers, {}, &centers};
  skin_all({&job, 1});
}

void skin_direct_delta_mush(const DirectDeltaMush& mush, MatrixStack<const float> matrices,
                            std::span<float> positions) {
  const SkinningJob job{mush.skin().get(), matrices, positions, SkinningMethod::direct_delta_mush, {}, &mush};
  skin_all({&job, 1});
}

}  // namespace sinew
