#include "rig/state.h"

#include <algorithm>

namespace sinew::rig {

State::State(const Program& program)
    : outside(program.outside),
      is_given(program.outside.size()),
      poses(program.bones.size(), kIdentity4),
      tails(program.bones.size()),
      segments(program.segment_count, kIdentity4),
      mixed(program.nla),
      lazy(program.bones.size()),
      channels(program.bones.size()),
      parents(program.bones.size()),
      parent_inverses(program.bones.size()),
      locals(program.bones.size()),
      local_sizes(program.bones.size()),
      kept_channels(program.bones.size()),
      rest_shapes(program.bendy_count),
      bindings(program.binding_count),
      posed_in(program.bones.size()) {
  for (const ValueInfo& value : program.map.values()) base.push_back(value.initial);
  values = base;
  std::size_t most = 0;
  for (const ProgramDriver& driver : program.drivers) most = std::max(most, driver.variables.size());
  variables.resize(most);
  std::size_t most_bones = 0;
  std::size_t most_goals = 0;
  for (const Tree& tree : program.trees) {
    most_bones = std::max(most_bones, tree.bones.size());
    most_goals = std::max(most_goals, tree.constraints.size());
  }
  std::size_t most_trees = 0;
  for (std::size_t i = 0; i < program.order.size(); ++i) {
    most_trees = std::max(most_trees, trees_from(program, i).size());
  }
  tree_work.resize(most_trees);
  ik_solvers.reserve(most_trees);
  ik_systems.reserve(most_trees);
  for (TreeWork& work : tree_work) {
    work.poses.resize(most_bones);
    work.settings.bones.reserve(most_bones);
    work.settings.goals.reserve(most_goals);
    work.settings.blender = program.blender;
    work.solver.reserve(most_bones, most_goals);
  }
  for (const Spline& spline : program.splines) {
    KeptPath& kept = paths.emplace_back();
    kept.points.reserve(spline.points.size());
    kept.radii.reserve(spline.points.size());
    kept.path.reserve(spline.points.size() * (spline.type == SplineType::poly ? 1 : spline.resolution));
    spline_points.reserve(std::max(spline_points.capacity(), spline.points.size()));
    spline_radii.reserve(spline_points.capacity());
  }
  for (const Bone& bone : program.bones) {
    if (!bone.is_bendy()) continue;
    RestShape& shape = rest_shapes[bone.bend.number];
    const std::size_t count = bone.bend.segments + 1;
    shape.segments.resize(count);
    shape.inverses.resize(count);
    shape.in_armature.resize(count);
    if (bone.bend.maps_curved) {
      shape.normals.resize(count);
      shape.offsets.resize(count);
      shape.slopes.resize(count);
    }
  }
  put(program.world);
}

void State::put(const Mat4& place) {
  world = place;
  is_at_origin = world == kIdentity4;
  inverse_world = inverse(world);
  for (TreeWork& work : tree_work) work.settings.object = world;
}

std::unique_ptr<State> States::borrow(const Program& program) {
  const std::lock_guard lock(mutex_);
  if (idle_.empty()) return std::make_unique<State>(program);
  std::unique_ptr<State> state = std::move(idle_.back());
  idle_.pop_back();
  return state;
}

void States::give_back(std::unique_ptr<State> state) {
  const std::lock_guard lock(mutex_);
  idle_.push_back(std::move(state));
}

}  // namespace sinew::rig
