/// Dual quaternion skinning, one frame and one tile at a time.
#pragma once

#include "sinew/skinning_method.h"
#include "sinew/types.h"
#include "skinning/palette.h"

namespace sinew {

/// Throws HalfTurn if any of these pairs of joints is half a turn apart, but for rounding.
void refuse_half_turns(std::span<const JointPair> pairs, const Palette& palette);

/// matrices: F x J, of which this is frame `frame`. space: a similarity to which the motions are converted, or null.
void prepare_dual_quaternion(const BlockedSkin& skin, const StretchRule& rule, MatrixStack<const float> matrices,
                             std::ptrdiff_t frame, const Space* space, Palette& palette);

void run_dual_quaternion(const BlockedSkin& skin, const Palette& palette, const Tile& tile);

/// Moves one vertex, at `rest`, with influences of its own.
void dual_quaternion_vertex(const Influences& influences, const Palette& palette, const float* rest, float* out);

}  // namespace sinew
