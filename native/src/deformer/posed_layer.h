/// A layer in one frame, for a deformer's tiles.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "sinew/layer.h"
#include "skinning/palette.h"
#include "skinning/space.h"
#include "skinning/tile.h"

namespace sinew {

/// Which vertices of a tile are no longer where the skin's influences were split between segments.
struct Moved {
  bool all;
  const std::uint8_t* touched;  ///< one byte per vertex; null: none
};

/// A tile's input.
struct TileInput {
  std::size_t tile;
  std::size_t count;    ///< of vertices
  const float* rest;    ///< x y z per vertex
  const float* points;  ///< the same, packed
  Moved moved;
};

/// A layer's temporary memory for one tile.
struct LayerScratch {
  alignas(64) float moved[3 * kTile];  ///< the input in armature space
  alignas(64) float moved_points[3 * kTile];
};

struct PosedLayer {
  const Layer* layer;
  const BlockedSkin* skin;
  std::optional<Space> space;  ///< points are transformed by it and back
  std::optional<Matrix4<double>> armature_from_mesh;
  bool split_elsewhere;  ///< the skin was split in another space
  Palette palette;
  /// The matrices in mesh space, if the layer is skinned there but they are given in armature space.
  std::vector<Matrix4<float>> matrices;

  void pose(const Layer& own, const LayerPose& pose);

  /// own  out, the input deformed by this layer alone, x y z per vertex.
  void run(const TileInput& input, LayerScratch& scratch, float* own) const;

 private:
  void bend(const TileInput& input, const float* rest, float* own) const;
};

/// out = from + part (to - from), vertex by vertex; out may be either.
void mix(const float* from, const float* to, const float* part, std::size_t vertices, float* out);

}  // namespace sinew
