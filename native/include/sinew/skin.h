/// The mesh at rest, and the joints that move each of its vertices.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "sinew/types.h"

namespace sinew {

struct BlockedSkin;

/// The limits of a packed skin, whose numbers have 32 bits. (Each joint takes a few bytes, even if it
/// is unused.)
constexpr std::int64_t kMostJoints = 1 << 24, kMostNumbers = (std::int64_t{1} << 31) - 1;

/// Throws InputError if a count is above its limit. Call it before copying numbers for a skin.
void check_counts(std::int64_t vertices, std::int64_t influences, std::int64_t joints);

/// Can be moved but not copied; immutable except for set_rest_positions. Every influence is kept, in
/// the order given, and weights are used as they are: nothing is normalised, clamped or dropped (but
/// see from_dense). A vertex that has no influence, or whose weights are all zero, stays at its rest
/// position.
class Skin {
 public:
  /// rest_positions  V x 3, in mesh space.
  /// offsets         V + 1: the influences of vertex v are those from offsets[v] to offsets[v + 1].
  /// joints          N, each in 0..joint_count-1.
  /// weights         N, finite; for each vertex they should sum to 1 (see largest_sum_error).
  /// joint_count     J, the number of matrices per frame that the skinning functions expect.
  /// V and N are at most 2^31 - 1, J at most 2^24.
  /// Throws InputError, naming the vertex or the entry, if any of these conditions is violated.
  Skin(std::span<const float> rest_positions, std::span<const std::int64_t> offsets,
       std::span<const std::int32_t> joints, std::span<const float> weights, std::ptrdiff_t joint_count);

  /// Makes a skin from a dense V x J table: column j belongs to joint j. Entries that are exactly zero
  /// are left out; all others are kept, in ascending order of joints. `row_stride` and `column_stride`
  /// count elements.
  static Skin from_dense(std::span<const float> rest_positions, const double* weights, std::ptrdiff_t rows,
                         std::ptrdiff_t columns, std::ptrdiff_t row_stride, std::ptrdiff_t column_stride);

  Skin(Skin&&) noexcept;
  Skin& operator=(Skin&&) noexcept;
  ~Skin();

  std::ptrdiff_t vertex_count() const { return static_cast<std::ptrdiff_t>(offsets_.size()) - 1; }
  std::ptrdiff_t joint_count() const { return joint_count_; }
  std::ptrdiff_t influence_count() const { return static_cast<std::ptrdiff_t>(joints_.size()); }

  std::span<const float> rest_positions() const { return rest_positions_; }
  std::span<const std::int64_t> offsets() const { return offsets_; }
  std::span<const std::int32_t> joints() const { return joints_; }
  std::span<const float> weights() const { return weights_; }

  /// The largest number of influences that a vertex has.
  std::ptrdiff_t most_influences() const { return most_influences_; }
  /// How many vertices stay at rest because nothing moves them.
  std::ptrdiff_t unweighted_count() const { return unweighted_count_; }
  /// The largest |sum of weights - 1| over the vertices that have a weight.
  double largest_sum_error() const { return largest_sum_error_; }

  /// Gives the same influences another shape, V x 3, such as shape keys make; costs a copy of the
  /// positions. No skinning with this object may be running. Throws InputError, and changes nothing,
  /// for another number of vertices or a number that is not finite.
  void set_rest_positions(std::span<const float> positions);

  /// Returns the packed form for the kernels of the instruction set in use, which must not change meanwhile. It is made
  /// with the object, and again if a set with another register width is chosen later.
  const BlockedSkin& blocked() const;

 private:
  void check() const;
  void drop_dead_influences();
  void measure();

  std::vector<float> rest_positions_;
  std::vector<std::int64_t> offsets_;
  std::vector<std::int32_t> joints_;
  std::vector<float> weights_;
  std::ptrdiff_t joint_count_;
  std::ptrdiff_t most_influences_ = 0;
  std::ptrdiff_t unweighted_count_ = 0;
  double largest_sum_error_ = 0;

  struct Packed;
  std::unique_ptr<Packed> packed_;
};

}  // namespace sinew
