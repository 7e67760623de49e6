/// Everything that happens to one mesh in a frame.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "sinew/layer.h"
#include "sinew/shape_keys.h"
#include "sinew/stage.h"
#include "sinew/stencils.h"

namespace sinew {

/// Input (the first skin's rest positions, or shape keys, or the caller's positions) -> layers, all
/// applied to that same input, each in its space and with its mask -> mixed by their shares ->
/// stages, one after the other -> stencils -> output.
///
/// Immutable and stateless: several threads may deform with one object at once.
class Deformer {
 public:
  /// layers  may be empty if there are keys, whose sum the stages then get.
  /// keys    or null.
  /// stencils  what the output is made by from the shape behind the stages, or null: the output is that shape.
  /// Throws InputError if two of them have different numbers of vertices, if the first layer has a
  /// share, if another layer has none, or if there are neither layers nor keys.
  explicit Deformer(std::vector<std::shared_ptr<const Layer>> layers, std::shared_ptr<const ShapeKeys> keys = nullptr,
                    std::shared_ptr<const Stencils> stencils = nullptr);
  /// For stages alone, which get the rest_positions. vertex_count is V.
  explicit Deformer(std::ptrdiff_t vertex_count, std::shared_ptr<const Stencils> stencils = nullptr);
  ~Deformer();
  Deformer(Deformer&&) noexcept;

  /// V.
  std::ptrdiff_t vertex_count() const { return vertex_count_; }
  /// R, the number of vertices of the output: V without stencils.
  std::ptrdiff_t result_count() const { return stencils_ ? stencils_->count() : vertex_count_; }
  /// Of how many steps deform tells the times.
  std::size_t step_count(std::size_t stages) const { return stages + (stencils_ ? 2 : 1); }
  const std::vector<std::shared_ptr<const Layer>>& layers() const { return layers_; }

  /// poses           one per layer.
  /// positions       out, R x 3, in mesh space.
  /// key_values      K, the value of each key, 0 for those that are muted; empty: 0 for all.
  /// rest_positions  V x 3, in place of those of the skin and of the keys; empty: use those.
  /// stages          each of V vertices, in the order in which they are applied.
  /// milliseconds    out, step_count(stages): the time of keys and layers, then that of each stage,
  ///                 then that of the stencils if there are any; empty: not measured.
  ///
  /// Uses one parallel region for keys and layers and a few for each stage. Allocates nothing once
  /// each thread has seen layers of this size. The result has the same bits for any number of threads.
  /// Throws InputError, and writes nothing, if a shape does not fit, if a stage's settings are invalid,
  /// for key values without keys or together with rest positions, and if positions and rest_positions
  /// overlap.
  void deform(std::span<const LayerPose> poses, std::span<float> positions, std::span<const float> key_values = {},
              std::span<const float> rest_positions = {}, std::span<const Stage> stages = {},
              std::span<double> milliseconds = {}) const;

 private:
  struct Scratch;

  void check(std::span<const LayerPose> poses, std::span<float> positions, std::span<const float> key_values,
             std::span<const float> rest_positions, std::span<const Stage> stages,
             std::span<double> milliseconds) const;
  /// What comes before the stencils. The arguments are those of deform, with V positions, and checked.
  void make_shape(std::span<const LayerPose> poses, std::span<float> positions, std::span<const float> key_values,
                  std::span<const float> rest_positions, std::span<const Stage> stages,
                  std::span<double> milliseconds) const;

  std::vector<std::shared_ptr<const Layer>> layers_;
  std::shared_ptr<const ShapeKeys> keys_;
  std::shared_ptr<const Stencils> stencils_;
  std::ptrdiff_t vertex_count_ = 0;
  std::unique_ptr<Scratch> scratch_;  // with stencils
};

}  // namespace sinew
