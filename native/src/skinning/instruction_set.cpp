#include "sinew/instruction_set.h"

#include <hwy/highway.h>

#include <mutex>

#include "base/check.h"
#include "base/steady_instruction_set.h"
#include "skinning/kernels.h"

namespace sinew {
namespace {

/// The sets that the machine has, whichever one is in use.
const std::vector<std::int64_t>& all_targets() {
  static const std::vector<std::int64_t> targets = hwy::SupportedAndGeneratedTargets();
  return targets;
}

/// Changes the choice in one step: kernels running in other threads see either the old one or the new one.
void choose(std::int64_t targets) { hwy::GetChosenTarget().Update(targets); }

void choose_best() {
  std::int64_t all = 0;
  for (const std::int64_t target : all_targets()) all |= target;
  choose(all);
}

// Chooses when the library is loaded: a kernel that found no choice would make one itself, and might undo what
// set_instruction_set chooses at the same time.
[[maybe_unused]] const bool is_chosen = (choose_best(), true);

std::mutex turn;           // held while waiting for the one below, so that others cannot overtake
std::shared_mutex in_use;  // shared by calls that need a steady set

}  // namespace

SteadyInstructionSet::SteadyInstructionSet() {
  const std::lock_guard in_turn(turn);
  lock_ = std::shared_lock(in_use);
}

std::vector<std::string> instruction_sets() {
  std::vector<std::string> names;
  for (const std::int64_t target : all_targets()) names.emplace_back(hwy::TargetName(target));
  return names;
}

std::string instruction_set() { return kernel_target(); }

void set_instruction_set(const std::string& name) {
  std::int64_t wanted = 0;
  std::string known;
  for (const std::int64_t target : all_targets()) {
    if (name == hwy::TargetName(target)) wanted = target;
    known += std::string(known.empty() ? "" : ", ") + hwy::TargetName(target);
  }
  if (wanted == 0 && name != "auto") {
    fail("this machine has no instruction set \"", name, "\"; expected auto or one of ", known);
  }
  const std::lock_guard in_turn(turn);
  const std::lock_guard alone(in_use);
  if (wanted == 0) {
    choose_best();
  } else {
    choose(wanted);
  }
}

}  // namespace sinew
