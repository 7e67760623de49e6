/// What a lattice does around its points, compiled for several instruction sets.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace sinew {

/// The points of a lattice in one frame. They are stored with u changing fastest, and beyond both ends of each axis its
/// last point is repeated, so that the points that have an effect on a place are in a row, wherever it is.
struct LatticeField {
  static constexpr std::size_t kMost = 4, kNumbers = 4;

  struct Axis {
    float from_mesh[4];           ///< the place in lattice space is the sum of these times x, y, z and 1
    float first, step;            ///< lattice space: where the points begin at rest, and their spacing
    float lowest, highest;        ///< in steps from the first: beyond these, all that have an effect are the same point
    std::size_t taps;             ///< how many points have an effect on a place, kMost at most
    std::ptrdiff_t before;        ///< from the first of these points to the cell of the place
    std::size_t stride;           ///< from a point to the next, in floats
    float weights[kMost][kMost];  ///< of each of the points, by the powers of the place in its cell
  };

  Axis axes[3];               ///< u, v, w
  std::vector<float> points;  ///< differences from rest in mesh space and the point's own weight, then zeros
  bool has_weights;           ///< whether the points' own weights count
};

/// Moves those of a mesh's vertices. weights  how much of the effect each gets, times strength; positions  V x 3.
void move_vertices(const LatticeField& field, std::span<const std::uint32_t> vertices, const float* weights,
                   float strength, float* positions);

}  // namespace sinew
