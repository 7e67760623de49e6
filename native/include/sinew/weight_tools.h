/// What people do with weights: smooth, reduce, mirror, transfer.
///
/// Weights are tables, V x B float32, row by row: a column for each bone.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sinew/types.h"

namespace sinew {

struct WeightTable {
  std::span<const float> numbers;  ///< V x B
  std::ptrdiff_t vertices = 0, bones = 0;

  const float* row(std::ptrdiff_t vertex) const { return numbers.data() + vertex * bones; }
};

/// Polygons, as in Topology; both may be empty: there are no faces.
struct Faces {
  std::span<const std::int32_t> offsets;   ///< faces + 1, where the corners of each begin
  std::span<const std::int32_t> vertices;  ///< C, face after face
};

struct SmoothWeightsSettings {
  double strength = 0;  ///< 0 to 1e6: t below; 0: steps
  int steps = 5;        ///< 0 to 10,000
  double factor = 0.5;  ///< 0 to 1: how far a step goes
  /// V numbers from 0 (fixed) to 1, or empty: how far each vertex follows a step. With strength, fixed if below 0.5.
  std::span<const float> mask;
  std::span<const std::int32_t> locked;  ///< bones whose weights stay
  /// V x 3, or empty: vertices that coincide get equal weights.
  std::span<const float> positions;
};

/// Smooths the weights of all bones along edges. With a strength, in one solve: (I + t L) w' = w, where L is the identity
/// less the mean of the neighbours, so that each w' is a mean of weights around, which counts as far as about sqrt(t)
/// edges. Otherwise in steps: w' = w + factor (mean of neighbours - w). Sums stay. Where bones are locked, the others'
/// weights are scaled to the sum that they had. Returns V x B.
std::vector<float> smooth_weights(const WeightTable& weights, const Faces& faces,
                                  const SmoothWeightsSettings& settings);

struct ReducedWeights {
  std::vector<float> weights;        ///< V x B
  std::vector<float> largest, mean;  ///< V: how far each vertex moves by it, over the poses, in the unit of positions
};

struct ReduceSettings {
  int most = 4;   ///< 1 to 64: weights of a vertex
  int rings = 0;  ///< 0 to 64
};

/// Leaves each vertex at most `most` weights, with the sum that it had. Which go is decided by how far the vertex moves
/// without them in the poses: the set is kept for which the largest move is smallest (all sets are tried if they are few,
/// else weights leave one by one). What is kept is fitted anew, by least squares over the poses on a simplex, unless that
/// makes the largest move longer. So that no weight ends between two neighbours, weights of a bone fade out over `rings`
/// edges towards the vertices that have lost it.
/// positions  V x 3, at rest.  matrices  F x B, skinning matrices.
ReducedWeights reduce_weights(const WeightTable& weights, std::span<const float> positions,
                              MatrixStack<const double> matrices, const Faces& faces, const ReduceSettings& settings);

struct MirrorSettings {
  int axis = 0;                 ///< 0 to 2: x, y, z
  double origin = 0;            ///< of the mirror plane, on that axis
  bool from_positive = true;    ///< which side is copied to the other
  double middle = 1e-5;         ///< share of the mesh's size: vertices so near the plane are of both sides
  std::span<const float> mask;  ///< V, or empty: vertices below 0.5 stay
};

/// Copies weights from one side to the other: each vertex gets those of the closest point of the mirrored surface, with
/// bones swapped. Vertices on the plane get the mean of their own and their mirrored weights.
/// pairs  B: the bone on the other side of each; a bone in the middle is its own.
std::vector<float> mirror_weights(const WeightTable& weights, std::span<const float> positions, const Faces& faces,
                                  std::span<const std::int32_t> pairs, const MirrorSettings& settings);

struct TransferSettings {
  double distance = 0.05;  ///< above 0: share of the diagonal of the target's bounding box
  double angle = 30;       ///< 0 to 180 degrees, between normals
  bool flipped = false;    ///< normals may also be opposite, as those of inner layers
};

struct TransferredWeights {
  std::vector<float> weights;         ///< W x B
  std::vector<std::uint8_t> matched;  ///< W: whether the weights are those of the closest point of the source
};

/// Copies weights from a surface to another one. A vertex is matched if the closest point of the source is near and faces
/// the same way; it gets the weights there. The others get the smoothest weights that agree with these on their island:
/// L M^-1 L w = 0, with L the Laplacian of cotangents, clamped to 0.01..20, and M areas; where that is below 0, the nearest
/// weights that are not, with sum 1. An island without a match is rigid: it follows the nearest point of an island that has
/// weights, or of the source. After Abdrashitov, Raichstat, Monsen, Hill, "Robust skin weights transfer via weight
/// inpainting", SIGGRAPH Asia 2023, without the term that depends on the unit.
TransferredWeights transfer_weights(std::span<const float> source_positions, const Faces& source_faces,
                                    const WeightTable& source_weights, std::span<const float> positions,
                                    const Faces& faces, const TransferSettings& settings);

}  // namespace sinew
