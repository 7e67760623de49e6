/// Blender's Lattice modifier.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sinew/types.h"
#include "sinew/vertex_group.h"

namespace sinew {

struct LatticeField;

/// How a lattice interpolates between its points along one of its axes.
enum class Spline { linear, cardinal, catmull_rom, b_spline };

/// The points of a lattice in one frame, prepared for the vertices of a mesh. Immutable.
class LatticePoints {
 public:
  struct Grid {
    std::array<std::int32_t, 3> counts{};   ///< of points along the axes u, v and w
    std::array<float, 3> first{}, step{};   ///< in lattice space: where the rest grid begins, and its spacing
    std::array<Spline, 3> interpolation{};  ///< along each axis
  };

  /// points             P x 3, lattice space, where u changes fastest; P is the product of the counts.
  /// lattice_from_mesh  maps mesh space to lattice space; it must be invertible.
  /// weights            P, of the lattice's own vertex group: how much of the effect is kept around each point; may be
  ///                    empty: all of it.
  /// Throws InputError for counts below 1, for sizes that do not fit and for numbers that are not finite.
  LatticePoints(const Grid& grid, std::span<const float> points, const Matrix4<float>& lattice_from_mesh,
                std::span<const float> weights = {});

  /// As the kernels read them.
  const LatticeField& field() const { return *field_; }

 private:
  std::shared_ptr<const LatticeField> field_;
};

/// Moves each vertex with the points of a lattice around it, in float32 as Blender does, up to the order of the sum.
/// Immutable; several threads may use one object at once.
class Lattice {
 public:
  struct Settings {
    std::shared_ptr<const LatticePoints> points;
    float strength = 1;  ///< any finite number
  };

  /// vertex_count  V.
  /// group         V weights. Vertices of weight 0 or less do not move, and cost nothing.
  /// Throws InputError if the number of weights is not V and for a weight that is not finite.
  explicit Lattice(std::ptrdiff_t vertex_count, const VertexGroup& group = {});

  /// V.
  std::ptrdiff_t vertex_count() const { return vertex_count_; }

  /// Throws what apply() would throw for invalid settings, and does nothing else.
  void check(const Settings& settings) const;

  /// The approximate time of apply() on one thread.
  double microseconds(const Settings& settings) const;

  /// positions  in and out, V x 3. Allocates nothing. The result has the same bits for any number of threads.
  /// Throws InputError if the shape does not fit, for a strength that is not finite and without points.
  void apply(const Settings& settings, std::span<float> positions) const;

 private:
  std::ptrdiff_t vertex_count_;
  std::vector<std::uint32_t> vertices_;
  std::vector<float> weights_;  // of vertices_
};

}  // namespace sinew
