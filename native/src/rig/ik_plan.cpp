#include "rig/ik_plan.h"

#include <algorithm>

#include "rig/constraints/ik.h"

namespace sinew::rig {
namespace {

/// The plans whose trees have the same root.
struct Root {
  int bone;
  std::vector<IkPlan> plans;
};

int setting(const Program& program, int constraint, int place) {
  const ValueInfo& value = program.map.values()[program.constraints[constraint].values + place];
  return static_cast<int>(clamped(value.initial, value.low, value.high));
}

IkPlan plan_of_chain(const Program& program, const std::vector<int>& chain, int constraint) {
  IkPlan plan;
  plan.bones.assign(chain.rbegin(), chain.rend());
  for (int i = 0; i < static_cast<int>(chain.size()); ++i) plan.parents.push_back(i - 1);
  plan.tips.push_back(static_cast<int>(chain.size()) - 1);
  plan.constraints.push_back(constraint);
  plan.tree.iterations = setting(program, constraint, kIkIterations);
  plan.tree.is_stretching = setting(program, constraint, kIkUseStretch) != 0;
  return plan;
}

/// The first plan that a chain is joined with: one of whose tips at least is not in the chain. -1 for none.
int plan_to_join(const std::vector<IkPlan>& plans, const std::vector<int>& chain) {
  std::vector<int> unused = chain;
  for (std::size_t i = 0; i < plans.size(); ++i) {
    for (const int tip : plans[i].tips) {
      const auto found = std::find(unused.begin(), unused.end(), plans[i].bones[tip]);
      if (found == unused.end()) return static_cast<int>(i);
      unused.erase(found);
    }
  }
  return -1;
}

/// How many bones of a chain, from its root on, a plan has already.
int shared_bones(const IkPlan& plan, const std::vector<int>& down) {
  const int count = static_cast<int>(plan.bones.size());
  const int most = std::min(static_cast<int>(down.size()), count);
  int shared = 0;
  int at = 0;
  while (shared < most && at < count) {
    while (at < count && plan.bones[at] != down[shared]) ++at;
    while (shared < most && at < count && plan.bones[at] == down[shared]) {
      ++shared;
      ++at;
    }
  }
  return shared;
}

void join(const Program& program, IkPlan& plan, const std::vector<int>& chain, int constraint) {
  plan.tree.iterations = std::max(plan.tree.iterations, setting(program, constraint, kIkIterations));
  // The later constraint turns stretching off or on like this, whatever it is meant to be.
  plan.tree.is_stretching = plan.tree.is_stretching && setting(program, constraint, kIkUseStretch) == 0;
  const std::vector<int> down(chain.rbegin(), chain.rend());
  const int shared = shared_bones(plan, down);
  const int before = static_cast<int>(plan.bones.size());
  int parent = shared - 1;
  if (shared < static_cast<int>(down.size())) {
    const int above = program.bones[down[shared]].parent;
    while (parent >= 0 && parent < before && plan.bones[parent] != above) ++parent;
    if (parent == before) parent = shared - 1;
  }
  for (std::size_t i = shared; i < down.size(); ++i) {
    plan.bones.push_back(down[i]);
    plan.parents.push_back(parent);
    parent = static_cast<int>(plan.bones.size()) - 1;
  }
  plan.tips.push_back(static_cast<int>(plan.bones.size()) - 1);
  plan.constraints.push_back(constraint);
}

void add_chain(const Program& program, std::vector<Root>& roots, const std::vector<int>& chain, int constraint) {
  auto root = std::find_if(roots.begin(), roots.end(), [&](const Root& r) { return r.bone == chain.back(); });
  if (root == roots.end()) root = roots.insert(roots.end(), {chain.back(), {}});
  const int joined = plan_to_join(root->plans, chain);
  if (joined < 0) {
    root->plans.push_back(plan_of_chain(program, chain, constraint));
    return;
  }
  IkPlan plan = std::move(root->plans[joined]);
  root->plans.erase(root->plans.begin() + joined);
  join(program, plan, chain, constraint);
  root->plans.push_back(std::move(plan));
}

}  // namespace

std::vector<int> ik_chain(const std::vector<Bone>& bones, int tip, int count) {
  constexpr std::size_t kLongest = 256;
  std::vector<int> chain;
  for (int bone = tip; bone >= 0; bone = bones[bone].parent) {
    chain.push_back(bone);
    if (static_cast<int>(chain.size()) == count || chain.size() == kLongest) break;
  }
  return chain;
}

std::vector<IkPlan> plan_ik(const Program& program, const Tree& tree, const std::vector<char>& acts) {
  std::vector<Root> roots;
  int owner = -1;
  int tip = -1;
  bool is_over = false;
  for (std::size_t i = 0; i < tree.constraints.size(); ++i) {
    const int number = tree.constraints[i];
    const Constraint& constraint = program.constraints[number];
    if (constraint.bone != owner) {
      owner = tip = constraint.bone;
      is_over = false;
    }
    if (is_over) continue;
    // A second constraint without "use tail" begins one bone further up.
    if (setting(program, number, kIkUseTail) == 0 && program.bones[tip].parent >= 0) tip = program.bones[tip].parent;
    add_chain(program, roots, ik_chain(program.bones, tip, setting(program, number, kIkChainLength)), number);
    is_over = acts[i] != 0;
  }
  std::vector<IkPlan> plans;
  for (Root& root : roots) {
    for (IkPlan& plan : root.plans) plans.push_back(std::move(plan));
  }
  for (IkPlan& plan : plans) {
    plan.tree.bones.resize(plan.bones.size());
    plan.tree.goals.resize(plan.constraints.size());
    plan.tree.object = program.world;
    plan.tree.blender = program.blender;
  }
  return plans;
}

}  // namespace sinew::rig
