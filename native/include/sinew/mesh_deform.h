/// Blender's Mesh Deform modifier, bound without Dynamic.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sinew/types.h"
#include "sinew/vertex_group.h"

namespace sinew {

/// Moves each vertex by the weighted mean of how far the vertices of a cage have moved since the mesh was bound:
///   x_v += weight_v R sum_i(w_i (B c_i - b_i)) / sum_i(w_i)
/// in float32 as Blender does, in the order of the cage's vertices. Immutable; several threads may use one object at once.
class MeshDeform {
 public:
  struct Settings {
    std::shared_ptr<const std::vector<float>> differences;          ///< as `differences` returns
    Eigen::Matrix3f mesh_from_bound = Eigen::Matrix3f::Identity();  ///< R, from the space of the bound cage
  };

  /// What a mesh was bound with.
  struct Binding {
    std::span<const std::int32_t> offsets;        ///< V + 1: where the influences of each vertex begin
    std::span<const std::int32_t> cage_vertices;  ///< of each influence
    std::span<const float> weights;               ///< w_i, of each influence
    std::span<const float> cage_positions;        ///< C x 3: b_i
  };

  /// Vertices whose influences sum up to 0 or less do not move, nor do those of a weight of 0 or less in the group.
  /// Throws InputError for sizes that do not fit, for cage vertices out of range and for numbers that are not finite.
  explicit MeshDeform(const Binding& binding, const VertexGroup& group = {});

  /// V.
  std::ptrdiff_t vertex_count() const { return vertex_count_; }
  /// C.
  std::ptrdiff_t cage_vertex_count() const { return std::ssize(bound_) / 3; }

  /// Returns how far the vertices of the cage have moved, for Settings. cage: C x 3, in its own space; bound_from_cage: B.
  /// Throws InputError if the shape does not fit.
  std::shared_ptr<const std::vector<float>> differences(std::span<const float> cage,
                                                        const Matrix4<float>& bound_from_cage) const;

  /// Throws what apply() would throw for invalid settings, and does nothing else.
  void check(const Settings& settings) const;

  /// The approximate time of apply() on one thread.
  double microseconds(const Settings& settings) const;

  /// positions  in and out, V x 3. Allocates nothing. The result has the same bits for any number of threads.
  /// Throws InputError if the shape does not fit, for a matrix that is not finite and without differences of C vertices.
  void apply(const Settings& settings, std::span<float> positions) const;

 private:
  struct Blocks;

  std::ptrdiff_t vertex_count_;
  std::vector<float> bound_;  // C x 3
  std::shared_ptr<const Blocks> blocks_;
};

}  // namespace sinew
