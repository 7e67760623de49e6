/// How many threads the library may use.
#pragma once

namespace sinew {

/// Lets every later call use at most `count` threads, the calling one included, and never more than
/// the machine has; 0 means as many as it has. Safe at any time and from any thread: running calls
/// keep their limit. Results never depend on it. Throws InputError if count is negative.
void set_thread_count(int count);

/// Returns the number of threads that the next call may use, at least 1.
int thread_count();

}  // namespace sinew
