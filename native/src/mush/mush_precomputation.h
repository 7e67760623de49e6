/// The computation that direct delta mush does before the first frame.
#pragma once

#include "mush/laplacian.h"
#include "sinew/direct_delta_mush.h"
#include "sinew/progress.h"
#include "sinew/skin.h"

namespace sinew {

/// settings  already checked. Throws as DirectDeltaMush does.
MushArrays precompute_mush(const Skin& skin, const Laplacian& laplacian, const MushSettings& settings,
                           Progress* progress);

}  // namespace sinew
