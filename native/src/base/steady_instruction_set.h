/// Calls that must not see the instruction set change.
#pragma once

#include <shared_mutex>

namespace sinew {

/// As long as one exists the instruction set stays as it is: a BlockedSkin can be read only with as many lanes as it
/// was packed for. A thread makes one at a time; what it runs in parallel needs none.
class SteadyInstructionSet {
 public:
  SteadyInstructionSet();

 private:
  std::shared_lock<std::shared_mutex> lock_;
};

}  // namespace sinew
