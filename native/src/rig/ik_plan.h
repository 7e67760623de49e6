/// Which bones the IK constraints of a frame solve together.
#pragma once

#include <vector>

#include "rig/program.h"

namespace sinew::rig {

/// Whether there is something to reach for. The armature's own object does not count.
inline bool has_ik_target(const Constraint& constraint) {
  const RigTarget::Type target = constraint.targets[0].type;
  return target != RigTarget::Type::none && target != RigTarget::Type::armature;
}

/// The bones from a tip to its chain's root. count  0: all.
std::vector<int> ik_chain(const std::vector<Bone>& bones, int tip, int count);

/// Makes the plans for all combinations. Of each bone the IK constraints up to the first that acts count, all if none
/// does. Chains with the same root are joined. Throws InputError if there are too many combinations.
void add_plans(const Program& program, Tree& tree);

/// The combination of a frame. acts(number) tells whether a constraint has influence.
template <class Acts>
const std::vector<IkPlan>& plans_of(const Tree& tree, const Acts& acts) {
  std::size_t combination = 0;
  int begin = 0;
  for (const int end : tree.owners) {
    int first = begin;
    while (first + 1 < end && !acts(tree.constraints[first])) ++first;
    combination = combination * (end - begin) + (first - begin);
    begin = end;
  }
  return tree.plans[combination];
}

}  // namespace sinew::rig
