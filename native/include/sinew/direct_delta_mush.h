/// Direct delta mush: the mesh follows its joints as if it had been smoothed after skinning and had then got its
/// detail back, without smoothing anything on a frame.
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
  double smoothing = 3;         ///< lambda: how much each smoothing of the shape takes
  double weight_smoothing = 1;  ///< kappa: the same for the weights that alone carry the share `blend`
  double blend = 0.8;           ///< alpha, 0 to 1: how much of the translation comes from smoothed weights alone
  int iterations = 20;          ///< p: how often both are smoothed
  LaplacianKind laplacian = LaplacianKind::cotangent;
  /// What is kept of a vertex and joint, and how the vertex turns; the paper has such reductions too.
  ///   0  ten numbers, the rotation nearest to how the smoothed neighbourhood is deformed: the method itself
  ///   1  ten numbers, the inverse transpose of that deformation with determinant 1: shears
  ///   2  four numbers, the blend of the joints' quaternions: translations of joints no longer turn the surface
  ///   3  four numbers, the blend of the joints' matrices
  ///   4  one number, the blend of the joints' quaternions about the smoothed rest position
  ///   5  one number: linear blend skinning by the smoothed weights
  int variant = 0;
  /// Of each vertex, joints are left out whose shares add up to so little. How far that can move a vertex: so much
  /// of how far its joints move it apart.
  double prune = 1e-5;
};

/// What a DirectDeltaMush has computed, to be kept in a file.
struct MushArrays {
  std::vector<std::int64_t> offsets;  ///< V + 1: vertex v has the entries offsets[v] up to offsets[v + 1]
  std::vector<std::int32_t> joints;   ///< N
  std::vector<float> omega;           ///< N x width_of(variant)
  std::vector<float> centers;         ///< V x 3, the smoothed rest positions p
  std::vector<float> scales;          ///< V
  int variant = 0;
  double pruned = 0;

  /// Numbers an entry: 10, 4 or 1. Ten: the upper triangle xx xy xz yy yz zz of the neighbourhood's second moment
  /// about p and its first moment x y z, both over the trace of the sum of all joints' second moments; then the
  /// joint's share. Four: first moment and share. One: the share. `scales` turns the first moment into a length.
  static int width_of(int variant) { return variant < 2 ? 10 : variant < 4 ? 4 : 1; }
};

/// A skin, made ready for skin_direct_delta_mush. Immutable.
///
/// With u = (rest position, 1), the Laplacian L with its positive diagonal D and S(k) = ((I + k L D^-1)^T)^-p:
///   Psi_ij = S(lambda) of the field w_ij u_i u_i^T,    W' = S(kappa) W,
///   p_i = last column of sum_j Psi_ij, divided by its last entry,
///   Omega_ij = (1 - alpha) Psi_ij + alpha W'_ij [p_i p_i^T, p_i; p_i^T, 1].
/// On a frame Q = sum_j M(j) Omega_ij, divided by its last entry, = [A q; p^T 1], R the rotation nearest to A - q p^T,
/// v' = R v + q - R p.
/// Le, Lewis, "Direct delta mush skinning and variants", ACM TOG 38(4), 2019.
///
/// R does not depend on alpha, so that for alpha = 1, where the formula has 0 for its matrix, the limit is taken. A
/// vertex whose neighbourhood is a point or a line (without faces, without smoothing) turns by the blend of its
/// joints' matrices where the neighbourhood says nothing; one that no weight reaches stays at rest.
class DirectDeltaMush final : public MethodData {
 public:
  /// skin           V vertices, J joints; kept.
  /// face_offsets   faces + 1, where the corners of each face begin; empty: there are no faces.
  /// face_vertices  C, vertices around each face, face after face; a polygon counts as a fan of triangles.
  /// progress       or null. If it is cancelled, null is returned within about 0.1 s.
  /// On two busy cores 30,000 vertices with 60 joints took 3.6 s and 90 MB, of which 16 MB stay; 180,000 with 300 took
  /// 46 s and 470 MB, of which 99 MB stay.
  /// The same bits for any number of threads. The skin must not change meanwhile. Throws InputError for faces that
  /// do not fit and for settings out of range.
  static std::shared_ptr<DirectDeltaMush> compute(std::shared_ptr<const Skin> skin,
                                                  std::span<const std::int32_t> face_offsets,
                                                  std::span<const std::int32_t> face_vertices,
                                                  const MushSettings& settings = {}, Progress* progress = nullptr);

  /// From what `arrays` gave for the same rest positions. Throws InputError for sizes that do not fit and for numbers
  /// that are out of range or not finite.
  DirectDeltaMush(std::shared_ptr<const Skin> skin, const MushArrays& arrays);
  ~DirectDeltaMush() override;

  SkinningMethod method() const override { return SkinningMethod::direct_delta_mush; }
  std::ptrdiff_t vertex_count() const override { return skin_->vertex_count(); }

  const std::shared_ptr<const Skin>& skin() const { return skin_; }
  int variant() const;
  /// How much was left out at most, see MushSettings::prune.
  double pruned() const { return pruned_; }
  /// N.
  std::ptrdiff_t entry_count() const { return entries_; }
  /// What it takes beside the skin.
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
