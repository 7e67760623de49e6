/// Shape keys: a base shape, and differences to it that are added by so much of each.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sinew/types.h"

namespace sinew {

/// Immutable. Of each key only those vertices are kept that differ from the key that it is relative
/// to: a key of a face costs nothing for the body.
///
/// The shape is what Blender makes of relative shape keys, to the bit: beginning with key 0, for
/// each later key k with a value other than 0, in order and in float32,
///   x_v -= g_v (r_v - k_v),   r the key that k is relative to, g_v = w_v value (or the value alone).
class ShapeKeys {
 public:
  /// positions    K x V x 3, one at least; the first is the base. Nothing of them is kept.
  /// relative_to  K, a key's number; a key that is relative to a missing one adds nothing.
  /// weights      K or none at all: w_v of each vertex (V), or nothing where a key has none.
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
  /// How many vertices of all keys are kept because they differ.
  std::ptrdiff_t delta_count() const;
  /// V x 3, key 0.
  std::span<const float> base() const { return base_; }

  /// For the frame loop, whose tiles are kTile vertices (tile.h). Whether keys with these
  /// values (K) change any vertex of a tile.
  bool change(std::size_t tile, std::span<const float> values) const;
  /// Adds them to the tile's positions, which begin as the base does.
  void add(std::size_t tile, std::span<const float> values, float* positions) const;
  /// Which vertices of the tile they change, one byte each: 1, or 0 for those that stay as they
  /// are. touched  out, as many as the tile has vertices.
  void mark(std::size_t tile, std::span<const float> values, std::uint8_t* touched) const;
  /// How many vertices these values change, each counted once a key.
  std::ptrdiff_t changed_by(std::span<const float> values) const;

 private:
  struct Tile;
  std::vector<float> base_;
  std::vector<std::ptrdiff_t> differing_;  // K
  std::vector<Tile> tiles_;
};

}  // namespace sinew
