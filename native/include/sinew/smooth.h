/// Blender's Smooth modifier.
#pragma once

#include <memory>
#include <span>

#include "sinew/topology.h"
#include "sinew/vertex_group.h"

namespace sinew {

/// Moves each vertex towards the mean of the midpoints of its edges, iteration by iteration:
///   x_v = (1 - f_v) x_v + f_v mean,   f_v = weight_v factor,
/// to the bit as Blender does in float32. A vertex without edges has the mean 0, also as in
/// Blender. Immutable; several threads may use one object at once.
class Smooth {
 public:
  struct Settings {
    /// Any finite number, even outside of 0 to 1. (Blender 3.4 does nothing if it is negative and there
    /// is a group: that case is left to the caller.)
    float factor = 0.5f;
    int iterations = 1;                 ///< if 0 or less, nothing happens
    bool x = true, y = true, z = true;  ///< the axes along which vertices move
  };

  /// group  V weights. Copied. Vertices of weight 0 or less do not move, and cost nothing.
  /// Throws InputError if the number of weights is not V and for a weight that is not finite.
  explicit Smooth(std::shared_ptr<const Topology> topology, const VertexGroup& group = {});
  Smooth(Smooth&&) noexcept;
  ~Smooth();

  /// V.
  std::ptrdiff_t vertex_count() const;

  /// Throws what apply() would throw for invalid settings, and does nothing else.
  void check(const Settings& settings) const;

  /// The approximate time of apply() on one thread.
  double microseconds(const Settings& settings) const;

  /// positions  in and out, V x 3. Only the first call, and the first that runs concurrently with
  ///            others, allocate anything. The result has the same bits for any number of threads.
  /// Throws InputError if the shape does not fit, and for a factor that is not finite.
  void apply(const Settings& settings, std::span<float> positions) const;

 private:
  class Body;
  std::unique_ptr<const Body> body_;
};

}  // namespace sinew
