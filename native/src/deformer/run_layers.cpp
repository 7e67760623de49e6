#include "deformer/run_layers.h"

#include <algorithm>
#include <string>

#include "base/check.h"
#include "base/parallel.h"
#include "base/per_thread.h"
#include "base/steady_instruction_set.h"
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
  alignas(64) float input[3 * kTile];       ///< with shape keys added, or before it is overwritten
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
    const bool is_changed = keys && keys->change(t, key_values);
    if (is_changed || (input == positions && !layers.empty())) {
      std::copy_n(tile.rest, 3 * count, scratch.input);
      tile.rest = scratch.input;
    }
    if (is_changed) {
      keys->add(t, key_values, scratch.input);
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

}  // namespace

void check_layers(std::span<const std::shared_ptr<const Layer>> layers) {
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const std::ptrdiff_t own = layers[i]->skin().vertex_count(), first = layers[0]->skin().vertex_count();
    if (own != first) {
      fail("layer ", i, " has ", plural(own, "vertex"), "; layer 0 has ", grouped(first));
    }
    const bool has_share = layers[i]->share().has_value();
    if (i == 0 && has_share) fail("layer 0 has a share; there is nothing that it could be mixed with");
    if (i > 0 && !has_share) fail("layer ", i, " has no share; only the first has none");
  }
}

void check_poses(std::span<const std::shared_ptr<const Layer>> layers, std::span<const LayerPose> poses,
                 const char* owner) {
  if (poses.size() != layers.size()) {
    fail("there are ", plural(std::ssize(poses), "pose"), "; ", owner, " has ", plural(std::ssize(layers), "layer"));
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const std::string where = "layer " + std::to_string(i) + ": ";
    if (poses[i].matrices.frames != 1) {
      fail(where, "there are ", plural(poses[i].matrices.frames, "frame"), " of matrices; expected 1");
    }
    check_matrices(layers[i]->skin(), poses[i].matrices, where);
  }
}

void run_layers(std::span<const std::shared_ptr<const Layer>> layers, std::span<const LayerPose> poses,
                const LayerInput& input, std::span<float> positions) {
  if (positions.empty()) return;
  const SteadyInstructionSet steady;
  const std::size_t vertices = positions.size() / 3;

  // Kept from call to call, and never shrunk, so that a frame allocates nothing. Work that runs in
  // parallel never re-enters this function, so a thread needs only one list.
  auto& posed = per_thread<std::vector<PosedLayer>>();
  if (posed.size() < layers.size()) posed.resize(layers.size());
  for (std::size_t i = 0; i < layers.size(); ++i) posed[i].pose(*layers[i], poses[i]);

  const bool is_elsewhere = !input.keys && !input.is_rest_of_first_skin;
  Frame frame{{posed.data(), layers.size()},
              input.keys,
              input.key_values,
              input.positions.data(),
              nullptr,
              vertices,
              positions.data(),
              false,
              is_elsewhere};
  if (input.is_rest_of_first_skin) frame.packed = posed[0].skin;

  const std::ptrdiff_t changed = input.keys ? input.keys->changed_by(input.key_values) : 0;
  double microseconds =
      kMicrosecondsCopy * static_cast<double>(vertices) + kMicrosecondsKey * static_cast<double>(changed);
  for (std::size_t i = 0; i < layers.size(); ++i) {
    microseconds += microseconds_a_vertex(layers[i]->method()) * static_cast<double>(vertices);
    if (!layers[i]->bends()) continue;
    frame.has_bends = true;
    const std::ptrdiff_t listed = std::ssize(layers[i]->bends()->vertices());
    const bool all = frame.all_moved || posed[i].split_elsewhere;
    microseconds += kMicrosecondsBend * static_cast<double>(all ? listed : std::min(listed, changed));
  }
  const std::size_t all = (vertices + kTile - 1) / kTile, tiles = input.tiles ? input.tiles->size() : all;
  microseconds *= static_cast<double>(tiles) / static_cast<double>(all);
  parallel_for(tiles, threads_pay(microseconds) ? 1 : tiles, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) frame.run_tile(input.tiles ? (*input.tiles)[t] : t);
  });
}

}  // namespace sinew
