/// Every type of constraint, on a bone at (1, 2, 3) with a target bone, with values by hand.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "rig_descriptions.h"

namespace sinew {
namespace {

using rig::Mat4;
using rig::Vec3;

constexpr float kQuarterTurn = std::numbers::pi_v<float> / 2;

class RigConstraint : public testing::Test {
 protected:
  RigConstraint() {
    add_bone(rig_, "target", -1, {0, 0, 0});
    add_bone(rig_, "owner", -1, {1, 2, 3});
  }

  ConstraintDescription& add(ConstraintType type, bool has_target = true) {
    return add_constraint(rig_, type, 1, has_target ? 0 : -1);
  }
  void move_target(Vec3 location, Vec3 angles = {0, 0, 0}, Vec3 scale = {1, 1, 1}) { put(0, location, angles, scale); }
  void put(int bone, Vec3 location, Vec3 angles, Vec3 scale) {
    for (int k = 0; k < 3; ++k) {
      rig_.bones[bone].values[kLocation + k] = location[k];
      rig_.bones[bone].values[kEuler + k] = angles[k];
      rig_.bones[bone].values[kScale + k] = scale[k];
    }
  }
  Mat4 owner() const { return poses_of(rig_)[1]; }

  static void expect(const Vec3& found, const Vec3& expected) {
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(found[k], expected[k], 2e-6F) << "axis " << k;
  }

