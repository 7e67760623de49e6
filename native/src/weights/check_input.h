/// Checks what automatic_weights is given.
#pragma once

#include "sinew/automatic_weights.h"

namespace sinew {

/// Throws InputError as documented at automatic_weights. Returns J: one more than the largest joint.
std::int32_t check_weight_input(std::span<const double> positions, std::span<const std::int32_t> face_offsets,
                                std::span<const std::int32_t> face_vertices, const WeightBones& bones,
                                const FixedWeights& fixed, const WeightSettings& settings);

}  // namespace sinew
