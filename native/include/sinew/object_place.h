/// Where an object is that hangs on another one, with Blender's bits.
#pragma once

#include "sinew/types.h"

namespace sinew {

struct ObjectPlace {
  Matrix4<float> world;    ///< from the object's space
  Matrix4<float> inverse;  ///< as Blender keeps it beside that: of nearly that matrix, if it has none
  bool has_inverse = true;
  bool is_mirrored = false;
};

/// The place of an object on its own. world: from its space.
ObjectPlace place_of(const Matrix4<float>& world);

/// The place of an object that is a child of another. parent: world matrix of that; parent_inverse:
/// Object.matrix_parent_inverse; basis: what its own channels say.
ObjectPlace place_of_child(const Matrix4<float>& parent, const Matrix4<float>& parent_inverse,
                           const Matrix4<float>& basis);

}  // namespace sinew
