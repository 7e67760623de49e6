/// Smooth skinning decomposition: joints and weights that play a deformation.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "sinew/progress.h"
#include "sinew/types.h"
#include "sinew/weight_table.h"

namespace sinew {

/// A mesh in motion. All positions are in one space and unit.
struct DeformedMesh {
  std::span<const float> rest;    ///< V x 3
  std::span<const float> frames;  ///< F x V x 3
  /// faces + 1, where the corners of each face begin; empty: there are no faces.
  std::span<const std::int32_t> face_offsets;
  std::span<const std::int32_t> face_vertices;  ///< C, vertices around each face
};

/// What is known. Exactly one of joint_count, matrices and weights is given, or heads alone.
struct DecompositionStart {
  /// At most so many joints are found, with their weights; fewer if fewer move the mesh exactly.
  std::int32_t joint_count = 0;
  /// J x 3, the origins of the joints at rest, or empty. Alone: each vertex begins at the nearest one, and J joints and
  /// their weights are found. With matrices or weights they are where the joints of the result are.
  std::span<const double> heads;
  /// F x J, row by row, skinning matrices of any kind: weights for them are found.
  std::span<const Matrix4<double>> matrices;
  WeightTable weights;  ///< V rows of J joints, or without bones: rigid motions of joints for these weights are found
};

struct DecompositionSettings {
  int max_influences = 8;   ///< 1 to 64, of a vertex; given weights are kept
  int iterations = 30;      ///< 1 to 10,000, of motions and weights
  double smoothing = 1e-4;  ///< 0 to 1: epsilon below
  /// Whether vertices follow only joints that move something near them. Otherwise any joint is tried at every vertex:
  /// more influences, less error, more time.
  bool local = true;
  double tolerance = 1e-3;  ///< 0 to 1: ends when three iterations lower the error by less than this share of it
};

struct Decomposition {
  WeightTable weights;                 ///< V rows of J joints, each with sum 1 (given ones as they were)
  std::vector<Matrix4<double>> rest;   ///< J, the joints at rest: where they are, unturned
  std::vector<Matrix4<double>> poses;  ///< F x J skinning matrices, frame after frame
  /// Distances between what skinning gives and the frames, in the unit of the positions: the root of the mean square,
  /// the mean and the largest over all vertices and frames.
  double rms = 0, mean = 0, largest = 0;
  std::vector<float> vertex_rms, vertex_largest;  ///< V, the same over the frames
  int iterations = 0;                             ///< that were done

  std::ptrdiff_t joint_count() const { return std::ssize(rest); }
};

/// Finds motions M_fj = (R_fj, t_fj) of joints and weights w_vj that minimise
///   sum_fv |x_fv - sum_j w_vj M_fj u_v|^2,   w >= 0,  sum_j w_vj = 1,  at most K weights at a vertex,
/// for positions u at rest and x in the frames. Le, Deng, "Smooth skinning decomposition with rigid bones", ACM TOG 31(6),
/// 2012: motions and weights in turns. With weights fixed, one joint of one frame is a weighted Procrustes problem: for
/// its share q_v = x_v - sum_{k != j} w_vk M_k u_v, R is the rotation nearest to sum_v w (q_v - q) (u_v - p)^T about the
/// weighted means p and q. With motions fixed, each vertex is a least-squares problem on a simplex, solved by an active
/// set. Its weights are drawn to a smooth neighbour: epsilon F size^2 |w - w*|^2, where w* = (I + L)^-1 w, L row by row
/// the mean of neighbours, each by how little the distance to it changes (Le, Deng, "Robust and accurate skeletal rigging
/// from mesh sequences", ACM TOG 33(4), 2014), and size is the root mean square distance from the centroid. Clusters to
/// begin with are split in two until there are enough. Parts of the mesh that no face joins are tied where they are
/// nearest; coincident vertices that move alike get equal weights.
///
/// progress  or null. If it is cancelled, nothing is returned.
/// The result has the same bits for any number of threads. Throws InputError for no vertices or frames, sizes that do not
/// fit, vertices and joints that do not exist, numbers that are not finite, settings out of range.
std::optional<Decomposition> decompose(const DeformedMesh& mesh, const DecompositionStart& start,
                                       const DecompositionSettings& settings = {}, Progress* progress = nullptr);

}  // namespace sinew