  RigDescription rig_;
};

TEST_F(RigConstraint, CopiesLocation) {
  move_target({4, 5, 6});
  ConstraintDescription& copy = add(ConstraintType::copy_location);
  expect(owner().location(), {4, 5, 6});
  set(copy, "use_y", 0);
  set(copy, "invert_z", 1);
  expect(owner().location(), {4, 2, -6});
  set(copy, "use_offset", 1);
  expect(owner().location(), {5, 2, -3});
  set(copy, "influence", 0.5F);
  expect(owner().location(), {3, 2, 0});
}

TEST_F(RigConstraint, DoesNothingIfMutedOrInvalid) {
  move_target({4, 5, 6});
  ConstraintDescription& copy = add(ConstraintType::copy_location);
  set(copy, "mute", 1);
  expect(owner().location(), {1, 2, 3});
  set(copy, "mute", 0);
  set(copy, "enabled", 0);
  expect(owner().location(), {1, 2, 3});
  set(copy, "enabled", 1);
  set(copy, "is_valid", 0);
  expect(owner().location(), {1, 2, 3});
}

TEST_F(RigConstraint, ReadsAPlaceAlongTheTarget) {
  move_target({4, 5, 6});
  set(add(ConstraintType::copy_location), "head_tail", 0.25F);
  expect(owner().location(), {4, 5.25F, 6});
}

TEST_F(RigConstraint, CopiesRotation) {
  move_target({0, 0, 0}, {0, 0, kQuarterTurn});
  ConstraintDescription& copy = add(ConstraintType::copy_rotation);
  expect(owner().axis(1), {-1, 0, 0});
  expect(owner().location(), {1, 2, 3});
  set(copy, "use_z", 0);
  expect(owner().axis(1), {0, 1, 0});
}

TEST_F(RigConstraint, CopiesScale) {
  move_target({0, 0, 0}, {0, 0, 0}, {2, 3, 4});
  ConstraintDescription& copy = add(ConstraintType::copy_scale);
  expect(rig::sizes_of(owner()), {2, 3, 4});
  set(copy, "power", 2);
  expect(rig::sizes_of(owner()), {4, 9, 16});
  set(copy, "power", 1);
  set(copy, "use_make_uniform", 1);
  const float uniform = std::cbrt(24.0F);
  expect(rig::sizes_of(owner()), {uniform, uniform, uniform});
}

TEST_F(RigConstraint, CopiesTransforms) {
  move_target({4, 5, 6}, {0, 0, kQuarterTurn}, {2, 2, 2});
  put(1, {1, 0, 0}, {0, 0, 0}, {1, 1, 1});
  ConstraintDescription& copy = add(ConstraintType::copy_transforms);
  expect(owner().location(), {4, 5, 6});
  expect(owner().axis(1), {-2, 0, 0});
  const std::pair<int, Vec3> cases[] = {
      {1, {4 - 4, 5 + 4, 6 + 6}},  // before: the target moves the owner's (2, 2, 3)
      {2, {6, 7, 9}},              // after
      {3, {6, 7, 9}},              // before, split
      {5, {0, 9, 12}},             // before, as matrices
  };
  for (const auto& [mix, location] : cases) {
    set(copy, "mix_mode", static_cast<float>(mix));
    expect(owner().location(), location);
  }
}

TEST_F(RigConstraint, LimitsLocation) {
  ConstraintDescription& limit = add(ConstraintType::limit_location, false);
  set(limit, "use_max_x", 1);
  set(limit, "max_x", 0.5F);
  set(limit, "use_min_z", 1);
  set(limit, "min_z", 4);
  expect(owner().location(), {0.5F, 2, 4});
}

TEST_F(RigConstraint, LimitsRotation) {
  put(1, {0, 0, 0}, {0.5F, 0, 1}, {1, 1, 1});
  ConstraintDescription& limit = add(ConstraintType::limit_rotation, false);
  set(limit, "use_limit_x", 0);
  set(limit, "use_limit_y", 0);
  set(limit, "max_z", 0.25F);
  expect(rig::euler_of(owner(), rig::EulerOrder::xyz), {0.5F, 0, 0.25F});
  set(limit, "use_legacy_behavior", 1);
  expect(rig::euler_of(owner(), rig::EulerOrder::xyz), {0.5F, 0, 0.25F});
}

TEST_F(RigConstraint, LimitsScale) {
  put(1, {0, 0, 0}, {0, 0, 0}, {2, 0.5F, 1});
  ConstraintDescription& limit = add(ConstraintType::limit_scale, false);
  set(limit, "use_max_x", 1);
  set(limit, "max_x", 1.5F);
  set(limit, "use_min_y", 1);
  set(limit, "min_y", 0.75F);
  expect(rig::sizes_of(owner()), {1.5F, 0.75F, 1});
}

TEST_F(RigConstraint, LimitsDistance) {
  move_target({1, 2, 0});
  ConstraintDescription& limit = add(ConstraintType::limit_distance);
  set(limit, "distance", 2);
  expect(owner().location(), {1, 2, 2});  // inside
  set(limit, "distance", 4);
  expect(owner().location(), {1, 2, 3});
  set(limit, "limit_mode", 1);  // outside
  expect(owner().location(), {1, 2, 4});
  set(limit, "distance", 2);
  move_target({1, 2, 3});  // in no direction from there
  expect(owner().location(), {1, 2, 3});
  move_target({1, 2, 0});
  rig_.curves.push_back(curve(bone_path("owner", "constraints[\"LIMIT_DISTANCE 0\"].distance"), 0, {{0, 0}}));
  set(limit, "limit_mode", 0);
  expect(owner().location(), {1, 2, 3});  // a distance of 0 is the present one
}

TEST_F(RigConstraint, OnTheSurfaceIsWhatIsHardlyBesideIt) {
  constexpr float kEpsilon = std::numeric_limits<float>::epsilon(), kNearly = 0.5F + kEpsilon / 2;
  ConstraintDescription& limit = add(ConstraintType::limit_distance);
  set(limit, "limit_mode", 2);
  set(limit, "distance", 0.5F);
  rig_.bones[1].head_in_armature = rig_.bones[1].head = {0, 0, 0};
  for (const float distance : {0.5F, kNearly, 0.5F + kEpsilon, 0.5F - kEpsilon}) {
    rig_.bones[1].rest[12] = rig_.bones[1].rest[13] = 0;
    rig_.bones[1].rest[14] = distance;
    EXPECT_EQ(owner().location()[2], distance == kNearly ? kNearly : 0.5F);
  }
}

TEST_F(RigConstraint, MaintainsVolume) {
  put(1, {0, 0, 0}, {0, 0, 0}, {1, 4, 1});
  set(add(ConstraintType::maintain_volume, false), "free_axis", 1);
  expect(rig::sizes_of(owner()), {0.5F, 4, 0.5F});
}

TEST_F(RigConstraint, TracksWithTheShortestRotation) {
  move_target({5, 2, 3});
  set(add(ConstraintType::damped_track), "track_axis", 1);
  expect(owner().axis(1), {1, 0, 0});
  expect(owner().axis(2), {0, 0, 1});
}

TEST_F(RigConstraint, TracksOppositeDirections) {
  move_target({1, -5, 3});
  set(add(ConstraintType::damped_track), "track_axis", 1);
  expect(owner().axis(1), {0, -1, 0});
}

TEST_F(RigConstraint, TurnsByTheLeastAngleThatCanBeTold) {
  constexpr float kEpsilon = std::numeric_limits<float>::epsilon();
  set(add(ConstraintType::damped_track), "track_axis", 1);
  for (const float aside : {kEpsilon, kEpsilon / 2}) {
    rig_.bones[1].rest[12] = 0;
    rig_.bones[1].head_in_armature = rig_.bones[1].head = {0, 2, 3};
    move_target({aside, 3, 3});
    EXPECT_EQ(owner().axis(1)[0], aside == kEpsilon ? kEpsilon : 0);
  }
}

TEST_F(RigConstraint, TracksWithALockedAxis) {
  move_target({5, 7, 3});
  ConstraintDescription& track = add(ConstraintType::locked_track);
  set(track, "track_axis", 1);
  set(track, "lock_axis", 2);
  expect(owner().axis(1), {4 / std::sqrt(41.0F), 5 / std::sqrt(41.0F), 0});
  expect(owner().axis(2), {0, 0, 1});
}

TEST_F(RigConstraint, TracksWithUpAxis) {
  move_target({5, 2, 3});
  ConstraintDescription& track = add(ConstraintType::track_to);
  set(track, "track_axis", 1);
  set(track, "up_axis", 2);
  expect(owner().axis(1), {1, 0, 0});
  expect(owner().axis(2), {0, 0, 1});
}

TEST_F(RigConstraint, TracksWhatIsInItsOwnPlaceAsIfItWereBelow) {
  move_target({1, 2, 3});
  ConstraintDescription& track = add(ConstraintType::track_to);
  set(track, "track_axis", 1);
  set(track, "up_axis", 2);
  expect(owner().axis(1), {0, 0, -1});
  expect(owner().axis(2), {0, 1, 0});
}

TEST_F(RigConstraint, Stretches) {
  move_target({1, 6, 3});
  ConstraintDescription& stretch = add(ConstraintType::stretch_to);
  set(stretch, "rest_length", 1);
  for (const int keep_axis : {0, 1, 2}) {
    set(stretch, "keep_axis", static_cast<float>(keep_axis));
    expect(rig::sizes_of(owner()), {0.5F, 4, 0.5F});
    expect(owner().axis(1), {0, 4, 0});
  }
  set(stretch, "use_bulge_min", 1);
  set(stretch, "bulge_min", 0.81F);
  expect(rig::sizes_of(owner()), {0.9F, 4, 0.9F});
}

TEST_F(RigConstraint, FollowsTargetsByWeight) {
  move_target({2, 0, 0});
  for (const float preserves_volume : {0.0F, 1.0F}) {
    rig_.constraints.clear();
    ConstraintDescription& armature = add(ConstraintType::armature);
    armature.weights = {1};
    set(armature, "use_deform_preserve_volume", preserves_volume);
    expect(owner().location(), {3, 2, 3});
    armature.targets.push_back(armature.targets.front());
    armature.weights = {0.25F, 0.5F};
    expect(owner().location(), {3, 2, 3});
  }
}

TEST_F(RigConstraint, BecomesAChild) {
  move_target({0, 0, 0}, {0, 0, kQuarterTurn});
  ConstraintDescription& child = add(ConstraintType::child_of);
  for (int i = 0; i < 16; i += 5) set(child, "inverse_matrix", 1, i);
  expect(owner().location(), {-2, 1, 3});
  set(child, "use_location_x", 0);
  expect(owner().location(), {1, 1, 3});
  rig_.world = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1};
  set(child, "owner_space", 2);  // POSE, as Blender makes it
  child.targets[0] = {};
  expect(owner().location(), {1, 2, 3});
}

TEST_F(RigConstraint, MapsTransforms) {
  move_target({0.5F, 0, 0});
  ConstraintDescription& map = add(ConstraintType::transformation);
  set(map, "from_max_x", 1);
  set(map, "map_to", 1);
  set(map, "map_to_z_from", 0);
  set(map, "to_max_z_rot", kQuarterTurn * 2);
  expect(owner().axis(1), {-1, 0, 0});
  move_target({9, 0, 0});
  expect(owner().axis(1), {0, -1, 0});  // clamped
}

TEST_F(RigConstraint, StaysAboveAFloor) {
  move_target({0, 0, 7});
  ConstraintDescription& floor = add(ConstraintType::floor);
  set(floor, "floor_location", 2);
  expect(owner().location(), {1, 2, 7});
  set(floor, "offset", 1);
  expect(owner().location(), {1, 2, 8});
  set(floor, "floor_location", 5);  // below
  expect(owner().location(), {1, 2, 3});
}

TEST_F(RigConstraint, FollowsAPath) {
  put(1, {-1, -2, -3}, {0, 0, 0}, {1, 1, 1});  // to the origin
  rig_.matrices.push_back({"Rail", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1}});
  rig_.properties.push_back({"radii", 3, ValueKind::real, 0, 10, {1, 3, 3}});
  rig_.properties.push_back({"time", 1, ValueKind::real, -1e6F, 1e6F, {25}});
  SplineDescription spline;
  spline.name = "Rail";
  spline.matrix = 0;
  spline.type = SplineType::poly;
  spline.radii = "radii";
  spline.time = "time";
  spline.points = {{0, 0, 0, 0, 0, 0, 0, 0, 0}, {4, 0, 0, 4, 0, 0, 4, 0, 0}, {4, 4, 0, 4, 4, 0, 4, 4, 0}};
  spline.handles.resize(3);
  rig_.splines.push_back(spline);
  ConstraintDescription& follow = add(ConstraintType::follow_path, false);
  expect(owner().location(), {0, 0, 0});  // without a curve
  follow.spline = 0;
  expect(owner().location(), {7, 0, 0});
  set(follow, "offset", -25);
  expect(owner().location(), {9, 0, 0});
  set(follow, "offset", -200);  // not beyond the end
  expect(owner().location(), {9, 4, 0});
  set(follow, "use_fixed_location", 1);
  set(follow, "offset_factor", 0.75F);
  expect(owner().location(), {9, 2, 0});
  set(follow, "use_curve_follow", 1);
  set(follow, "forward_axis", 1);
  set(follow, "up_axis", 2);
  set(follow, "offset_factor", 0);
  expect(owner().axis(0), {0, -1, 0});
  set(follow, "offset_factor", 0.25F);
  set(follow, "use_curve_radius", 1);
  EXPECT_NEAR(rig::sizes_of(owner())[2], 2, 1e-6F);
  rig_.splines[0].is_closed = true;
  set(follow, "use_fixed_location", 0);
  set(follow, "offset", 25 + 100);  // once around
  expect(owner().location(), {5, 0, 0});
}

