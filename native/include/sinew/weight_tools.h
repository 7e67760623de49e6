/// What people do with weights: smooth, reduce, mirror, transfer.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "sinew/faces.h"
#include "sinew/progress.h"
#include "sinew/types.h"
#include "sinew/weight_table.h"

namespace sinew {

// All of these take a progress, or null. If it is cancelled, nothing is returned, soon. Results have the same bits for any
// number of threads. They throw InputError for sizes that do not fit, vertices and bones that do not exist, numbers that
// are not finite, settings out of range.

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
/// edges. Otherwise in steps: w' = w + factor (mean of neighbours - w). Sums stay, and what is below a millionth of them (after
/// a solve, a hundred-thousandth) is left out. Where bones are locked, the others' weights are scaled to the sum that they had.
std::optional<WeightTable> smooth_weights(const WeightTable& weights, const Faces& faces,
                                          const SmoothWeightsSettings& settings, Progress* progress = nullptr);

struct ReducedWeights {
  WeightTable weights;
  std::vector<float> largest, mean;  ///< V: how far each vertex moves by it, over the poses, in the unit of positions
};

struct ReduceSettings {
  int most = 4;                          ///< 1 to 64: weights of a vertex
  int rings = 0;                         ///< 0 to 64
  std::span<const std::int32_t> locked;  ///< bones whose weights stay, and count; one other may stay beside them
};

/// Leaves each vertex at most `most` weights, with the sum that it had. Which go is decided by how far the vertex moves
/// without them in the poses: the set is kept for which the largest move is smallest. All sets are tried if they are few,
/// else weights leave one by one; of very many, those leave first that can move the vertex least. What is kept is fitted
/// anew, by least squares over the poses on a simplex, unless that makes the largest move longer. So that no weight ends
/// between two neighbours, weights of a bone fade out over `rings` edges towards the vertices that have lost it; those of
/// vertices with a locked weight do not.
/// positions  V x 3, at rest.  matrices  F x B, skinning matrices.
std::optional<ReducedWeights> reduce_weights(const WeightTable& weights, std::span<const float> positions,
                                             MatrixStack<const double> matrices, const Faces& faces,
                                             const ReduceSettings& settings, Progress* progress = nullptr);

struct MirrorSettings {
  int axis = 0;                 ///< 0 to 2: x, y, z
  double origin = 0;            ///< of the mirror plane, on that axis
  bool from_positive = true;    ///< which side is copied to the other
  double middle = 1e-5;         ///< share of the mesh's size: vertices so near the plane are of both sides
  std::span<const float> mask;  ///< V, or empty: vertices below 0.5 stay
};

/// Copies weights from one side to the other: each vertex gets those of the closest point of the mirrored surface, with
/// bones swapped. Vertices on the plane get the mean of their own and their mirrored weights. In faces that cross the
/// plane, only the corners on the side that is copied count.
/// pairs  B: the bone on the other side of each; a bone in the middle is its own.
std::optional<WeightTable> mirror_weights(const WeightTable& weights, std::span<const float> positions,
                                          const Faces& faces, std::span<const std::int32_t> pairs,
                                          const MirrorSettings& settings, Progress* progress = nullptr);

struct TransferSettings {
  double distance = 0.05;  ///< above 0: share of the diagonal of the target's bounding box
  double angle = 30;       ///< 0 to 180 degrees, between normals
  bool flipped = false;    ///< normals may also be opposite, as those of inner layers
};

struct TransferredWeights {
  WeightTable weights;                ///< W rows, each with sum 1
  std::vector<std::uint8_t> matched;  ///< W: whether the weights are those of the closest point of the source
};

/// Copies weights from a surface to another one. A vertex is matched if the closest point of the source has weights, is
/// near and faces the same way; it gets the weights there. Where the surroundings lie on the source (within 1.25 % of the
/// target's diagonal) it may face up to 60 degrees away, or any way unless a face of the source near by faces as it does.
/// The others get the smoothest weights that agree with these on their island: L M^-1 L w = 0, with L the Laplacian of cotangents, clamped to 0.01..20, and M areas; where that is below
/// 0, the nearest weights that are not, with sum 1. Where points have so many neighbours that this would take too long,
/// L w = 0. An island without a match is rigid: it follows the nearest point with weights, of another island or of the
/// source. After Abdrashitov, Raichstat, Monsen, Hill, "Robust skin weights transfer via weight inpainting", SIGGRAPH Asia
/// 2023, without the term that depends on the unit.
std::optional<TransferredWeights> transfer_weights(std::span<const float> source_positions, const Faces& source_faces,
                                                   const WeightTable& source_weights, std::span<const float> positions,
                                                   const Faces& faces, const TransferSettings& settings,
                                                   Progress* progress = nullptr);

}  // namespace sinew
