/// Stages: what is applied to the whole mesh after skinning, in any order and number.
#pragma once

#include <variant>

#include "sinew/corrective_smooth.h"
#include "sinew/hook.h"
#include "sinew/smooth.h"

namespace sinew {

/// A stage in one frame: the object that was built once, and its settings in this frame.
/// Kind::apply(settings, positions) works in place.
template <class Kind>
struct Staged {
  const Kind* stage;
  typename Kind::Settings settings{};
};

using Stage = std::variant<Staged<CorrectiveSmooth>, Staged<Smooth>, Staged<Hook>>;

}  // namespace sinew
