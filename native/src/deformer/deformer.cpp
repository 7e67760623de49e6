#include "sinew/deformer.h"

#include <algorithm>
#include <chrono>
#include <functional>
#include <string>

#include "base/check.h"
#include "base/parallel.h"
#include "base/per_thread.h"
#include "base/steady_instruction_set.h"
#include "base/vertex_numbers.h"
#include "deformer/method.h"
#include "deformer/posed_layer.h"
#include "skinning/kernels.h"

namespace sinew {
namespace {

// The approximate cost on one thread of adding one vertex of a key, and of one vertex that is only
// copied through a tile.
constexpr double kMicrosecondsKey = 0.5e-3, kMicrosecondsCopy = 0.3e-3;
// And of one vertex that is split again: 33 ns linear, 58 ns with dual quaternions, with three bones.
constexpr double kMicrosecondsBend = 40e-3;

/// A thread's memory for the tile that it works on.
struct Scratch {
  alignas(64) float input[3 * kTile];       ///< with shape keys added
  alignas(64) float points[3 * kTile];      ///< the input, packed
  alignas(64) float own[3 * kTile];         ///< a layer that is mixed in
  alignas(64) std::uint8_t touched[kTile];  ///< by shape keys
  LayerScratch layer;
};

/// The part of a frame that its tiles share.
struct Frame {
  std::span<const PosedLayer> layers;
  const ShapeKeys* keys;  ///< or null
  std::span<const float> key_values;
  const float* input;         ///< V x 3, before shape keys are added
  const BlockedSkin* packed;  ///< has the input in packed form, or null
  std::size_t vertices;
  float* positions;  ///< out, V x 3
  bool has_bends;    ///< whether some layer has
  bool all_moved;    ///< no vertex is where it was split

  void run_tile(std::size_t t) const {
    const std::size_t first = t * kTile, count = std::min(kTile, vertices - first);
    Scratch& scratch = per_thread<Scratch>();
    TileInput tile{t, count, input + 3 * first, nullptr, {all_moved, nullptr}};
    if (packed) tile.points = packed->points.get() + 3 * first;
    if (keys && keys->change(t, key_values)) {
      std::copy_n(tile.rest, 3 * count, scratch.input);
      keys->add(t, key_values, scratch.input);
      tile.rest = scratch.input;
      if (has_bends) {
        keys->mark(t, key_values, scratch.touched);
        tile.moved.touched = scratch.touched;
      }
    }
    if (layers.empty()) {
      std::copy_n(tile.rest, 3 * count, positions + 3 * first);
    } else {
      skin_tile(tile, scratch, positions + 3 * first);
    }
  }

 private:
  void skin_tile(TileInput& tile, Scratch& scratch, float* out) const {
    for (const PosedLayer& posed : layers) {
      if (!posed.space && !tile.points) {
        pack_points(tile.rest, tile.count, scratch.points);
        tile.points = scratch.points;
      }
      if (&posed == layers.data()) {
        posed.run(tile, scratch.layer, out);
        continue;
      }
      posed.run(tile, scratch.layer, scratch.own);
      const float* const share = posed.layer->share()->data() + tile.tile * kTile;
      mix(out, scratch.own, share, tile.count, out);
    }
  }
};

void check_matrices_of(const Layer& layer, const LayerPose& pose, std::size_t i) {
  const std::string where = "layer " + std::to_string(i) + ": ";
  if (pose.matrices.frames != 1) {
    fail(where, "there are ", plural(pose.matrices.frames, "frame"), " of matrices; expected 1");
  }
  check_matrices(layer.skin(), pose.matrices, where);
}

void check_stage(const Stage& stage, std::ptrdiff_t vertices, std::size_t i) {
  std::visit(
      [&](const auto& one) {
        const std::ptrdiff_t own = one.stage->vertex_count();
        if (own != vertices) {
          fail("stage ", i, " has ", plural(own, "vertex"), "; the deformer has ", grouped(vertices));
        }
        try {
          one.stage->check(one.settings);
        } catch (const InputError& error) {
          fail("stage ", i, ": ", error.what());
        }
      },
      stage);
}

/// Writes the milliseconds since it was made, or since it last wrote.
class Watch {
 public:
  explicit Watch(std::span<double> milliseconds) : out_(milliseconds) {}
  void stop(std::size_t i) {
    if (out_.empty()) return;
    const auto now = Clock::now();
    out_[i] = std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
  }

 private:
  using Clock = std::chrono::steady_clock;
  std::span<double> out_;
  Clock::time_point last_ = Clock::now();
};

}  // namespace

Deformer::Deformer(std::ptrdiff_t vertex_count) : vertex_count_(vertex_count) {
  if (vertex_count < 0) fail("the vertex count is ", vertex_count, "; expected 0 or more");
}

Deformer::Deformer(std::vector<std::shared_ptr<const Layer>> layers, std::shared_ptr<const ShapeKeys> keys)
    : layers_(std::move(layers)), keys_(std::move(keys)) {
  if (layers_.empty() && !keys_) fail("there are no layers and no shape keys; expected at least one of them");
  vertex_count_ = layers_.empty() ? keys_->vertex_count() : layers_[0]->skin().vertex_count();
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    const std::ptrdiff_t own = layers_[i]->skin().vertex_count();
    if (own != vertex_count_) {
      fail("layer ", i, " has ", plural(own, "vertex"), "; layer 0 has ", grouped(vertex_count_));
    }
    const bool has_share = layers_[i]->share().has_value();
    if (i == 0 && has_share) fail("layer 0 has a share; there is nothing that it could be mixed with");
    if (i > 0 && !has_share) fail("layer ", i, " has no share; only the first has none");
  }
  if (keys_ && keys_->vertex_count() != vertex_count_) {
    fail("the keys have ", plural(keys_->vertex_count(), "vertex"), "; the layers have ", grouped(vertex_count_));
  }
}

