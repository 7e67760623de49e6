/// Which of the machine's instruction sets the kernels use. The default is the best one; choosing
/// another is for tests and measurements. Results of two sets agree to rounding, not to the bit.
#pragma once

#include <string>
#include <vector>

namespace sinew {

/// Returns the names of the sets that this machine can run, best first; the last runs anywhere. Safe
/// at any time and from any thread, as is instruction_set.
std::vector<std::string> instruction_sets();

/// Returns the name of the set in use.
std::string instruction_set();

/// Uses this set from now on, or the best again for "auto". Safe at any time and from any thread: waits until running
/// skinning calls have ended. Throws InputError, listing the available sets, for an unknown name.
void set_instruction_set(const std::string& name);

}  // namespace sinew
