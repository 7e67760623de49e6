#include "rig/tree.h"

#include <algorithm>

#include "rig/channels.h"
#include "rig/constraints/ik.h"
#include "rig/spaces.h"

namespace sinew::rig {
namespace {

bool is_acting(const State& state, const Constraint& constraint) {
  return state.values[constraint.values + kInfluence] != 0 && state.values[constraint.values + kMuted] == 0;
}

/// The plans for what acts in this frame; made when a combination occurs for the first time.
std::vector<IkPlan>& plans_of(const Program& program, State& state, int index) {
  const Tree& tree = program.trees[index];
  KeptPlans& kept = state.plans[index];
  for (std::size_t i = 0; i < tree.constraints.size(); ++i) {
    kept.acts[i] = is_acting(state, program.constraints[tree.constraints[i]]) ? 1 : 0;
  }
  for (auto& [acts, plans] : kept.plans) {
    if (acts == kept.acts) return plans;
  }
  kept.plans.emplace_back(kept.acts, plan_ik(program, tree, kept.acts));
  return kept.plans.back().second;
}

/// Computes a bone of the tree after its parents in the tree, once.
void ensure_posed(const Program& program, State& state, int index) {
  if (state.is_posed[index]) return;
  const int parent = program.bones[index].parent;
  if (parent >= 0 && program.bones[parent].tree == program.bones[index].tree) ensure_posed(program, state, parent);
  pose_bone(program, state, index);
  state.is_posed[index] = 1;
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
  goal.influence = acting.flag(kMuted) ? 0 : acting.number(kInfluence);
  goal.pole_angle = acting.number(kIkPoleAngle);
  goal.target = acting.target_in_world(0).value_or(kIdentity4);
  const std::optional<Mat4> pole = acting.target_in_world(1);
  goal.has_pole = pole.has_value();
  for (int k = 0; pole && k < 4; ++k) goal.pole[k] = (*pole)[3][k];
}

void solve(const Program& program, State& state, IkPlan& plan) {
  for (std::size_t i = 0; i < plan.bones.size(); ++i) {
    plan.tree.bones[i].parent = plan.parents[i];
    fill_bone(program, state, plan.bones[i], plan.tree.bones[i]);
    state.ik_poses[i] = state.poses[plan.bones[i]];
  }
  for (std::size_t i = 0; i < plan.constraints.size(); ++i) {
    fill_goal(program, state, plan.constraints[i], plan.tips[i], plan.tree.goals[i]);
  }
  const int parent = program.bones[plan.bones.front()].parent;
  plan.tree.has_parent = parent >= 0;
  if (parent >= 0) plan.tree.parent = state.poses[parent];
  state.ik.solve(plan.tree, {state.ik_poses.data(), plan.bones.size()});
  for (std::size_t i = 0; i < plan.bones.size(); ++i) {
    state.poses[plan.bones[i]] = state.ik_poses[i];
    update_tail(program, state, plan.bones[i]);
  }
}

}  // namespace

void solve_tree(const Program& program, State& state, int index) {
  const Tree& tree = program.trees[index];
  for (const int bone : tree.bones) state.is_posed[bone] = 0;
  for (IkPlan& plan : plans_of(program, state, index)) {
    for (const int bone : plan.bones) ensure_posed(program, state, bone);
    const bool acts = std::any_of(plan.constraints.begin(), plan.constraints.end(),
                                  [&](int c) { return is_acting(state, program.constraints[c]); });
    if (acts) solve(program, state, plan);
  }
  for (const int bone : tree.bones) ensure_posed(program, state, bone);
  for (const int bone : tree.bones) {
    posed_parent(program, state, bone);  // what it was before IK does not count any more
    update_channel(program, state, bone);
  }
}

}  // namespace sinew::rig
