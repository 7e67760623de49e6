/// Two transforms, one after the other, with their rotations, sizes and locations kept apart.
#pragma once

#include "rig/matrix.h"

namespace sinew::rig {

/// is_split  locations are added; otherwise the first transform moves the second's location.
inline Mat4 mixed(const Mat4& first, const Mat4& second, bool is_split) {
  const Parts a = decomposed(first);
  const Parts b = decomposed(second);
  return composed({is_split ? a.location + b.location : transformed_point(first, b.location), a.rotation * b.rotation,
                   a.size * b.size});
}

}  // namespace sinew::rig