TEST_F(RigConstraint, TurnsAboutAPivot) {
  move_target({1, 2, 0});
  put(1, {0, 0, 0}, {kQuarterTurn, 0, 0}, {1, 1, 1});
  ConstraintDescription& pivot = add(ConstraintType::pivot);
  for (const int range : {-1, 1, 2, 3, 4, 5}) {  // an angle of 0 is in both ranges about an axis
    set(pivot, "rotation_range", static_cast<float>(range));
    expect(owner().location(), {1, -1, 0});
  }
  set(pivot, "rotation_range", 0);
  expect(owner().location(), {1, 2, 3});
}

TEST_F(RigConstraint, APivotOfWhatIsNotTurnedRoundsAsBlenderDoes) {
  move_target({0, 1e8F, 0});
  add(ConstraintType::pivot);
  EXPECT_EQ(owner().location(), (Vec3{1, 0, 3}));
}

TEST_F(RigConstraint, PlaysAnAction) {
  move_target({0.5F, 0, 0});
  ConstraintDescription& action = add(ConstraintType::action);
  set(action, "transform_channel", 20);
  set(action, "max", 1);
  set(action, "frame_end", 10);
  action.action.push_back({kLocation, curve("", 0, {{0, 0}, {10, 8}}).curve});
  expect(owner().location(), {5, 2, 3});
}

