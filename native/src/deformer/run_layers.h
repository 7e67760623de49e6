/// Runs layers on a whole mesh, tile by tile: what a deformer and a stage of layers have in common.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sinew/layer.h"
#include "sinew/shape_keys.h"

namespace sinew {

/// The shape from which all layers start.
struct LayerInput {
  std::span<const float> positions;     ///< V x 3; may be the output
  const ShapeKeys* keys = nullptr;      ///< added to the positions, which are their base; or null
  std::span<const float> key_values{};  ///< as Deformer::deform takes them
  bool is_rest_of_first_skin = false;   ///< the positions are the first skin's
  /// Numbers of the only tiles that are computed; nullopt: all. The others' output is not written.
  std::optional<std::span<const std::uint32_t>> tiles{};
};

/// Throws InputError if two layers have different numbers of vertices, if the first has a share or if another has none.
void check_layers(std::span<const std::shared_ptr<const Layer>> layers);

/// Throws InputError if there is not one pose per layer, or if a layer's matrices do not fit. owner: "the deformer".
void check_poses(std::span<const std::shared_ptr<const Layer>> layers, std::span<const LayerPose> poses,
                 const char* owner);

/// Applies the layers to that input and mixes their results. layers: may be empty if there are keys or positions, which
/// are then copied. positions: out, V x 3. Uses one parallel region.
void run_layers(std::span<const std::shared_ptr<const Layer>> layers, std::span<const LayerPose> poses,
                const LayerInput& input, std::span<float> positions);

}  // namespace sinew
