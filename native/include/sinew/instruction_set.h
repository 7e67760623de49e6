/// Which of the machine's instruction sets the kernels use. The best is taken by itself; choosing
/// one is for tests and measurements. Results agree between sets to rounding, not to the bit.
#pragma once

#include <string>
#include <vector>

namespace sinew {

/// The names of the sets that this machine can run, best first; the last runs anywhere. Safe at any
/// time and from any thread, as is instruction_set.
std::vector<std::string> instruction_sets();

/// The one in use.
std::string instruction_set();

/// Uses this one from now on, or the best again for "auto". Safe at any time and from any thread: waits until calls
/// that skin have ended. Throws InputError, naming the sets there are, for a name that is none of them.
void set_instruction_set(const std::string& name);

}  // namespace sinew
