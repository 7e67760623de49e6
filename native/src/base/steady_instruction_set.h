/// For calls during which the instruction set must not change.
#pragma once

#include <shared_mutex>

namespace sinew {

/// While one exists, the instruction set does not change: a BlockedSkin can be read only with the number of lanes that
/// it was packed for. A thread makes only one at a time; the work that it runs in parallel needs none.
class SteadyInstructionSet {
 public:
  SteadyInstructionSet();

 private:
  std::shared_lock<std::shared_mutex> lock_;
};

}  // namespace sinew
