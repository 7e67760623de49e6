/// The skinning methods as one interface: what is prepared once a frame, what runs on a tile, and
/// what that costs. Whatever loops over frames and tiles stands above it.
#pragma once

#include <string>

#include "sinew/skin.h"
#include "sinew/skinning_method.h"
#include "skinning/palette.h"

namespace sinew {

/// Throws InputError, its message beginning with `where`, if there is not a matrix for each joint.
void check_matrices(const Skin& skin, MatrixStack<const float> matrices, const std::string& where);

/// Likewise, if there are rest frames that the rule does not want, or too few.
void check_rest_frames(const StretchRule& rule, std::ptrdiff_t joints, const std::string& where);

/// Likewise, for data of another method or other vertices, or none where the method has some.
void check_data(const Skin& skin, SkinningMethod method, const MethodData* data, const std::string& where);

/// Into another space than the one in which matrices and rest frames are given.
struct Carried {
  const Space& space;
  MatrixStack<const float> matrices;  ///< the same, in that space
};

/// carried: or null.
void prepare(const BlockedSkin& skin, SkinningMethod method, const StretchRule& rule, const MethodData* data,
             MatrixStack<const float> matrices, std::ptrdiff_t frame, Palette& palette,
             const Carried* carried = nullptr);

void run(const BlockedSkin& skin, SkinningMethod method, const Palette& palette, const Tile& tile);

/// Vertex v at `rest`, x y z, that has other influences than the skin says; direct delta mush has none, and leaves
/// it where it is.
void run_vertex(std::size_t v, const Influences& influences, SkinningMethod method, const MethodData* data,
                const Palette& palette, const float* rest, float* out);

/// What a vertex costs one thread, about.
double microseconds_a_vertex(SkinningMethod method);

}  // namespace sinew
