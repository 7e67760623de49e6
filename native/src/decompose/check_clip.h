/// Checks what callers ask to be decomposed.
#pragma once

#include "sinew/decompose.h"

namespace sinew {

/// Throws InputError as decompose says.
void check_decomposition(const DeformedMesh& mesh, const DecompositionStart& start,
                         const DecompositionSettings& settings);

}  // namespace sinew
