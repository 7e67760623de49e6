/// What comes after skinning: whole-mesh stages, in any order and number.
#pragma once

#include <variant>

#include "sinew/corrective_smooth.h"
#include "sinew/hook.h"
#include "sinew/smooth.h"

namespace sinew {

/// A stage in one frame: what was built once, and how it works now. Kind::apply(settings,
/// positions) works in place.
template <class Kind>
struct Staged {
  const Kind* stage;
  typename Kind::Settings settings{};
};

using Stage = std::variant<Staged<CorrectiveSmooth>, Staged<Smooth>, Staged<Hook>>;

}  // namespace sinew
