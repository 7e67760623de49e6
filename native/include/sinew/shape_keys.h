/// Shape keys: a base shape, and differences from it that are multiplied by the keys' values and added.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sinew/types.h"

namespace sinew {

/// Stores for each key only the vertices that differ from the key that it is relative to: a key that
/// changes the face costs nothing for the body. Immutable.
///
/// The shape is Blender's result for relative shape keys, to the bit: starting from key 0, for each
/// later key k with a value other than 0, in order and in float32,
///   x_v -= g_v (r_v - k_v),   r the key that k is relative to, g_v = w_v value (or the value alone).
class ShapeKeys {
 public:
  /// positions    K x V x 3, K at least 1; the first is the base. The caller's memory is not kept.
  /// relative_to  K, a key's number; a key that is relative to a missing one adds nothing.
  /// weights      empty, or K entries: w_v of each vertex (V), or nullopt for a key without weights.
  /// Throws InputError, naming the key, for sizes that differ or a number that is not finite.
  ShapeKeys(std::span<const std::span<const float>> positions, std::span<const std::int64_t> relative_to,
            std::span<const std::optional<std::span<const float>>> weights = {});

  ShapeKeys(ShapeKeys&&) noexcept;
  ShapeKeys& operator=(ShapeKeys&&) noexcept;
  ~ShapeKeys();

  /// K.
  std::ptrdiff_t count() const { return static_cast<std::ptrdiff_t>(differing_.size()); }
  /// V.
  std::ptrdiff_t vertex_count() const { return static_cast<std::ptrdiff_t>(base_.size()) / 3; }
  /// How many vertices are stored because they differ, summed over all keys.
  std::ptrdiff_t delta_count() const;
  /// V x 3, key 0.
  std::span<const float> base() const { return base_; }

  /// For the frame loop, whose tiles have kTile vertices (tile.h). Whether keys with these values (K)
  /// change any vertex of a tile.
  bool change(std::size_t tile, std::span<const float> values) const;
  /// Adds the keys to the tile's positions, which hold the base on entry.
  void add(std::size_t tile, std::span<const float> values, float* positions) const;
  /// Marks the vertices of the tile that the keys change. touched  out, one byte per vertex of the
  /// tile: 1 if it changes, 0 if not.
  void mark(std::size_t tile, std::span<const float> values, std::uint8_t* touched) const;
  /// How many vertices these values change; a vertex counts once for each key that changes it.
  std::ptrdiff_t changed_by(std::span<const float> values) const;

 private:
  struct Tile;
  std::vector<float> base_;
  std::vector<std::ptrdiff_t> differing_;  // K
  std::vector<Tile> tiles_;
};

}  // namespace sinew