TEST_F(RigConstraint, WorksInSpaces) {
  // The target is moved by 1 in its own space, wherever it rests.
  move_target({0, 0, 1});
  ConstraintDescription& copy = add(ConstraintType::copy_location);
  set(copy, "owner_space", 1);
  set(copy, "target_space", 1);
  expect(owner().location(), {1, 2, 4});
}

TEST_F(RigConstraint, WorksInACustomSpace) {
  move_target({4, 5, 6});
  ConstraintDescription& limit = add(ConstraintType::limit_location, false);
  limit.space = {RigTarget::Type::bone, 0};
  set(limit, "owner_space", 5);
  set(limit, "use_min_x", 1);
  set(limit, "min_x", 2);
  expect(owner().location(), {6, 2, 3});
}

TEST_F(RigConstraint, TracksWithoutASize) {
  move_target({5, 7, 3});
  put(1, {0, 0, 0}, {0, 0, 0}, {1, 1, 0});
  ConstraintDescription& track = add(ConstraintType::locked_track);
  set(track, "track_axis", 1);
  set(track, "lock_axis", 2);
  const Mat4 found = owner();
  for (int i = 0; i < 16; ++i) EXPECT_TRUE(std::isfinite(found[i / 4][i % 4])) << i;
}

TEST_F(RigConstraint, WorksBelowAParentOfScale0) {
  rig_.bones[1].parent = 0;
  rig_.bones[1].head = {1, 1, 3};
  move_target({0, 0, 0}, {0, 0, 0}, {2, 1, 0});
  set(add(ConstraintType::limit_location, false), "owner_space", 1);
  for (const bool inherits_rotation : {true, false}) {
    rig_.bones[1].inherits_rotation = inherits_rotation;
    for (int mode = 0; mode <= static_cast<int>(InheritScale::none_legacy); ++mode) {
      rig_.bones[1].inherit_scale = static_cast<InheritScale>(mode);
      const Mat4 found = owner();
      for (int i = 0; i < 16; ++i) EXPECT_TRUE(std::isfinite(found[i / 4][i % 4])) << mode << " at " << i;
      expect(found.location(), {2, 2, 0});
    }
  }
}

}  // namespace
}  // namespace sinew
