/// How a long computation ends before it is done.
#pragma once

#include <cstddef>

#include "sinew/progress.h"

namespace sinew {

/// Thrown, and caught within the library, when a computation is cancelled.
struct Cancelled {};

/// progress  may be null.
inline void stop_if_cancelled(const Progress* progress) {
  if (progress && progress->is_cancelled()) throw Cancelled();
}

/// Advances by the share that one of several equal parts has of `steps`; parts may be done in any order.
inline void advance_share(Progress* progress, std::int64_t steps, std::size_t part, std::size_t parts) {
  const auto own = static_cast<std::int64_t>(part), all = static_cast<std::int64_t>(parts);
  if (progress) progress->advance(steps * (own + 1) / all - steps * own / all);
}

}  // namespace sinew
