#include "rig/variables.h"

#include "rig/channels.h"
#include "rig/driver.h"
#include "rig/spaces.h"

namespace sinew::rig {
namespace {

Mat4 matrix_in(const Program& program, State& state, const RigTarget& target, TransformSpace space) {
  if (target.type == RigTarget::Type::armature) return state.world;
  if (target.type == RigTarget::Type::outside) return state.outside[target.index];
  switch (space) {
    case TransformSpace::world:
      return to_world(state, state.poses[target.index]);
    case TransformSpace::local:
      return local_of(program, state, target.index);
    default:
      return channels_of(program, state, target.index);
  }
}

float outside_value(const State& state, const Variable& variable, const Mat4& m) {
  const ReadTarget& read = variable.targets[0];
  if (variable.angles[0] < 0) return transform_channel(m, {read.channel, read.rotation}, EulerOrder::xyz, nullptr);
  Vec3 angles;
  for (int i = 0; i < 3; ++i) angles[i] = state.values[variable.angles[i]];
  return transform_channel(m, {read.channel, read.rotation}, static_cast<EulerOrder>(read.order), &angles);
}

float transform_value(const Program& program, State& state, const Variable& variable) {
  const ReadTarget& read = variable.targets[0];
  const RigTarget& target = read.target;
  if (target.type == RigTarget::Type::none) return 0;
  const bool is_bone = target.type == RigTarget::Type::bone;
  const bool is_scale = read.channel >= TransformChannel::scale_x && read.channel <= TransformChannel::scale_z;
  if (is_bone && is_scale && read.space == TransformSpace::local) {
    const int axis = static_cast<int>(read.channel) - static_cast<int>(TransformChannel::scale_x);
    return local_sizes_of(program, state, target.index)[axis];
  }
  const Mat4 m = matrix_in(program, state, target, read.space);
  if (!is_bone) return outside_value(state, variable, m);
  const Bone& bone = program.bones[target.index];
  const float* angles = state.values.data() + bone.values + kEuler;
  const Vec3 own = {angles[0], angles[1], angles[2]};
  return transform_channel(m, {read.channel, read.rotation}, bone.order(), bone.has_euler() ? &own : nullptr);
}

Vec3 location_in(const Program& program, State& state, const ReadTarget& read) {
  const int bone = read.target.index;
  if (read.target.type == RigTarget::Type::bone) {
    if (read.space == TransformSpace::transform) {
      const float* location = state.values.data() + program.bones[bone].values + kLocation;
      return {location[0], location[1], location[2]};
    }
    if (read.space == TransformSpace::world) {
      const Vec3 location = state.poses[bone].location();
      return state.is_at_origin ? location : transformed_point(state.world, location);
    }
  }
  return matrix_in(program, state, read.target, read.space).location();
}

}  // namespace

float variable_value(const Program& program, State& state, const Variable& variable) {
  const ReadTarget& first = variable.targets[0];
  const ReadTarget& second = variable.targets[1];
  const auto has_both = [&] {
    return first.target.type != RigTarget::Type::none && second.target.type != RigTarget::Type::none;
  };
  switch (variable.type) {
    case Variable::Type::value:
      return state.values[variable.value];
    case Variable::Type::bone_length:
      return length(state.poses[variable.value].location() - state.tails[variable.value]);
    case Variable::Type::transform:
      return transform_value(program, state, variable);
    case Variable::Type::location_difference:
      if (!has_both()) return 0;
      return length(location_in(program, state, second) - location_in(program, state, first));
    default: {
      if (!has_both()) return 0;
      const auto matrix = [&](const RigTarget& target) {
        return target.type == RigTarget::Type::bone ? state.poses[target.index]
                                                    : matrix_in(program, state, target, TransformSpace::world);
      };
      return rotation_difference(matrix(first.target), matrix(second.target));
    }
  }
}

}  // namespace sinew::rig
