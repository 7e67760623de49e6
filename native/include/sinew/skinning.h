/// Skins in poses: one mesh, or all meshes of a character and all characters of a scene.
///
/// Nothing is allocated once a thread has seen a skeleton of this size. The same bits for any
/// number of threads. InputError if a shape does not fit; then nothing is written.
#pragma once

#include <span>

#include "sinew/blend_shares.h"
#include "sinew/direct_delta_mush.h"
#include "sinew/rotation_centers.h"
#include "sinew/skin.h"
#include "sinew/skinning_method.h"
#include "sinew/types.h"

namespace sinew {

/// Linear blend skinning: v' = sum_j w_j M(j) v for every vertex of every frame, M(j) = F(j)
/// A(j)^-1.
///
/// skin        V vertices, J joints.
/// matrices    F x J skinning matrices; their last row is taken to be 0 0 0 1.
/// positions   out, F x V x 3, space of the mesh.
///
/// Magnenat-Thalmann, Laperriere, Thalmann, "Joint-dependent local deformations for hand animation
/// and object grasping", Graphics Interface 1988.
void skin_linear(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions);

/// Dual quaternion skinning: no collapse where linear blending loses volume. Every vertex moves by
/// the normalised weighted sum of its joints' unit dual quaternions.
///
/// skin, matrices, positions   as above.
/// rule                        what becomes of scale and shear.
///
/// q and -q are the same rotation: each dual quaternion enters the sum with the sign that brings it
/// to the side of the sum so far, influences in their stored order (as Blender does it).
/// Kavan, Collins, Zara, O'Sullivan, "Geometric skinning with approximate dual quaternion
/// blending", ACM TOG 27(4), 2008: sections 3.3 (blending) and 4.1 (antipodality), 4.2 (scale).
void skin_dual_quaternion(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions,
                          const StretchRule& rule);

/// The same with Stretch::polar.
void skin_dual_quaternion(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions);

/// Linear and dual quaternion skinning, blended: v' = linear + share (dual quaternion - linear). Where
/// a share is 0 or 1 the one or the other to the bit.
///
/// skin, matrices, positions, rule   as above.
/// shares                            V.
void skin_blended(const Skin& skin, const BlendShares& shares, MatrixStack<const float> matrices,
                  std::span<float> positions, const StretchRule& rule = {});

/// Skinning about optimised centres of rotation: neither linear blending's collapse nor dual quaternions'
/// bulge. v' = R S (v - p) + sum_j w_j M(j) p, p the vertex's centre, R the rotation of the joints'
/// blended unit quaternions, with signs as of dual quaternions, and S the joints' blended stretch,
/// the identity where they only turn and move. A vertex without a centre moves linearly.
///
/// skin, matrices, positions   as above.
/// centers                     V.
void skin_rotation_centers(const Skin& skin, const RotationCenters& centers, MatrixStack<const float> matrices,
                           std::span<float> positions);

/// Direct delta mush, of the skin that `mush` was made for.
///
/// matrices, positions   as above.
void skin_direct_delta_mush(const DirectDeltaMush& mush, MatrixStack<const float> matrices, std::span<float> positions);

/// What these functions take.
struct SkinningJob {
  const Skin* skin;                   ///< V vertices, J joints; several jobs may share it
  MatrixStack<const float> matrices;  ///< F x J skinning matrices
  std::span<float> positions;         ///< out, F x V x 3; no part of it in another job's
  SkinningMethod method;
  StretchRule rule{};                ///< of dual quaternions
  const MethodData* data = nullptr;  ///< of a method that has some
};

/// Does all jobs in one parallel region, whose start is thus paid for once: many small meshes keep
/// all threads busy where each alone would not. The same bits as one call per job. Two results must
/// not overlap.
void skin_all(std::span<const SkinningJob> jobs);

}  // namespace sinew
