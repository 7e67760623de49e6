#include <algorithm>

#include "rig/bend.h"
#include "rig/channels.h"
#include "rig/spline_chain.h"
#include "rig/state.h"
#include "rig/tree.h"
#include "rig/variables.h"

namespace sinew::rig {
namespace {

void store(const Program& program, State& state, int value, float number) {
  const ValueInfo& info = program.map.values()[value];
  state.values[value] = stored_value(info.kind, info.low, info.high, number);
}

void drive(const Program& program, State& state, int index) {
  const ProgramDriver& driver = program.drivers[index];
  const std::size_t count = driver.variables.size();
  for (std::size_t i = 0; i < count; ++i) {
    state.variables[i] = variable_value(program, state, driver.variables[i]);
  }
  const Driver::Result result = driver.driver.value({state.variables.data(), count}, state.frame);
  if (result.is_undefined && state.undefined_driver < 0) state.undefined_driver = index;
  store(program, state, driver.value, result.value);
}

/// What Blender calls an object's local space: relative to its parent or, without one, to its own rotation.
Mat4 local_of(const State& state, const MovingObject& object, const Mat4& basis, const Mat4& world) {
  if (object.parent >= 0) return inverse(state.outside[object.parent] * object.parent_inverse) * world;
  Mat4 turned = basis;
  normalize_columns(turned);
  turned.set_location({0, 0, 0});
  return inverse(turned) * world;
}

/// Blender's order: the deltas turn last; then the parent, its inverse and what the channels say.
void place_objects(const Program& program, State& state) {
  for (const MovingObject& object : program.objects) {
    if (state.is_given[object.matrix]) continue;
    const float* channels = state.values.data() + object.values;
    const float* deltas = channels + kPoseBend;
    Mat4 local = widened(rotation_of(deltas, object.rotation_mode) * rotation_of(channels, object.rotation_mode));
    for (int i = 0; i < 3; ++i) {
      local.scale_axis(i, channels[kScale + i] * deltas[kScale + i]);
      local[3][i] = channels[kLocation + i] + deltas[kLocation + i];
    }
    Mat4& world = state.outside[object.matrix];
    world = object.parent < 0 ? local : (state.outside[object.parent] * object.parent_inverse) * local;
    if (object.local >= 0) state.outside[object.local] = local_of(state, object, local, world);
    if (object.basis >= 0) state.outside[object.basis] = local;
  }
}

}  // namespace

void evaluate(const Program& program, State& state, float frame, bool has_segments) {
  state.frame = frame;
  state.undefined_driver = -1;
  ++state.pass;
  state.enter(RigPart::curves);
  for (const int value : program.written) state.values[value] = state.base[value];
  FCurve::KnownRoot known;
  for (const ProgramCurve& curve : program.curves) {
    store(program, state, curve.value, curve.curve.value(frame, 0, &known));
  }
  state.mixed.mix(program.nla, frame);
  for (const MixedNumber& mixed : program.nla.numbers) {
    store(program, state, mixed.value, state.mixed.number(program.nla, mixed));
  }
  for (const GivenNumber& given : state.given) state.values[given.value] = given.number;
  place_objects(program, state);
  if (program.place >= 0) state.put(state.outside[program.place]);
  for (std::size_t i = 0; i < program.order.size(); ++i) {
    const Operation& operation = program.order[i];
    switch (operation.type) {
      case Operation::Type::bone:
        state.enter(RigPart::bones);
        pose_bone(program, state, operation.index);
        break;
      case Operation::Type::driver:
        state.enter(RigPart::drivers);
        drive(program, state, operation.index);
        break;
      case Operation::Type::tree: {
        state.enter(RigPart::bones);
        const std::span<const Operation> trees = trees_from(program, i);
        solve_trees(program, state, trees);
        i += trees.size() - 1;
        break;
      }
      case Operation::Type::chain:
        state.enter(RigPart::ik);
        follow_spline(program, state, program.chains[operation.index]);
        break;
      case Operation::Type::segments:
        if (operation.is_shown && !has_segments) break;
        state.enter(RigPart::segments);
        bend_bone(program, state, operation.index);
        break;
    }
  }
}

}  // namespace sinew::rig
