/// One interface to all skinning methods: preparing a frame, running on a tile, and the cost of that.
/// The loops over frames and tiles are in its callers.
#pragma once

#include <string>

#include "sinew/skin.h"
#include "sinew/skinning_method.h"
#include "skinning/palette.h"

namespace sinew {

/// Throws InputError, with a message that begins with `where`, unless there is one matrix per joint.
void check_matrices(const Skin& skin, MatrixStack<const float> matrices, const std::string& where);

/// Likewise, if there are rest frames that the rule does not use, or too few.
void check_rest_frames(const StretchRule& rule, std::ptrdiff_t joints, const std::string& where);

/// Likewise, for data of another method or for other vertices, and if the method needs data but has none.
void check_data(const Skin& skin, SkinningMethod method, const MethodData* data, const std::string& where);

/// A conversion to a space other than the one in which matrices and rest frames are given.
struct Carried {
  const Space& space;
  MatrixStack<const float> matrices;  ///< the same, in that space
};

/// Whether C M C^-1 in the space that C leads from does what M does in the space that it leads to.
bool is_carried(SkinningMethod method, const Space& by);

/// Prepares the palette of a frame. carried: may be null.
void prepare(const BlockedSkin& skin, SkinningMethod method, const StretchRule& rule, const MethodData* data,
             MatrixStack<const float> matrices, std::ptrdiff_t frame, Palette& palette,
             const Carried* carried = nullptr);

void run(const BlockedSkin& skin, SkinningMethod method, const Palette& palette, const Tile& tile);

/// Moves vertex v, at `rest`, x y z, with influences other than those in the skin. Direct delta mush, which uses no
/// influences, leaves it where it is.
void run_vertex(std::size_t v, const Influences& influences, SkinningMethod method, const MethodData* data,
                const Palette& palette, const float* rest, float* out);

/// Returns the approximate time that one thread takes per vertex.
double microseconds_a_vertex(SkinningMethod method);

}  // namespace sinew