void Deformer::check(std::span<const LayerPose> poses, std::span<float> positions, std::span<const float> key_values,
                     std::span<const float> rest_positions, std::span<const Stage> stages,
                     std::span<double> milliseconds) const {
  if (poses.size() != layers_.size()) {
    fail("there are ", plural(std::ssize(poses), "pose"), "; the deformer has ", plural(std::ssize(layers_), "layer"));
  }
  for (std::size_t i = 0; i < poses.size(); ++i) check_matrices_of(*layers_[i], poses[i], i);
  for (std::size_t i = 0; i < stages.size(); ++i) check_stage(stages[i], vertex_count_, i);
  if (!milliseconds.empty() && milliseconds.size() != stages.size() + 1) {
    fail("milliseconds has ", plural(std::ssize(milliseconds), "number"), "; expected ", stages.size() + 1,
         ", one more than there are stages");
  }
  check_position_count("the result", positions, vertex_count_);
  if (!key_values.empty()) {
    if (!keys_) fail("there are key values, but no shape keys");
    if (!rest_positions.empty()) fail("there are key values and rest positions; expected one");
    if (std::ssize(key_values) != keys_->count()) {
      fail("there are ", plural(std::ssize(key_values), "key value"), "; expected ", grouped(keys_->count()),
           ", one per key");
    }
  }
  if (rest_positions.empty()) {
    if (layers_.empty() && !keys_ && vertex_count_ > 0) {
      fail("there are no layers and no shape keys; expected rest_positions");
    }
    return;
  }
  check_position_count("rest_positions", rest_positions, vertex_count_);
  const std::less<const float*> before;
  if (before(positions.data(), rest_positions.data() + rest_positions.size()) &&
      before(rest_positions.data(), positions.data() + positions.size())) {
    fail("the result and rest_positions overlap");
  }
}

void Deformer::deform(std::span<const LayerPose> poses, std::span<float> positions, std::span<const float> key_values,
                      std::span<const float> rest_positions, std::span<const Stage> stages,
                      std::span<double> milliseconds) const {
  check(poses, positions, key_values, rest_positions, stages, milliseconds);
  Watch watch(milliseconds);
  if (vertex_count_ > 0) skin(poses, positions, key_values, rest_positions);
  watch.stop(0);
  for (std::size_t i = 0; i < stages.size(); ++i) {
    std::visit([&](const auto& one) { one.stage->apply(one.settings, positions); }, stages[i]);
    watch.stop(i + 1);
  }
}

void Deformer::skin(std::span<const LayerPose> poses, std::span<float> positions, std::span<const float> key_values,
                    std::span<const float> rest_positions) const {
  const SteadyInstructionSet steady;
  const auto vertices = static_cast<std::size_t>(vertex_count_);

  // Kept from call to call, and never shrunk, so that a frame allocates nothing. Work that runs in
  // parallel never re-enters this function, so a thread needs only one list.
  auto& posed = per_thread<std::vector<PosedLayer>>();
  if (posed.size() < layers_.size()) posed.resize(layers_.size());
  for (std::size_t i = 0; i < layers_.size(); ++i) posed[i].pose(*layers_[i], poses[i]);

  Frame frame{{posed.data(), layers_.size()}, nullptr, key_values, nullptr, nullptr, vertices, positions.data(), false,
              !rest_positions.empty()};
  if (!rest_positions.empty()) {
    frame.input = rest_positions.data();
  } else if (keys_) {
    frame.keys = keys_.get();
    frame.input = keys_->base().data();
  } else {
    frame.input = layers_[0]->skin().rest_positions().data();
    frame.packed = posed[0].skin;
  }

  const std::ptrdiff_t changed = frame.keys ? keys_->changed_by(key_values) : 0;
  double microseconds =
      kMicrosecondsCopy * static_cast<double>(vertices) + kMicrosecondsKey * static_cast<double>(changed);
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    microseconds += microseconds_a_vertex(layers_[i]->method()) * static_cast<double>(vertices);
    if (!layers_[i]->bends()) continue;
    frame.has_bends = true;
    const std::ptrdiff_t listed = std::ssize(layers_[i]->bends()->vertices());
    const bool all = frame.all_moved || posed[i].split_elsewhere;
    microseconds += kMicrosecondsBend * static_cast<double>(all ? listed : std::min(listed, changed));
  }
  const std::size_t tiles = (vertices + kTile - 1) / kTile;
  parallel_for(tiles, threads_pay(microseconds) ? 1 : tiles, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) frame.run_tile(t);
  });
}

}  // namespace sinew
