/// Which bones the IK constraints of a frame solve together.
#pragma once

#include <vector>

#include "rig/ik_tree.h"
#include "rig/program.h"

namespace sinew::rig {

/// A tree that is solved at once: its bones, parents first, and its goals.
struct IkPlan {
  std::vector<int> bones;        ///< of the rig
  std::vector<int> parents;      ///< of each bone, in the tree
  std::vector<int> tips;         ///< of each goal, in the tree
  std::vector<int> constraints;  ///< of each goal
  IkTree tree;                   ///< filled for each solve
};

/// Whether there is something to reach for. The armature's own object does not count.
inline bool has_ik_target(const Constraint& constraint) {
  const RigTarget::Type target = constraint.targets[0].type;
  return target != RigTarget::Type::none && target != RigTarget::Type::armature;
}

/// The bones from a tip to its chain's root. count  0: all.
std::vector<int> ik_chain(const std::vector<Bone>& bones, int tip, int count);

/// The plans in the order in which they are solved, parents first. Of each bone the IK constraints up to the first that
/// acts count. Chains with the same root are joined.
///
/// acts  of each constraint of the tree, whether it has influence in this frame.
std::vector<IkPlan> plan_ik(const Program& program, const Tree& tree, const std::vector<char>& acts);

}  // namespace sinew::rig
