/// How much a skin may hold.
#pragma once

#include <cstdint>

namespace sinew {

/// What fits a packed skin, whose numbers have 32 bits; and joints need some bytes each, used or
/// not.
constexpr std::int64_t kMostJoints = 1 << 24, kMostNumbers = (std::int64_t{1} << 31) - 1;

/// Throws InputError if a skin has more.
void check_counts(std::int64_t vertices, std::int64_t influences, std::int64_t joints);

}  // namespace sinew
