#include "rig/bend.h"
#include "rig/channels.h"
#include "rig/constraints/kind.h"
#include "rig/dual_quaternion.h"

namespace sinew::rig {
namespace armature {
namespace {

enum Setting : int { kPreserveVolume = kCommonValueCount, kEnvelopes, kCurrentLocation };

constexpr auto kSettings = settings_with(flag_setting("use_deform_preserve_volume"), flag_setting("use_bone_envelopes"),
                                         flag_setting("use_current_location"));

/// The weighted sum of what bones do to a point.
class Sum {
 public:
  Sum(const Acting& acting, const Vec3& point)
      : state_(acting.state()), point_(point), is_quaternion_(acting.flag(kPreserveVolume)) {}

  /// rest  in armature space. movement  from the rest to the pose there.
  void add(const Mat4& rest, const Mat4& movement, float weight) {
    if (weight == 0) return;
    const Mat4 in_world = state_.is_at_origin ? movement : (state_.world * movement) * state_.inverse_world;
    if (is_quaternion_) {
      Mat4 axes = to_world(state_, rest);
      orthogonalize_y(axes, true);
      rig::add(quaternions_, dual_quaternion_of(axes, in_world), weight, point_);
      return;
    }
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < 4; ++k) matrices_[i][k] += in_world[i][k] * weight;
    }
  }

  Mat4 divided_by(float total) const {
    if (is_quaternion_) return matrix_of(quaternions_, total);
    const float factor = 1.0F / total;
    Mat4 m = matrices_;
    for (auto& column : m.columns) {
      for (float& element : column) element *= factor;
    }
    return m;
  }

 private:
  const State& state_;
  Vec3 point_;
  bool is_quaternion_;
  Mat4 matrices_ = {};
  DualQuaternion quaternions_;
};

/// Where the owner is along a B-bone's rest shape. Without `use_current_location` it is where its head was at rest,
/// so the place is kept until the shape changes.
Place place_of(const Acting& acting, int target, const Vec3& point) {
  const Program& program = acting.program();
  const Bone& bone = program.bones[acting.constraint().targets[target].index];
  const RestShape& shape = acting.state().rest_shapes[bone.bend.number];
  Binding& binding = acting.state().bindings[acting.constraint().first_binding + target];
  const State& state = acting.state();
  // To the world and back, which rounds otherwise in another place.
  const bool moves = acting.flag(kCurrentLocation) || program.place >= 0;
  if (!moves && binding.edition == shape.edition) return binding.place;
  const Place place =
      place_of_point(bone, shape, state.is_at_origin ? point : transformed_point(state.inverse_world, point));
  binding = {moves ? 0 : shape.edition, place};
  return place;
}

void add_bendy(const Acting& acting, Sum& sum, int target, const Vec3& point, float weight) {
  const Program& program = acting.program();
  State& state = acting.state();
  const int index = acting.constraint().targets[target].index;
  const Bone& bone = program.bones[index];
  const RestShape& shape = state.rest_shapes[bone.bend.number];
  const Place place = place_of(acting, target, point);
  const Mat4 pose = channel_of(program, state, index) * bone.rest;
  for (int end = 0; end < 2; ++end) {
    const int at = place.segment + end;
    const Mat4 movement = ((pose * state.segments[bone.bend.first + at]) * shape.inverses[at]) * bone.inverse_rest;
    sum.add(shape.in_armature[at], movement, weight * (end == 0 ? 1.0F - place.fraction : place.fraction));
  }
}

void apply(const Acting& acting, Mat4& owner) {
  const Program& program = acting.program();
  Vec3 point = owner.location();
  if (!acting.flag(kCurrentLocation)) {
    point = acting.bone().head;
    if (const State& state = acting.state(); !state.is_at_origin) point = transformed_point(state.world, point);
  }
  Sum sum(acting, point);
  float total = 0;
  const Constraint& constraint = acting.constraint();
  for (std::size_t i = 0; i < constraint.targets.size(); ++i) {
    const float weight = acting.state().values[constraint.weights + static_cast<int>(i)];
    if (weight <= 0) continue;
    if (constraint.targets[i].type != RigTarget::Type::bone) return;
    const int index = constraint.targets[i].index;
    const Bone& bone = program.bones[index];
    if (bone.is_bendy()) {
      add_bendy(acting, sum, static_cast<int>(i), point, weight);
    } else {
      sum.add(bone.rest, channel_of(program, acting.state(), index), weight);
    }
    total += weight;
  }
  if (total > 0) owner = sum.divided_by(total) * owner;
}

}  // namespace
}  // namespace armature

const ConstraintKind kArmature = {"ARMATURE", armature::kSettings, &armature::apply};

}  // namespace sinew::rig
