#include "rig/ik_plan.h"

#include <algorithm>

#include "base/check.h"
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
  plan.iterations = setting(program, constraint, kIkIterations);
  plan.is_stretching = setting(program, constraint, kIkUseStretch) != 0;
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
  plan.iterations = std::max(plan.iterations, setting(program, constraint, kIkIterations));
  // The later constraint turns stretching off or on like this, whatever it is meant to be.
  plan.is_stretching = plan.is_stretching && setting(program, constraint, kIkUseStretch) == 0;
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

/// combination  of each owner, which of its constraints is the last that counts, as the digits of a number.
std::vector<IkPlan> plans_of_combination(const Program& program, const Tree& tree, std::size_t combination) {
  std::vector<int> ends(tree.owners.size());
  for (std::size_t i = tree.owners.size(); i-- > 0;) {
    const int begin = i == 0 ? 0 : tree.owners[i - 1];
    const std::size_t count = tree.owners[i] - begin;
    ends[i] = begin + static_cast<int>(combination % count) + 1;
    combination /= count;
  }
  std::vector<Root> roots;
  for (std::size_t owner = 0; owner < ends.size(); ++owner) {
    const int begin = owner == 0 ? 0 : tree.owners[owner - 1];
    for (int i = begin; i < ends[owner]; ++i) {
      const int number = tree.constraints[i];
      const int count = setting(program, number, kIkChainLength);
      add_chain(program, roots, ik_chain(program.bones, tree.tips[i], count), number);
    }
  }
  std::vector<IkPlan> plans;
  for (Root& root : roots) {
    for (IkPlan& plan : root.plans) plans.push_back(std::move(plan));
  }
  return plans;
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

void add_plans(const Program& program, Tree& tree) {
  constexpr std::size_t kMostCombinations = 4096;
  std::size_t combinations = 1;
  for (std::size_t i = 0, begin = 0; i < tree.constraints.size(); ++i) {
    const int owner = program.constraints[tree.constraints[i]].bone;
    const bool is_last = i + 1 == tree.constraints.size() || program.constraints[tree.constraints[i + 1]].bone != owner;
    if (!is_last) continue;
    tree.owners.push_back(static_cast<int>(i + 1));
    combinations *= i + 1 - begin;
    begin = i + 1;
    if (combinations > kMostCombinations) {
      fail("the IK constraints of ", plural(tree.owners.size(), "bone"), " that are solved together, the last of them ",
           program.map.name(program.bones[owner].values), ", act in more than ", grouped(kMostCombinations),
           " combinations; remove those that are not needed");
    }
  }
  for (std::size_t i = 0; i < combinations; ++i) tree.plans.push_back(plans_of_combination(program, tree, i));
}

}  // namespace sinew::rig
