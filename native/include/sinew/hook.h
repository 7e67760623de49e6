/// Blender's Hook modifier.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "sinew/types.h"
#include "sinew/vertex_group.h"

namespace sinew {

/// How a hook's strength falls from its centre, where it is 1, to its radius, where it is 0.
/// d is the distance in radii, f = 1 - d.
enum class Falloff {
  none,  ///< the radius says nothing
  constant,
  linear,          ///< f
  smooth,          ///< 3 f^2 - 2 f^3
  sharp,           ///< f^2
  root,            ///< sqrt f
  sphere,          ///< sqrt (2 f - f^2)
  inverse_square,  ///< 1 - d^2
};

/// Moves vertices by a matrix: x_v += part_v (M x_v - x_v), part_v = strength falloff_v weight_v,
/// in float32 as Blender does. Immutable; several threads may use one at once.
class Hook {
 public:
  struct Settings {
    Matrix4<float> matrix = Matrix4<float>::Identity();  ///< M, in the space of the mesh
    float strength = 1;                                  ///< any finite number
    Falloff falloff = Falloff::none;
    float radius = 0;  ///< 0 is no falloff
    Eigen::Vector3f center = Eigen::Vector3f::Zero();
    /// Distances are measured after this has been applied; nothing: in the space of the mesh.
    std::optional<Eigen::Matrix3f> uniform{};
  };

  /// vertex_count  V.
  /// vertices      those that are hooked, one after the other, so that one that is named twice is
  ///               moved twice; nothing: all that the group has.
  /// group         V weights. Without vertices and without a group, nothing is hooked, as in
  ///               Blender.
  /// Throws InputError for a vertex out of range, for a number of weights other than V and for one
  /// that is not finite.
  Hook(std::ptrdiff_t vertex_count, std::optional<std::span<const std::int32_t>> vertices,
       const VertexGroup& group = {});

  /// V.
  std::ptrdiff_t vertex_count() const { return vertex_count_; }

  /// What apply() throws for settings that are wrong, without doing anything.
  void check(const Settings& settings) const;

  /// positions  in and out, V x 3. Allocates nothing. The same bits for any number of threads.
  /// Throws InputError if the shape does not fit, and for a setting that is not finite.
  void apply(const Settings& settings, std::span<float> positions) const;

 private:
  std::ptrdiff_t vertex_count_;
  std::vector<std::uint32_t> vertices_;
  std::vector<float> weights_;  // beside them
  bool names_twice_ = false;
};

}  // namespace sinew
