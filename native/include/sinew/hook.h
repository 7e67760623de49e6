/// Blender's Hook modifier.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "sinew/types.h"
#include "sinew/vertex_group.h"

namespace sinew {

/// How a hook's strength falls from 1 at its centre to 0 at its radius. d is the distance divided by
/// the radius, f = 1 - d.
enum class Falloff {
  none,  ///< the radius has no effect
  constant,
  linear,          ///< f
  smooth,          ///< 3 f^2 - 2 f^3
  sharp,           ///< f^2
  root,            ///< sqrt f
  sphere,          ///< sqrt (2 f - f^2)
  inverse_square,  ///< 1 - d^2
};

/// Moves vertices by a matrix: x_v += part_v (M x_v - x_v), part_v = strength falloff_v weight_v,
/// in float32 as Blender does. Immutable; several threads may use one object at once.
class Hook {
 public:
  struct Settings {
    Matrix4<float> matrix = Matrix4<float>::Identity();  ///< M, in mesh space
    float strength = 1;                                  ///< any finite number
    Falloff falloff = Falloff::none;
    float radius = 0;  ///< 0: no falloff
    Eigen::Vector3f center = Eigen::Vector3f::Zero();
    /// Distances are measured after this transform; nullopt: in mesh space.
    std::optional<Eigen::Matrix3f> uniform{};
  };

  /// vertex_count  V.
  /// vertices      the hooked vertices, moved one after the other: one that is listed twice is moved
  ///               twice; nullopt: all vertices in the group.
  /// group         V weights. Without vertices and without a group, nothing is hooked, as in
  ///               Blender.
  /// Throws InputError for a vertex out of range, if the number of weights is not V and for a weight
  /// that is not finite.
  Hook(std::ptrdiff_t vertex_count, std::optional<std::span<const std::int32_t>> vertices,
       const VertexGroup& group = {});

  /// V.
  std::ptrdiff_t vertex_count() const { return vertex_count_; }

  /// Throws what apply() would throw for invalid settings, and does nothing else.
  void check(const Settings& settings) const;

  /// The approximate time of apply() on one thread.
  double microseconds(const Settings& settings) const;

  /// positions  in and out, V x 3. Allocates nothing. The result has the same bits for any number of
  ///            threads.
  /// Throws InputError if the shape does not fit, and for a setting that is not finite.
  void apply(const Settings& settings, std::span<float> positions) const;

 private:
  std::ptrdiff_t vertex_count_;
  std::vector<std::uint32_t> vertices_;
  std::vector<float> weights_;  // of vertices_
  bool names_twice_ = false;
};

}  // namespace sinew
