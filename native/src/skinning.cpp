#include "sinew/skinning.h"

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "check.h"
#include "palette.h"
#include "parallel.h"

namespace sinew {
namespace {

// A range of blocks for one thread: its vertices and their weights fit the second-level cache, so
// that the frames of a clip that follow each other there read them from it.
constexpr std::ptrdiff_t kBlocksPerTask = 4096 / kBlock;

// What a vertex costs one thread, about: AVX2, four influences at most.
constexpr double kMicrosecondsLinear = 1.5e-3, kMicrosecondsDualQuaternion = 2.5e-3;

// More are skinned in parts, so that their prepared matrices stay within some megabytes.
constexpr std::ptrdiff_t kMatricesAtOnce = 1 << 16;

// Preparing a palette takes some microseconds.
constexpr std::ptrdiff_t kPalettesPerTask = 32;

void check_shapes(const SkinningJob& job, const std::string& where) {
  const Skin& skin = *job.skin;
  if (job.matrices.joints != skin.joint_count()) {
    fail(where, "there are ", plural(job.matrices.joints, "matrix"), " a frame; the skin has ",
         plural(skin.joint_count(), "joint"));
  }
  const auto expected = static_cast<std::size_t>(job.matrices.frames * skin.vertex_count() * 3);
  if (job.positions.size() != expected) {
    fail(where, "the result holds ", grouped(job.positions.size()), " numbers; expected ",
         grouped(expected), " (", job.matrices.frames, " x ", skin.vertex_count(), " x 3)");
  }
  const auto frames = std::ssize(job.rule.rest_frames);
  const auto wanted = job.rule.stretch == Stretch::polar ? 0 : skin.joint_count();
  if (frames != wanted) {
    fail(where, "there are ", plural(frames, "rest frame"), "; expected ", grouped(wanted));
  }
}

void check(std::span<const SkinningJob> jobs) {
  const auto where = [&](std::size_t i) {
    return jobs.size() == 1 ? std::string() : "job " + std::to_string(i) + ": ";
  };
  for (std::size_t i = 0; i < jobs.size(); ++i) check_shapes(jobs[i], where(i));

  thread_local std::vector<std::size_t> by_address;  // keeps its memory
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

/// Some frames of one job, as a piece of a batch.
struct Part {
  const SkinningJob* job;
  const BlockedSkin* skin;
  std::ptrdiff_t first_frame;
  std::ptrdiff_t frames;
  std::ptrdiff_t first_palette;  ///< in the batch
  std::ptrdiff_t first_task;     ///< in the batch
  std::ptrdiff_t ranges;         ///< of kBlocksPerTask blocks

  std::ptrdiff_t tasks() const { return frames * ranges; }
};

/// What is skinned in one parallel region.
struct Batch {
  std::vector<Part> parts;
  std::vector<Palette> palettes;  ///< never fewer than were used before: they keep their memory
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
    const auto blocks = static_cast<std::ptrdiff_t>(skin.blocks.size());
    parts.push_back({&job, &skin, first_frame, frames, palette_count, task_count,
                     (blocks + kBlocksPerTask - 1) / kBlocksPerTask});
    palette_count += frames;
    task_count += parts.back().tasks();
    matrices += frames * (job.matrices.joints + 1);
    microseconds +=
        static_cast<double>(frames * job.skin->vertex_count()) *
        (job.method == SkinningMethod::linear ? kMicrosecondsLinear : kMicrosecondsDualQuaternion);
  }

  void run() {
    if (static_cast<std::ptrdiff_t>(palettes.size()) < palette_count)
      palettes.resize(palette_count);
    const bool parallel = threads_pay(microseconds);
    const auto prepare_some = [this](std::ptrdiff_t begin, std::ptrdiff_t end) {
      for (std::ptrdiff_t i = begin; i < end; ++i) prepare(i);
    };
    const auto run_some = [this](std::ptrdiff_t begin, std::ptrdiff_t end) {
      for (std::ptrdiff_t i = begin; i < end; ++i) run_task(i);
    };
    parallel_for(palette_count, parallel ? kPalettesPerTask : palette_count, prepare_some);
    parallel_for(task_count, parallel ? 1 : task_count, run_some);
  }

 private:
  /// The last part that begins at `number` or before.
  const Part& part_of(std::ptrdiff_t number, std::ptrdiff_t Part::*first) const {
    return *std::prev(std::ranges::upper_bound(parts, number, {}, first));
  }

  void prepare(std::ptrdiff_t number) {
    const Part& part = part_of(number, &Part::first_palette);
    const bool linear = part.job->method == SkinningMethod::linear;
    (linear ? prepare_linear : prepare_dual_quaternion)(
        *part.skin, *part.job, part.first_frame + number - part.first_palette, palettes[number]);
  }

  /// All frames of one range of blocks come first, then the next range.
  void run_task(std::ptrdiff_t number) const {
    const Part& part = part_of(number, &Part::first_task);
    const std::ptrdiff_t range = (number - part.first_task) / part.frames;
    const std::ptrdiff_t frame = (number - part.first_task) % part.frames;
    const bool linear = part.job->method == SkinningMethod::linear;
    (linear ? run_linear : run_dual_quaternion)(
        *part.skin, palettes[part.first_palette + frame], range * kBlocksPerTask,
        std::min<std::size_t>(part.skin->blocks.size(), (range + 1) * kBlocksPerTask),
        part.job->positions.data() +
            3 * (part.first_frame + frame) * part.job->skin->vertex_count());
  }
};

}  // namespace

void skin_all(std::span<const SkinningJob> jobs) {
  check(jobs);
  // Kept from call to call, so that a frame allocates nothing. What runs in parallel does not come
  // back here, so a thread needs one.
  thread_local Batch batch;
  batch.clear();
  for (const SkinningJob& job : jobs) {
    if (job.skin->vertex_count() == 0) continue;
    for (std::ptrdiff_t frame = 0; frame < job.matrices.frames;) {
      const std::ptrdiff_t space = (kMatricesAtOnce - batch.matrices) / (job.matrices.joints + 1);
      const std::ptrdiff_t frames =
          std::clamp<std::ptrdiff_t>(space, 1, job.matrices.frames - frame);
      batch.add(job, frame, frames);
      frame += frames;
      if (batch.matrices >= kMatricesAtOnce) {
        batch.run();
        batch.clear();
      }
    }
  }
  if (batch.task_count > 0) batch.run();
  batch.clear();
}

}  // namespace sinew
