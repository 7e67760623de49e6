/// Skinning: one mesh, or all meshes of a character and all characters of a scene.
///
/// These functions allocate nothing once a thread has seen a skeleton of this size. Results have the
/// same bits for any number of threads. They throw InputError, and write nothing, if a shape does not
/// fit.
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
/// positions   out, F x V x 3, in mesh space.
///
/// Magnenat-Thalmann, Laperriere, Thalmann, "Joint-dependent local deformations for hand animation
/// and object grasping", Graphics Interface 1988.
void skin_linear(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions);

/// Dual quaternion skinning, which does not collapse where linear blending loses volume. Every vertex
/// moves by the normalised weighted sum of its joints' unit dual quaternions.
///
/// skin, matrices, positions   as above.
/// rule                        what happens to scale and shear.
///
/// q and -q are the same rotation: each dual quaternion is added with the sign that puts it on the
/// same side as the sum so far, influences in their stored order (as Blender does).
/// Kavan, Collins, Zara, O'Sullivan, "Geometric skinning with approximate dual quaternion
/// blending", ACM TOG 27(4), 2008: sections 3.3 (blending) and 4.1 (antipodality), 4.2 (scale).
void skin_dual_quaternion(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions,
                          const StretchRule& rule);

/// The same with Stretch::polar.
void skin_dual_quaternion(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions);

/// Linear and dual quaternion skinning, blended: v' = linear + share (dual quaternion - linear). A
/// share of 0 or 1 gives exactly the bits of the one or the other.
///
/// skin, matrices, positions, rule   as above.
/// shares                            V.
void skin_blended(const Skin& skin, const BlendShares& shares, MatrixStack<const float> matrices,
                  std::span<float> positions, const StretchRule& rule = {});

/// Skinning about optimised centres of rotation: neither linear blending's collapse nor dual quaternions'
/// bulge. v' = R S (v - p) + sum_j w_j M(j) p, with p the vertex's centre, R the rotation of the
/// joints' blended unit quaternions, with signs chosen as in dual quaternion skinning, and S the
/// joints' blended stretch, the identity where they only turn and move. A vertex without a centre
/// moves linearly.
///
/// skin, matrices, positions   as above.
/// centers                     V.
void skin_rotation_centers(const Skin& skin, const RotationCenters& centers, MatrixStack<const float> matrices,
                           std::span<float> positions);

/// Direct delta mush of the skin for which `mush` was made.
///
/// matrices, positions   as above.
void skin_direct_delta_mush(const DirectDeltaMush& mush, MatrixStack<const float> matrices, std::span<float> positions);

/// The arguments of one skinning call.
struct SkinningJob {
  const Skin* skin;                   ///< V vertices, J joints; several jobs may share it
  MatrixStack<const float> matrices;  ///< F x J skinning matrices
  std::span<float> positions;         ///< out, F x V x 3; must not overlap that of another job
  SkinningMethod method;
  StretchRule rule{};                ///< for dual quaternions
  const MethodData* data = nullptr;  ///< for a method with data of its own
};

/// Does all jobs in one parallel region, so that its start-up cost is paid once and many small meshes
/// keep all threads busy, which each alone would not. Gives the same bits as one call per job. Results
/// must not overlap.
void skin_all(std::span<const SkinningJob> jobs);

}  // namespace sinew
