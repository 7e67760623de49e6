/// Direct delta mush: the mesh follows its joints as if it were smoothed after skinning and then given its detail
/// back, but nothing is smoothed at run time.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sinew/progress.h"
#include "sinew/skin.h"
#include "sinew/skinning_method.h"
#include "sinew/types.h"

namespace sinew {

enum class LaplacianKind { cotangent, uniform };

struct MushSettings {
  double smoothing = 3;         ///< lambda: how strongly each iteration smooths the shape
  double weight_smoothing = 1;  ///< kappa: the same for the weights that `blend` uses
  double blend = 0.8;           ///< alpha, 0 to 1: how much of the translation comes from smoothed weights alone
  int iterations = 20;          ///< p: how many times both are smoothed
  LaplacianKind laplacian = LaplacianKind::cotangent;
  /// What is kept per vertex and joint, and how the vertex turns. The paper describes such reductions, too.
  ///   0  ten numbers; the rotation nearest to the deformation of the smoothed neighbourhood: the full method
  ///   1  ten numbers; the inverse transpose of that deformation, with determinant 1, which shears
  ///   2  four numbers; the blend of the joints' quaternions: translations of joints no longer turn the surface
  ///   3  four numbers; the blend of the joints' matrices
  ///   4  one number; the blend of the joints' quaternions about the smoothed rest position
  ///   5  one number; linear blend skinning by the smoothed weights
  int variant = 0;
  /// For each vertex, joints are left out as long as their shares add up to no more than this. It bounds how far that
  /// can move a vertex, as a fraction of the spread of its joints' motions.
  double prune = 1e-5;
};

/// What a DirectDeltaMush has computed, to be saved in a file.
struct MushArrays {
  std::vector<std::int64_t> offsets;  ///< V + 1: vertex v has the entries offsets[v] up to offsets[v + 1]
  std::vector<std::int32_t> joints;   ///< N
  std::vector<float> omega;           ///< N x width_of(variant)
  std::vector<float> centers;         ///< V x 3, the smoothed rest positions p
  std::vector<float> scales;          ///< V
  int variant = 0;
  double pruned = 0;

  /// How many numbers an entry has: 10, 4 or 1. Ten: the upper triangle xx xy xz yy yz zz of the neighbourhood's second
  /// moment about p and its first moment x y z, both divided by the trace of the sum of all joints' second moments;
  /// then the joint's share. Four: first moment and share. One: the share. Multiplied by `scales`, the first moment is
  /// a length.
  static int width_of(int variant) { return variant < 2 ? 10 : variant < 4 ? 4 : 1; }
};

/// A skin prepared for skin_direct_delta_mush. Immutable.
///
/// With u = (rest position, 1), the Laplacian L with its positive diagonal D and S(k) = ((I + k L D^-1)^T)^-p:
///   Psi_ij = S(lambda) of the field w_ij u_i u_i^T,    W' = S(kappa) W,
///   p_i = last column of sum_j Psi_ij, divided by its last entry,
///   Omega_ij = (1 - alpha) Psi_ij + alpha W'_ij [p_i p_i^T, p_i; p_i^T, 1].
/// In a frame, Q = sum_j M(j) Omega_ij, divided by its last entry, is [A q; p^T 1]. With R the rotation nearest to
/// A - q p^T, v' = R v + q - R p.
/// Le, Lewis, "Direct delta mush skinning and variants", ACM TOG 38(4), 2019.
///
/// R does not depend on alpha; for alpha = 1, where its matrix in the formula is 0, the limit is taken. If a vertex's
/// neighbourhood is a point or a line (without faces, without smoothing), the rotation that it leaves undetermined
/// comes from the blend of the joints' matrices. A vertex that no weight reaches stays at rest.
class DirectDeltaMush final : public MethodData {
 public:
  /// skin           V vertices, J joints; kept.
  /// face_offsets   faces + 1, where the corners of each face begin; empty: there are no faces.
  /// face_vertices  C, vertices around each face, face after face; a polygon counts as a fan of triangles.
  /// progress       or null. If it is cancelled, null is returned within about 0.1 s.
  /// On two busy cores, 30,000 vertices with 60 joints took 3.6 s and 90 MB, of which 16 MB remain in use; 180,000 with
  /// 300 joints took 46 s and 470 MB, of which 99 MB remain in use.
  /// The result has the same bits for any number of threads. The skin must not change meanwhile. Throws InputError for
  /// faces that do not fit and for settings out of range.
  static std::shared_ptr<DirectDeltaMush> compute(std::shared_ptr<const Skin> skin,
                                                  std::span<const std::int32_t> face_offsets,
                                                  std::span<const std::int32_t> face_vertices,
                                                  const MushSettings& settings = {}, Progress* progress = nullptr);

  /// Restores what `arrays` returned for the same rest positions. Throws InputError for sizes that do not fit and for
  /// numbers that are out of range or not finite.
  DirectDeltaMush(std::shared_ptr<const Skin> skin, const MushArrays& arrays);
  ~DirectDeltaMush() override;

  SkinningMethod method() const override { return SkinningMethod::direct_delta_mush; }
  std::ptrdiff_t vertex_count() const override { return skin_->vertex_count(); }
  std::optional<std::ptrdiff_t> joint_count() const override { return skin_->joint_count(); }

  const std::shared_ptr<const Skin>& skin() const { return skin_; }
  int variant() const;
  /// The most that was left out of a vertex, see MushSettings::prune.
  double pruned() const { return pruned_; }
  /// N.
  std::ptrdiff_t entry_count() const { return entries_; }
  /// How many bytes of memory it takes, without the skin.
  std::size_t bytes() const;
  MushArrays arrays() const;

  struct Packed;
  /// For the kernels.
  const Packed& packed() const { return *packed_; }

 private:
  std::shared_ptr<const Skin> skin_;
  std::unique_ptr<const Packed> packed_;
  double pruned_ = 0;
  std::ptrdiff_t entries_ = 0;
};

}  // namespace sinew
