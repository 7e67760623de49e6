/// Vertices that are weighted sums of others.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sinew/faces.h"
#include "sinew/types.h"

namespace sinew {

/// How each vertex of one mesh is made from those of another, as the modifiers Subdivision, Mirror and Array make theirs:
///   p'(r) = s(r) * sum_k w(r, k) p(i(r, k)) + t(r), axis by axis.
/// Immutable; any number of threads may use it at once.
class Stencils {
 public:
  /// offsets       R + 1: stencil r has the entries offsets[r] up to offsets[r + 1].
  /// vertices      N, below V.
  /// weights       N, finite. Equal rows of weights, scales and shifts are stored once.
  /// vertex_count  V, of the mesh from which the vertices are made.
  /// scales        R x 3, the finite s, -1 along the axis of a mirror; empty: 1.
  /// shifts        R x 3, the finite t, in the unit of the positions; empty: 0.
  /// Throws InputError for what does not fit.
  Stencils(std::span<const std::int64_t> offsets, std::span<const std::int32_t> vertices,
           std::span<const float> weights, std::ptrdiff_t vertex_count, std::span<const float> scales = {},
           std::span<const float> shifts = {});
  ~Stencils();

  /// V.
  std::ptrdiff_t vertex_count() const { return vertex_count_; }
  /// R.
  std::ptrdiff_t count() const { return std::ssize(rows_); }
  /// N.
  std::ptrdiff_t entry_count() const { return std::ssize(vertices_); }
  /// How many different rows of weights, scales and shifts there are.
  std::ptrdiff_t pattern_count() const { return std::ssize(pattern_begin_) - 1; }

  /// Writes the vertices that are made from these. Each sum is taken in the order of its entries, in float32, so that any
  /// number of threads gives the same bits.
  /// positions  V x 3. out  R x 3, elsewhere. Throws InputError for other sizes.
  void apply(std::span<const float> positions, std::span<float> out) const;

 private:
  struct Row {
    std::uint32_t begin, pattern;
  };
  struct Placing {
    std::array<float, 4> scale{1, 1, 1, 1}, shift{};
  };
  struct Scratch;

  template <bool kIsPlaced>
  void apply_rows(const float* points, std::span<float> out, std::size_t begin, std::size_t end) const;

  std::ptrdiff_t vertex_count_;
  std::vector<Row> rows_;
  std::vector<std::uint32_t> vertices_, pattern_begin_;  // patterns + 1
  std::vector<float> pattern_weights_;
  std::vector<Placing> placings_;  // one for each pattern; empty: nothing is scaled or shifted
  std::unique_ptr<Scratch> scratch_;
};

/// Returns a colour for each vertex, from 0 on, so that vertices of one colour are more than `steps` steps apart. A step
/// leads to another vertex of the same edge or face. So of what vertices do to those within half as many steps, all of one
/// colour can be seen at once.
/// edges  E x 2. Returns nothing if more than `most` colours would be needed. Throws InputError for what does not fit.
std::optional<std::vector<std::int32_t>> colours_apart(std::ptrdiff_t vertex_count, std::span<const std::int32_t> edges,
                                                       const Faces& faces, int steps, int most);

}  // namespace sinew
