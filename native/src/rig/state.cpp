#include "rig/state.h"

#include <algorithm>

namespace sinew::rig {

State::State(const Program& program)
    : outside(program.outside),
      poses(program.bones.size(), kIdentity4),
      channels(program.bones.size(), kIdentity4),
      tails(program.bones.size()),
      segments(program.segment_count, kIdentity4),
      lazy(program.bones.size()),
      parents(program.bones.size()),
      parent_inverses(program.bones.size()),
      locals(program.bones.size()),
      local_sizes(program.bones.size()),
      kept_channels(program.bones.size()),
      rest_shapes(program.bendy_count),
      bindings(program.binding_count),
      is_posed(program.bones.size()),
      plans(program.trees.size()) {
  for (const ValueInfo& value : program.map.values()) base.push_back(value.initial);
  values = base;
  std::size_t most = 0;
  for (const ProgramDriver& driver : program.drivers) most = std::max(most, driver.variables.size());
  variables.resize(most);
  std::size_t most_bones = 0;
  for (std::size_t i = 0; i < program.trees.size(); ++i) {
    plans[i].acts.resize(program.trees[i].constraints.size());
    most_bones = std::max(most_bones, program.trees[i].bones.size());
  }
  ik_poses.resize(most_bones);
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
}

}  // namespace sinew::rig
