/// Linear blend skinning.
#pragma once

#include <span>

#include "sinew/skin.h"
#include "sinew/types.h"

namespace sinew {

/// v' = sum_j w_j M(j) v for every vertex of every frame, M(j) = F(j) A(j)^-1.
///
/// skin        V vertices, J joints.
/// matrices    F x J skinning matrices; their last row is taken to be 0 0 0 1.
/// positions   out, F x V x 3, space of the mesh.
///
/// Allocates nothing once a thread has seen a skeleton of this size. The same bits for any number
/// of threads. Throws InputError if a shape does not fit.
/// Magnenat-Thalmann, Laperriere, Thalmann, "Joint-dependent local deformations for hand animation
/// and object grasping", Graphics Interface 1988.
void skin_linear(const Skin& skin, MatrixStack<const float> matrices, std::span<float> positions);

}  // namespace sinew
