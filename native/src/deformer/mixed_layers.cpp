#include "sinew/mixed_layers.h"

#include <algorithm>

#include "base/check.h"
#include "base/vertex_numbers.h"
#include "deformer/method.h"
#include "deformer/run_layers.h"
#include "skinning/tile.h"

namespace sinew {
namespace {

bool moves(const Skin& skin, std::size_t tile) {
  const std::size_t first = tile * kTile, vertices = static_cast<std::size_t>(skin.vertex_count());
  return skin.offsets()[first] < skin.offsets()[std::min(first + kTile, vertices)];
}

}  // namespace

MixedLayers::MixedLayers(std::vector<std::shared_ptr<const Layer>> layers) : layers_(std::move(layers)) {
  if (layers_.empty()) fail("there are no layers; expected at least one");
  check_layers(layers_);
  const std::size_t tiles = (static_cast<std::size_t>(vertex_count()) + kTile - 1) / kTile;
  for (std::size_t t = 0; t < tiles; ++t) {
    const auto moves_it = [t](const auto& layer) { return moves(layer->skin(), t); };
    if (std::ranges::any_of(layers_, moves_it)) tiles_.push_back(static_cast<std::uint32_t>(t));
  }
}

void MixedLayers::check(const Settings& settings) const { check_poses(layers_, settings.poses, "the stage"); }

double MixedLayers::microseconds(const Settings&) const {
  double total = 0;
  for (const auto& layer : layers_) total += microseconds_a_vertex(layer->method());
  return total * static_cast<double>(tiles_.size() * kTile);
}

void MixedLayers::apply(const Settings& settings, std::span<float> positions) const {
  check_position_count("positions", positions, vertex_count());
  check(settings);
  LayerInput input{positions};
  input.tiles = tiles_;
  run_layers(layers_, settings.poses, input, positions);
}

}  // namespace sinew
