#include "rig/tree.h"

#include <algorithm>

#include "rig/channels.h"
#include "rig/constraints/ik.h"
#include "rig/ik_plan.h"
#include "rig/spaces.h"

namespace sinew::rig {
namespace {

bool is_acting(const Program& program, State& state, const Constraint& constraint) {
  const Acting acting(program, state, constraint);
  return acting.is_on() && acting.number(kInfluence) != 0;
}

/// Computes a bone of the tree after its parents in the tree, once in a frame.
void ensure_posed(const Program& program, State& state, int index) {
  if (state.posed_in[index] == state.pass) return;
  const int parent = program.bones[index].parent;
  if (parent >= 0 && program.bones[parent].tree == program.bones[index].tree) ensure_posed(program, state, parent);
  pose_bone(program, state, index);
  state.posed_in[index] = state.pass;
}

void fill_bone(const Program& program, const State& state, int index, IkBone& written) {
  const Bone& bone = program.bones[index];
  const float* values = state.values.data() + bone.values;
  written.rest = bone.rest_in_parent;
  written.length = bone.length;
  written.stretch = values[kIkStretch];
  for (int k = 0; k < 3; ++k) {
    written.stiffness[k] = values[kIkStiffness + k];
    written.lowest[k] = values[kIkLimits + 2 * k];
    written.highest[k] = values[kIkLimits + 2 * k + 1];
    written.is_locked[k] = values[kIkLocked + k] != 0;
    written.is_limited[k] = values[kIkLimited + k] != 0;
  }
}

void fill_goal(const Program& program, State& state, int constraint, int tip, IkGoal& goal) {
  const Acting acting(program, state, program.constraints[constraint]);
  goal.tip = tip;
  goal.has_location = acting.flag(kIkUseLocation);
  goal.has_rotation = acting.flag(kIkUseRotation);
  goal.weight = acting.number(kIkWeight);
  goal.rotation_weight = acting.number(kIkOrientWeight);
  goal.influence = acting.is_on() ? acting.number(kInfluence) : 0;
  goal.pole_angle = acting.number(kIkPoleAngle);
  goal.target = acting.target_in_world(0).value_or(kIdentity4);
  const std::optional<Mat4> pole = acting.target_in_world(1);
  goal.has_pole = pole.has_value();
  for (int k = 0; pole && k < 4; ++k) goal.pole[k] = (*pole)[3][k];
}

void begin(const Program& program, State& state, const IkPlan& plan, TreeWork& work) {
  IkTree& tree = work.settings;
  tree.iterations = plan.iterations;
  tree.is_stretching = plan.is_stretching;
  tree.bones.resize(plan.bones.size());
  for (std::size_t i = 0; i < plan.bones.size(); ++i) {
    tree.bones[i].parent = plan.parents[i];
    fill_bone(program, state, plan.bones[i], tree.bones[i]);
    work.poses[i] = state.poses[plan.bones[i]];
  }
  tree.goals.resize(plan.constraints.size());
  for (std::size_t i = 0; i < plan.constraints.size(); ++i) {
    fill_goal(program, state, plan.constraints[i], plan.tips[i], tree.goals[i]);
  }
  const int parent = program.bones[plan.bones.front()].parent;
  tree.has_parent = parent >= 0;
  if (parent >= 0) tree.parent = state.poses[parent];
  work.solver.begin(tree, {work.poses.data(), plan.bones.size()});
}

void finish(const Program& program, State& state, TreeWork& work) {
  const IkPlan& plan = (*work.plans)[work.next - 1];
  work.solver.finish(work.settings, {work.poses.data(), plan.bones.size()});
  for (std::size_t i = 0; i < plan.bones.size(); ++i) {
    state.poses[plan.bones[i]] = work.poses[i];
    update_tail(program, state, plan.bones[i]);
    posed_parent(program, state, plan.bones[i]);  // for what is solved next
  }
}

/// Begins the tree's next plan in which a constraint acts. Returns whether there is one.
bool begin_next(const Program& program, State& state, TreeWork& work) {
  while (work.next < work.plans->size()) {
    const IkPlan& plan = (*work.plans)[work.next++];
    if (plan.bones.front() != work.root) continue;
    for (const int bone : plan.bones) ensure_posed(program, state, bone);
    const bool acts = std::ranges::any_of(
        plan.constraints, [&](int constraint) { return is_acting(program, state, program.constraints[constraint]); });
    if (!acts) continue;
    state.enter(RigPart::ik);
    begin(program, state, plan, work);
    state.enter(RigPart::bones);
    return true;
  }
  return false;
}

}  // namespace

void solve_trees(const Program& program, State& state, std::span<const Operation> trees) {
  const std::span<TreeWork> all(state.tree_work.data(), trees.size());
  for (std::size_t i = 0; i < trees.size(); ++i) {
    const Solve& solve = program.solves[trees[i].index];
    const Tree& tree = program.trees[solve.tree];
    const auto& plans =
        plans_of(tree, [&](int constraint) { return is_acting(program, state, program.constraints[constraint]); });
    all[i].plans = &plans;
    all[i].root = solve.root;
    all[i].next = 0;
  }
  for (;;) {
    state.ik_solvers.clear();
    for (TreeWork& work : all) {
      work.is_solving = begin_next(program, state, work);
      if (work.is_solving) state.ik_solvers.push_back(&work.solver);
    }
    if (state.ik_solvers.empty()) break;
    state.enter(RigPart::ik);
    IkTreeSolver::move(state.ik_solvers, state.ik_systems);
    for (TreeWork& work : all) {
      if (work.is_solving) finish(program, state, work);
    }
    state.enter(RigPart::bones);
  }
  for (const Operation& operation : trees) {
    const Solve& solve = program.solves[operation.index];
    for (const int bone : solve.bones) ensure_posed(program, state, bone);
    // What it was before IK does not count any more.
    for (const int bone : solve.bones) posed_parent(program, state, bone);
  }
}

}  // namespace sinew::rig
