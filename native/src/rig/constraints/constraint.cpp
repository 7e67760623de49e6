#include "rig/constraints/constraint.h"

#include "rig/bend.h"

namespace sinew::rig {
namespace {

/// In the order of ConstraintType.
constexpr const ConstraintKind* kKinds[] = {
    &kCopyLocation, &kCopyRotation,  &kCopyScale,      &kCopyTransforms, &kLimitLocation, &kLimitRotation,
    &kLimitScale,   &kLimitDistance, &kMaintainVolume, &kTransformation, &kDampedTrack,   &kLockedTrack,
    &kStretchTo,    &kTrackTo,       &kArmature,       &kChildOf,        &kFloor,         &kPivot,
    &kAction,       &kIkConstraint,  &kSplineIk,       &kFollowPath,
};

/// A bone's pose at a place along it. `along` is 0 at its head.
Mat4 pose_along(const Program& program, const State& state, int index, float along, bool follows_bend, bool is_whole) {
  const Bone& bone = program.bones[index];
  const bool is_bent = follows_bend && bone.is_bendy();
  if (along < 0.000001F && !(is_bent && is_whole)) return state.poses[index];
  Mat4 pose = state.poses[index];
  if (!is_bent) {
    pose.set_location(lerp(pose.location(), state.tails[index], along));
    return pose;
  }
  const Place place = place_along(bone.bend.segments, along);
  const Mat4* segments = state.segments.data() + bone.bend.first + place.segment;
  if (is_whole) return pose * blended(segments[0], segments[1], place.fraction);
  const Vec3 local = lerp(segments[0].location(), segments[1].location(), place.fraction);
  pose.set_location(transformed_point(state.poses[index], local));
  return pose;
}

}  // namespace

const ConstraintKind& kind_of(ConstraintType type) { return *kKinds[static_cast<int>(type)]; }

std::span<const ConstraintKind* const> constraint_kinds() { return kKinds; }

Mat4 Acting::custom_space() const {
  const RigTarget& space = constraint_.space;
  const bool is_custom = owner_space() == Space::custom || target_space() == Space::custom;
  if (!is_custom) return kIdentity4;
  switch (space.type) {
    case RigTarget::Type::bone:
      return to_world(state_, state_.poses[space.index]);
    case RigTarget::Type::armature:
      return state_.world;
    case RigTarget::Type::outside:
      return state_.outside[space.index];
    default:
      return kIdentity4;
  }
}

std::optional<Mat4> Acting::target_in_world(int number_of_target, bool is_whole) const {
  const RigTarget& target = constraint_.targets[number_of_target];
  switch (target.type) {
    case RigTarget::Type::bone:
      return to_world(state_,
                      pose_along(program_, state_, target.index, number(kHeadTail), flag(kAlongBend), is_whole));
    case RigTarget::Type::armature:
      return state_.world;
    case RigTarget::Type::outside:
      return state_.outside[target.index];
    default:
      return std::nullopt;
  }
}

std::optional<Mat4> Acting::target(bool is_whole) const {
  const std::optional<Mat4> world = target_in_world(0, is_whole);
  if (!world) return world;
  const RigTarget& target = constraint_.targets[0];
  const Mat4 custom = custom_space();
  const Conversion conversion{target.type == RigTarget::Type::bone ? target.index : -1, constraint_.bone, custom};
  return converted(program_, state_, conversion, *world, Space::world, target_space());
}

void apply_constraint(const Program& program, State& state, const Constraint& constraint, Mat4& world) {
  const ConstraintKind& kind = kind_of(constraint.type);
  const Acting acting(program, state, constraint);
  if (!acting.is_on() || !acting.flag(kValid)) return;
  const float influence = acting.number(kInfluence);
  if (influence == 0) return;
  const Mat4 custom = acting.custom_space();
  const Conversion conversion{constraint.bone, constraint.bone, custom};
  const Space space = acting.owner_space();
  Mat4 owner = converted(program, state, conversion, world, Space::world, space);
  kind.apply(acting, owner);
  const bool leaves_space = kind.leaves_space && constraint.targets[0].type != RigTarget::Type::none;
  if (!leaves_space) owner = converted(program, state, conversion, owner, space, Space::world);
  world = influence < 1.0F ? blended(world, owner, influence) : owner;
}

}  // namespace sinew::rig
