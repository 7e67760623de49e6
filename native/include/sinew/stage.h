/// Stages: what is applied to the whole mesh after skinning, in any order and number.
#pragma once

#include <variant>

#include "sinew/corrective_smooth.h"
#include "sinew/hook.h"
#include "sinew/lattice.h"
#include "sinew/mesh_deform.h"
#include "sinew/mixed_layers.h"
#include "sinew/smooth.h"
#include "sinew/surface_deform.h"

namespace sinew {

/// A stage in one frame: the object that was built once, and its settings in this frame.
/// Kind::apply(settings, positions) works in place.
template <class Kind>
struct Staged {
  const Kind* stage;
  typename Kind::Settings settings{};
};

using Stage = std::variant<Staged<CorrectiveSmooth>, Staged<Smooth>, Staged<Hook>, Staged<MixedLayers>, Staged<Lattice>,
                           Staged<SurfaceDeform>, Staged<MeshDeform>>;

}  // namespace sinew
