/// How a long computation ends before it is done.
#pragma once

#include "sinew/progress.h"

namespace sinew {

/// Thrown, and caught within the library, when a computation is cancelled.
struct Cancelled {};

/// progress  may be null.
inline void stop_if_cancelled(const Progress* progress) {
  if (progress && progress->is_cancelled()) throw Cancelled();
}

}  // namespace sinew
