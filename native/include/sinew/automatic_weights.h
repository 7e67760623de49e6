/// Weights for any mesh and any bones, from their shapes alone.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "sinew/progress.h"
#include "sinew/types.h"
#include "sinew/weight_table.h"

namespace sinew {

/// heat     on the surface where it can, in the volume elsewhere.
/// volume   heat in the volume, for all vertices: softer in folds, continuous from part to part.
/// nearest  each vertex follows the nearest bone, through the air.
enum class WeightMethod { heat, volume, nearest };

/// What the vertices of a rigid part follow: where the part is attached to the rest, or one bone.
enum class RigidFollow { attachment, bone };

/// B bones: segments from head to tail, in the space of the positions. Their lengths may be zero.
struct WeightBones {
  std::span<const double> heads;         ///< B x 3
  std::span<const double> tails;         ///< B x 3
  std::span<const std::int32_t> joints;  ///< B, the joint of each; bones may share one. Empty: bone b is joint b.
};

/// Vertices whose weights are given. The others' are solved for around them.
struct FixedWeights {
  std::span<const std::int32_t> vertices;  ///< F
  WeightTable weights;                     ///< F rows of J joints, each with a sum above 0, by which it is divided
};

struct WeightSettings {
  WeightMethod method = WeightMethod::heat;
  int resolution = 128;        ///< 8 to 256: voxels along the longest side of the mesh; fewer if it is bulky
  double stiffness = 8;        ///< c: how closely weights follow the nearest bone; Blender's bone heat is about 4
  int max_influences = 0;      ///< of a vertex; 0: any number
  double least_weight = 0.01;  ///< 0 to 0.5: smaller ones are left out
  /// V numbers, or empty: vertices with the same number, 0 or more, are a rigid part: all get the same weights.
  std::span<const std::int32_t> rigid_parts;
  /// 0 to 1: connected parts whose bounding box has a diagonal shorter than this share of the mesh's are rigid, too.
  double rigid_size = 0;
  RigidFollow rigid_follow = RigidFollow::attachment;
};

/// How a vertex got its weights.
enum class WeightWay : std::uint8_t { surface, volume, nearest, fixed, rigid };

struct AutomaticWeights {
  WeightTable weights;              ///< V rows of J joints, each with one weight at least, and sum 1
  std::vector<WeightWay> ways;      ///< V
  std::vector<std::int32_t> parts;  ///< V: the connected part of each vertex; coincident vertices are connected
  std::int32_t part_count = 0;
  std::vector<std::int32_t> bones_outside;  ///< ascending: bones of which nothing is inside the mesh
  double voxel_size = 0;                    ///< in the unit of the positions
  double seconds = 0;                       ///< that it took
};

/// Computes weights by heat diffusion. Positions are scaled to size 1 about the centre of their bounding box, and
/// vertices closer than about 1e-5 are welded. With L the Laplacian of cotangents, clamped to 0..20, A the barycentric
/// areas:
///   (L + A H) w_j = A H p_j,  H_i = c / d_i^2,  d_i = min_j d_ij,
///   d_ij = g_ij / (0.5 (cos_ij + 1.001))^1.5,  p_ij the share of bone j in those about as near as the nearest.
/// g_ij is the distance from vertex i to bone j through the solid, cos_ij between the vertex's normal and the direction
/// from the bone's closest point. Baran, Popović, "Automatic rigging and animation of 3D characters", ACM TOG 26(3),
/// 2007, with distances through a solid in place of visibility. The solid is made of voxels: those that the surface
/// meets and those with |generalised winding number| > 1/2 (Jacobson, Kavan, Sorkine-Hornung 2013, by Barill et al.
/// 2018). Around joints with bones shorter than five voxels, those that the surface meets are divided into smaller cubes,
/// so that parts closer than a voxel stay apart. L has no positive entry off its diagonal and H is above 0, so that the matrix is positive definite for any
/// mesh, weights lie between 0 and 1, and their sum is 1. For parts smaller than a few voxels the same equation
/// is solved among voxels, where L is the Laplacian of their graph, A = 1, H = c h^2 / d^2, with h
/// the voxel's size.
///
/// positions      V x 3, finite, in any unit and space.
/// face_offsets   faces + 1, where the corners of each face begin; empty: there are no faces.
/// face_vertices  C, vertices around each face; a polygon counts as a fan of triangles.
/// progress       or null. If it is cancelled, nothing is returned, after 0.1 s, or when the matrix is ordered: 0.2 s for
///                300,000 vertices.
/// On two busy cores, 53,514 vertices with 52 bones took 0.3 s, 214,050 1.1 s, 856,194 6 s and 0.9 GB.
/// The result has the same bits for any number of threads. Throws InputError for sizes that do not fit, vertices and
/// joints that do not exist, numbers that are not finite, no bones, settings out of range.
std::optional<AutomaticWeights> automatic_weights(std::span<const double> positions,
                                                  std::span<const std::int32_t> face_offsets,
                                                  std::span<const std::int32_t> face_vertices, const WeightBones& bones,
                                                  const FixedWeights& fixed = {}, const WeightSettings& settings = {},
                                                  Progress* progress = nullptr);

}  // namespace sinew
