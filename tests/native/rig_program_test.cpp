#include "sinew/rig_program.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <span>

#include "failures.h"
#include "memory.h"
#include "rig_descriptions.h"
#include "sinew/threads.h"

namespace sinew {
namespace {

using rig::Mat4;
using rig::Vec3;

constexpr float kQuarterTurn = std::numbers::pi_v<float> / 2;

void expect_near(const Vec3& found, const Vec3& expected) {
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(found[k], expected[k], 1e-6F) << "axis " << k;
}

/// A root and its child above it.
RigDescription two_bones() {
  RigDescription rig;
  add_bone(rig, "root", -1, {0, 0, 0});
  add_bone(rig, "tip", 0, {0, 1, 0});
  return rig;
}

std::string failure_of(const RigDescription& rig) {
  return complaint([&] { const RigProgram program(rig); });
}

TEST(RigProgram, LeavesBonesAtRest) {
  const std::vector<Mat4> poses = poses_of(two_bones());
  expect_near(poses[0].location(), {0, 0, 0});
  expect_near(poses[1].location(), {0, 1, 0});
  EXPECT_EQ(poses[0], rig::kIdentity4);
}

TEST(RigProgram, TurnsChildrenWithTheirParents) {
  RigDescription rig = two_bones();
  rig.bones[0].values[kEuler + 2] = kQuarterTurn;
  const std::vector<Mat4> poses = poses_of(rig);
  expect_near(poses[1].location(), {-1, 0, 0});
  expect_near(poses[1].axis(1), {-1, 0, 0});
}

TEST(RigProgram, KeepsTheRotationOfBonesThatDoNotInheritIt) {
  RigDescription rig = two_bones();
  rig.bones[0].values[kEuler + 2] = kQuarterTurn;
  rig.bones[1].inherits_rotation = false;
  const std::vector<Mat4> poses = poses_of(rig);
  expect_near(poses[1].location(), {-1, 0, 0});
  expect_near(poses[1].axis(1), {0, 1, 0});
}

TEST(RigProgram, InheritsScaleInEveryMode) {
  const std::pair<InheritScale, Vec3> cases[] = {
      {InheritScale::full, {2, 1, 3}},    {InheritScale::fix_shear, {2, 1, 3}},
      {InheritScale::aligned, {2, 1, 3}}, {InheritScale::average, {1.8171206F, 1.8171206F, 1.8171206F}},
      {InheritScale::none, {1, 1, 1}},    {InheritScale::none_legacy, {1, 1, 1}},
  };
  for (const auto& [mode, expected] : cases) {
    RigDescription rig = two_bones();
    rig.bones[0].values[kScale] = 2;
    rig.bones[0].values[kScale + 2] = 3;
    rig.bones[1].inherit_scale = mode;
    expect_near(rig::sizes_of(poses_of(rig)[1]), expected);
  }
}

TEST(RigProgram, WhatIsNotFiniteIsTheSameAgain) {
  RigDescription rig = two_bones();
  for (BoneDescription& bone : rig.bones) bone.values[kScale] = 1e30F;
  ConstraintDescription& mixed = add_constraint(rig, ConstraintType::copy_transforms, 1, 0);
  set(mixed, "influence", 0.5F);
  const RigProgram program(rig);
  for (int again = 0; again < 2; ++again) EXPECT_TRUE(std::isnan(poses_of(program, 1)[1].columns[0][0]));
}

TEST(RigProgram, ConvertsMatricesOfBones) {
  RigDescription rig = two_bones();
  rig.world = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1};
  rig.bones[0].values[kEuler + 2] = kQuarterTurn;
  rig.bones[1].values[kLocation + 1] = 2;
  const RigProgram program(rig);
  const std::vector<Mat4> poses = poses_of(rig);
  const MatrixStack<const float> given{&poses[0].columns[0][0], 1, 2, 32, 16, 1, 4};
  const auto location = [&](BoneSpace from, BoneSpace to) {
    Mat4 found;
    program.convert(given, 1, from, to, {&found.columns[0][0], 1, 1, 16, 16, 1, 4});
    return found.location();
  };
  expect_near(location(BoneSpace::pose, BoneSpace::pose), {-3, 0, 0});
  expect_near(location(BoneSpace::pose, BoneSpace::world), {2, 0, 0});
  expect_near(location(BoneSpace::world, BoneSpace::pose), {-3, 0, 0});
  expect_near(location(BoneSpace::pose, BoneSpace::local), {0, 2, 0});
  expect_near(location(BoneSpace::world, BoneSpace::local), {0, 2, 0});
  expect_near(location(BoneSpace::pose, BoneSpace::local_with_parent), {-3, -1, 0});
}

TEST(RigProgram, TakesNoLocationFromConnectedBones) {
  RigDescription rig = two_bones();
  rig.bones[1].values[kLocation] = 5;
  expect_near(poses_of(rig)[1].location(), {5, 1, 0});
  rig.bones[1].is_connected = true;
  expect_near(poses_of(rig)[1].location(), {0, 1, 0});
}

TEST(RigProgram, FollowsCurvesAndDriversThatReadThem) {
  RigDescription rig = two_bones();
  rig.curves.push_back(curve(bone_path("root", "location"), 0, {{0, 0}, {10, 20}}));
  rig.properties.push_back({"[\"amount\"]", 1, ValueKind::real, 0, 2, {0.5F}});
  // In the order opposite to the one in which they have to run.
  rig.drivers.push_back(driver(bone_path("tip", "location"), 2, {bone_path("tip", "location[1]")}));
  rig.drivers.push_back(
      driver(bone_path("tip", "location"), 1, {bone_path("root", "location.x"), "[\"amount\"]"}, "a * b + frame"));
  expect_near(poses_of(rig, 5)[1].location(), {10, 1 + 5 + 5, 10});
}

TEST(RigProgram, KeepsWhatAPropertyAllows) {
  RigDescription rig = two_bones();
  rig.properties.push_back({"[\"share\"]", 1, ValueKind::real, 0, 1, {0}});
  rig.curves.push_back(curve("[\"share\"]", 0, {{0, 0}, {10, 20}}));
  rig.drivers.push_back(driver(bone_path("tip", "location"), 0, {"[\"share\"]"}));
  EXPECT_EQ(poses_of(rig, 5)[1].location()[0], 1);
}

TEST(RigProgram, TakesGivenValuesInsteadOfCurves) {
  RigDescription rig = two_bones();
  rig.curves.push_back(curve(bone_path("root", "location"), 0, {{0, 7}}));
  const RigProgram program(rig);
  const RigProgram::Place place = program.find_value(bone_path("root", "location"));
  const float given[] = {1, 2, 3};
  EXPECT_EQ(place.count, 3);
  expect_near(poses_of(program, 1, {{{place.first, 3, given, 0}}, {}})[0].location(), {1, 2, 3});
  expect_near(poses_of(program)[0].location(), {7, 0, 0});
}

TEST(RigProgram, TakesEditsOfValuesAndCurves) {
  RigDescription rig = two_bones();
  rig.curves.push_back(curve(bone_path("root", "location"), 0, {{0, 7}}));
  add_constraint(rig, ConstraintType::copy_rotation, 1, 0).name = "first";
  const RigProgram program(rig);
  const RigProgram::Place place = program.find_value(bone_path("root", "location"));
  const float given[] = {1, 2, 3};
  const GivenInputs pose{{{place.first, 3, given, 0}}, {}};
  const AnimatedValue lower = curve(bone_path("root", "location"), 0, {{0, 5}});
  const RigProgram edited = program.edited(pose, {&lower, 1});
  expect_near(poses_of(edited)[0].location(), {5, 2, 3});
  expect_near(poses_of(program)[0].location(), {7, 0, 0});

  const float broken[] = {std::nanf("")};
  const auto failure = [&](const GivenInputs& values, std::span<const AnimatedValue> curves) {
    return complaint([&] { program.edited(values, curves); });
  };
  EXPECT_EQ(failure({{{place.first, 1, broken, 0}}, {}}, {}),
            "pose.bones[\"root\"].location[0] has nan in it; expected finite numbers");
  const AnimatedValue other = curve(bone_path("root", "location"), 1, {{0, 5}});
  EXPECT_EQ(failure({}, {&other, 1}), "pose.bones[\"root\"].location[1] follows no curve; build the rig again");
  const int influence = program.find_value("pose.bones[\"tip\"].constraints[\"first\"].influence").first;
  EXPECT_EQ(failure({{{influence, 1, given, 0}}, {}}, {}),
            "pose.bones[\"tip\"].constraints[\"first\"].influence is a setting of a constraint; build the rig again");
}

/// Adds an object with a place along X, and returns the number of its matrix.
int add_object(RigDescription& rig, const std::string& name, int parent, float x) {
  const int matrix = static_cast<int>(rig.matrices.size());
  rig.matrices.push_back({name, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}});
  ObjectDescription object{name, matrix, parent};
  object.values[kLocation] = x;
  for (const int part : {0, +kPoseBend}) {
    object.values[part + kQuaternion] = 1;
    for (int i = 0; i < 3; ++i) object.values[part + kScale + i] = 1;
  }
  rig.objects.push_back(object);
  return matrix;
}

/// The tip follows an object, the parent of which moves.
RigDescription with_objects() {
  RigDescription rig = two_bones();
  const int cart = add_object(rig, "cart", -1, 5);
  const int aim = add_object(rig, "aim", cart, 1);
  add_constraint(rig, ConstraintType::copy_location, 1).targets.push_back({RigTarget::Type::outside, aim});
  rig.curves.push_back(curve("objects[\"cart\"].location", 2, {{0, 0}, {10, 20}}));
  return rig;
}

TEST(RigProgram, PlacesObjectsThatItFollows) {
  RigDescription rig = with_objects();
  const RigProgram program(rig);
  expect_near(poses_of(program, 5)[1].location(), {6, 0, 10});
  const float numbers[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 8, 9, 1};
  expect_near(poses_of(program, 5, {{}, {{0, numbers, 0}}})[1].location(), {8, 8, 9});
  expect_near(poses_of(program, 5)[1].location(), {6, 0, 10});
  EXPECT_EQ(complaint([&] {
              program.edited({{}, {{0, numbers, 0}}}, {});
            }),
            "matrix \"cart\" is that of an object that moves; set the object's channels instead");

  std::swap(rig.objects[0], rig.objects[1]);
  EXPECT_EQ(failure_of(rig), "object \"aim\" comes before its parent; sort the objects");
  rig.objects[0] = rig.objects[1];
  EXPECT_EQ(failure_of(rig), "object \"cart\" has the matrix of another object");
  rig.objects[0].parent = 2;
  EXPECT_EQ(failure_of(rig), "object \"cart\" has matrix 2 as its parent; expected -1 to 1");
  rig.objects[0].matrix = 2;
  EXPECT_EQ(failure_of(rig), "object \"cart\" has matrix 2; the rig has 2");
  rig = with_objects();
  rig.objects[1].local = 2;
  EXPECT_EQ(failure_of(rig), "object \"aim\" has matrix 2; expected -1 to 1");
  rig.objects[1].local = -1;
  rig.objects[1].basis = 0;
  EXPECT_EQ(failure_of(rig), "object \"aim\" has the matrix of an object in another space");
  rig = with_objects();
  rig.objects[0].parent = 0;
  EXPECT_EQ(failure_of(rig), "object \"cart\" comes before its parent; sort the objects");
  rig = with_objects();
  rig.drivers.push_back(driver("objects[\"aim\"].scale", 0, {bone_path("root", "location") + "[0]"}));
  EXPECT_EQ(failure_of(rig), "a driver sets objects[\"aim\"].scale, which is not computed; use keyframes");
}

TEST(RigProgram, MovesAsAWhole) {
  RigDescription rig = two_bones();
  add_bone(rig, "other", -1, {1, 0, 0});
  rig.matrices.push_back({"Fixed", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1}});
  rig.matrices.push_back({"Rig", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}});
  ConstraintDescription& copy = add_constraint(rig, ConstraintType::copy_location, 2);
  copy.targets.push_back({RigTarget::Type::outside, 0});
  ObjectDescription own{"Rig", 1};
  own.values[kScale] = own.values[kScale + 1] = own.values[kScale + 2] = 1;
  for (int i = 0; i < 3; ++i) own.values[kPoseBend + kScale + i] = 1;
  rig.objects.push_back(own);
  rig.curves = {curve("objects[\"Rig\"].location", 0, {{0, 0}, {10, 20}})};
  RigDescription stays = rig;
  rig.place = 1;
  const RigProgram program(rig);
  for (const float frame : {0.0F, 3.0F, 7.5F}) {
    stays.world = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 2 * frame, 0, 0, 1};
    EXPECT_EQ(poses_of(program, frame), poses_of(stays, frame)) << frame;
    EXPECT_EQ(poses_of(program, frame)[2].location(), (Vec3{5 - 2 * frame, 6, 7})) << frame;
  }
  const std::array<float, 16> given = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 4, 0, 1};
  EXPECT_EQ(poses_of(program, 3, {{}, {{1, given.data(), 0}}})[2].location(), (Vec3{5, 2, 7}));
  rig.place = 2;
  EXPECT_EQ(failure_of(rig), "the armature's object has matrix 2; expected -1 to 1");
}

TEST(RigProgram, GivesTheSameBitsWithAnyNumberOfThreads) {
  RigDescription rig = two_bones();
  rig.bones[1].segments = 8;
  rig.curves.push_back(curve(bone_path("root", "rotation_euler"), 0, {{0, 0}, {100, 20}}));
  set(add_constraint(rig, ConstraintType::copy_rotation, 1, 0), "influence", 0.3F);
  const RigProgram program(rig);
  std::vector<float> frames(101);
  for (std::size_t i = 0; i < frames.size(); ++i) frames[i] = static_cast<float>(i);
  const auto evaluate = [&](int threads) {
    set_thread_count(threads);
    std::vector<Matrix4<float>> poses(frames.size() * 2);
    std::vector<Matrix4<float>> segments(frames.size() * 9);
    RigOutputs outputs;
    outputs.poses = MatrixStack<float>::of(poses.data(), 101, 2);
    outputs.segments = MatrixStack<float>::of(segments.data(), 101, 9);
    program.evaluate(frames, {}, outputs);
    set_thread_count(0);
    poses.insert(poses.end(), segments.begin(), segments.end());
    return poses;
  };
  const std::vector<Matrix4<float>> one = evaluate(1);
  const std::vector<Matrix4<float>> many = evaluate(0);
  EXPECT_EQ(std::memcmp(one.data(), many.data(), one.size() * sizeof one[0]), 0);
  // A frame does not depend on those before it.
  const Mat4 alone = poses_of(program, 50)[1];
  EXPECT_EQ(std::memcmp(&alone, one[101].data(), sizeof alone), 0);
}

TEST(RigProgram, BendsBBonesTowardsTheirHandles) {
  RigDescription rig = two_bones();
  rig.bones[0].segments = 4;
  rig.bones[0].connected_child = 1;
  rig.bones[1].is_connected = true;
  const RigProgram program(rig);
  EXPECT_EQ(program.segment_begin()[2], 5);
  std::vector<Matrix4<float>> segments(5);
  RigOutputs outputs;
  outputs.segments = MatrixStack<float>::of(segments.data(), 1, 5);
  const float frame = 1;
  program.evaluate({&frame, 1}, {}, outputs);
  for (int i = 0; i <= 4; ++i) {
    EXPECT_NEAR(segments[i](1, 3), static_cast<float>(i) / 4, 1e-6F);
    EXPECT_NEAR(segments[i](0, 3), 0, 1e-6F);
  }
  // The child bends it to the side.
  const float angles[] = {0, 0, 1};
  const GivenInputs given{{{program.find_value(bone_path("tip", "rotation_euler")).first, 3, angles, 0}}, {}};
  program.evaluate({&frame, 1}, given, outputs);
  EXPECT_GT(segments[2](0, 3), 0.01F);
}

ConstraintDescription& add_ik(RigDescription& rig, int bone, int goal) {
  ConstraintDescription& ik = add_constraint(rig, ConstraintType::ik, bone, goal);
  ik.targets.push_back({});
  set(ik, "use_tail", 1);
  set(ik, "use_location", 1);
  set(ik, "iterations", 500);
  return ik;
}

TEST(RigProgram, ReachesWithIk) {
  RigDescription rig = two_bones();
  add_bone(rig, "goal", -1, {0.5F, 1.2F, 0.3F});
  add_ik(rig, 1, 2);
  const std::vector<Mat4> poses = poses_of(rig);
  const Vec3 tail = poses[1].location() + poses[1].axis(1);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(tail[k], poses[2].location()[k], 1e-3F);
}

TEST(RigProgram, PassesIkWithoutATargetOver) {
  RigDescription rig = two_bones();
  add_bone(rig, "goal", -1, {0.5F, 1.2F, 0.3F});
  const std::vector<Mat4> unmoved = poses_of(rig);
  RigDescription with_goal = rig;
  add_ik(with_goal, 1, 2);
  const std::vector<Mat4> reached = poses_of(with_goal);
  EXPECT_NE(reached, unmoved);
  for (const RigTarget::Type type : {RigTarget::Type::none, RigTarget::Type::armature}) {
    RigDescription changed = rig;
    add_ik(changed, 1, 2).targets[0] = {type, -1};
    EXPECT_EQ(poses_of(changed), unmoved);
    add_ik(changed, 1, 2);
    EXPECT_EQ(poses_of(changed), reached) << "the next one counts, as if it were the first";
  }
  // From a child of the chain's tip on: Blender does not say what comes first.
  RigDescription further = with_goal;
  add_bone(further, "further", 1, {0, 2, 0});
  add_ik(further, 3, 2).targets[0] = {};
  EXPECT_EQ(
      failure_of(further),
      "the IK of bone [\"further\"] has no target and reaches into another chain, of which Blender takes the pose "
      "before or after IK, as it happens; remove this constraint");
  set(further.constraints[1], "chain_count", 1);
  EXPECT_EQ(poses_of(further)[1], reached[1]);
  set(further.constraints[1], "chain_count", 0);
  set(further.constraints[1], "is_valid", 0);
  EXPECT_EQ(poses_of(further).size(), 4U);
}

TEST(RigProgram, ConstraintsAreSwitchedByEitherSwitch) {
  RigDescription rig = two_bones();
  add_bone(rig, "goal", -1, {0.5F, 1.2F, 0.3F});
  const std::vector<Mat4> off = poses_of(rig);
  add_ik(rig, 1, 2).name = "Reach";
  const std::vector<Mat4> on = poses_of(rig);
  const std::string path = "pose.bones[\"tip\"].constraints[\"Reach\"].";
  rig.curves = {curve(path + "enabled", 0, {{1, 1}, {4, 1}, {5, 0}, {6, 0}})};
  EXPECT_EQ(poses_of(rig, 3), on);
  EXPECT_EQ(poses_of(rig, 5.5F), off);
  EXPECT_EQ(poses_of(rig, 4.5F), on) << "what was keyed stays until the next key";
  rig.curves[0].curve.is_free = true;
  EXPECT_EQ(poses_of(rig, 4.5F), off) << "half is not enough";
  set(rig.constraints[0], "mute", 1);
  EXPECT_EQ(poses_of(rig, 3), off);
  rig.curves[0].value.path = path + "mute";
  EXPECT_EQ(poses_of(rig, 3), off);
  EXPECT_EQ(poses_of(rig, 5.5F), on);
  set(rig.constraints[0], "enabled", 0);
  EXPECT_EQ(poses_of(rig, 5.5F), off);
}

/// A polyline from the origin to (4, 0, 0), the far end of which a bone hooks, and a chain of two bones along it.
RigDescription along_a_spline() {
  RigDescription rig = two_bones();
  const int hand = add_bone(rig, "hand", -1, {4, 0, 0});
  rig.matrices.push_back({"Rail", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}});
  rig.properties.push_back({"radii", 2, ValueKind::real, 0, 10, {1, 3}});
  SplineDescription spline;
  spline.name = "Rail";
  spline.matrix = 0;
  spline.type = SplineType::poly;
  spline.radii = "radii";
  spline.points = {{0, 0, 0, 0, 0, 0, 0, 0, 0}, {4, 0, 0, 4, 0, 0, 4, 0, 0}};
  spline.handles.resize(2);
  spline.hooks.push_back({{RigTarget::Type::bone, hand}, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -4, 0, 0, 1}, 1, {4}});
  rig.splines.push_back(spline);
  ConstraintDescription& made = add_constraint(rig, ConstraintType::spline_ik, 1);
  made.spline = 0;
  set(made, "chain_count", 2);
  set(made, "y_scale_mode", 1);
  set(made, "use_curve_radius", 1);
  return rig;
}

TEST(RigProgram, ChainsFollowASpline) {
  RigDescription rig = along_a_spline();
  std::vector<Mat4> poses = poses_of(rig);
  expect_near(poses[0].location(), {0, 0, 0});
  expect_near(poses[0].axis(1), {2, 0, 0});  // as long as half of the spline
  expect_near(poses[1].location(), {2, 0, 0});
  expect_near(poses[1].axis(1), {2, 0, 0});
  EXPECT_NEAR(rig::sizes_of(poses[0])[0], 1.5F, 1e-6F);  // the mean of the radii at both ends
  EXPECT_NEAR(rig::sizes_of(poses[1])[2], 2.5F, 1e-6F);

  rig.curves.push_back(curve(bone_path("hand", "location"), 1, {{0, 3}}));  // to (4, 3, 0)
  poses = poses_of(rig);
  expect_near(poses[0].axis(1), {2, 1.5F, 0});
  expect_near(poses[1].location(), {2, 1.5F, 0});

  set(rig.constraints[0], "y_scale_mode", 0);  // bones keep their lengths
  poses = poses_of(rig);
  expect_near(poses[1].location(), {0.8F, 0.6F, 0});
  expect_near(poses[1].axis(1), {0.8F, 0.6F, 0});

  set(rig.constraints[0], "influence", 0.5F);
  const float half = std::atan2(0.6F, 0.8F) / 2 + rig::kPi / 4;
  expect_near(poses_of(rig)[0].axis(1), {std::cos(half), std::sin(half), 0});
  set(rig.constraints[0], "mute", 1);
  expect_near(poses_of(rig)[1].location(), {0, 1, 0});
}

/// How wide the first bone is of a chain along a spline through these places on the X axis, with these radii: the mean of
/// the radius at the start and that at a quarter of the way.
float width_along(const std::vector<float>& places, const std::vector<float>& radii, int resolution) {
  RigDescription rig = along_a_spline();
  SplineDescription& spline = rig.splines[0];
  spline.hooks.clear();
  spline.points.clear();
  for (const float x : places) spline.points.push_back({x, 0, 0, x, 0, 0, x, 0, 0});
  spline.handles.resize(places.size());
  spline.resolution = resolution;
  rig.properties[0] = {"radii", static_cast<int>(radii.size()), ValueKind::real, 0, 10, radii};
  rig.constraints[0].joints = {1, 0.25F, 0};
  return rig::sizes_of(poses_of(rig)[0])[0];
}

TEST(RigProgram, OfPointsOfASplineThatCoincideTheLastCounts) {
  EXPECT_EQ(width_along({0, 2, 4}, {1, 5, 1}, 1), 2);
  EXPECT_EQ(width_along({0, 2, 2, 4}, {1, 1, 5, 1}, 1), 2);
  EXPECT_EQ(width_along({0, 2, 2, 2, 4}, {1, 7, 7, 5, 1}, 1), 2);
  // Up to a hundred-thousandth, divided by the resolution.
  const float apart = 0.00001F;
  EXPECT_EQ(width_along({0, apart, 4}, {5, 1, 1}, 1), 1);
  EXPECT_EQ(width_along({0, apart, 4}, {5, 1, 1}, 2), 3);
  EXPECT_EQ(width_along({0, std::nextafter(apart, 1.0F), 4}, {5, 1, 1}, 1), 3);
}

TEST(RigProgram, SplinesHaveShapeKeys) {
  RigDescription rig = along_a_spline();
  SplineDescription& spline = rig.splines[0];
  spline.hooks.clear();
  add_bone(rig, "child", 1, {0, 2, 0});  // comes before drivers that it does not need
  rig.properties.push_back({"raised", 1, ValueKind::real, 0, 1, {0.5F}});
  spline.keys.push_back({"raised", -1, {{0, 0, 0, 0, 0, 0, 0, 0, 0, 1}, {4, 0, 0, 4, 6, 0, 4, 0, 0, 5}}});
  const std::vector<Mat4> poses = poses_of(rig);
  expect_near(poses[1].location(), {2, 1.5F, 0});
  EXPECT_NEAR(rig::sizes_of(poses[1])[2], 3.25F, 1e-6F);                             // between 2.5 and 4
  rig.drivers.push_back(driver("raised", 0, {bone_path("hand", "scale") + "[0]"}));  // 1, before the chain is posed
  expect_near(poses_of(rig)[1].location(), {2, 3, 0});
}

TEST(RigProgram, SplinesThatAreNotWholeAreRefused) {
  const auto failure = [](const auto& change) {
    RigDescription rig = along_a_spline();
    change(rig, rig.splines[0]);
    return failure_of(rig);
  };
  using Rig = RigDescription;
  using Spline = SplineDescription;
  EXPECT_EQ(failure([](Rig&, Spline& spline) { spline.matrix = 1; }), "spline \"Rail\" has matrix 1; the rig has 1");
  EXPECT_EQ(failure([](Rig&, Spline& spline) { spline.points.pop_back(); }),
            "spline \"Rail\" has 1 point; expected 2 to 10,000");
  EXPECT_EQ(failure([](Rig&, Spline& spline) { spline.handles.clear(); }),
            "spline \"Rail\" has handles of 0 points; expected 2");
  EXPECT_EQ(failure([](Rig&, Spline& spline) { spline.resolution = 0; }),
            "spline \"Rail\" has resolution 0; expected 1 to 1,024");
  EXPECT_EQ(failure([](Rig& rig, Spline&) { rig.properties[0] = {"radii", 1, ValueKind::real, 0, 10, {1}}; }),
            "spline \"Rail\" has 2 points and as their radii radii, which is no property of so many numbers");
  EXPECT_EQ(failure([](Rig&, Spline& spline) { spline.hooks[0].points = {6}; }),
            "spline \"Rail\" has a hook of handle 6; it has 6");
  EXPECT_EQ(failure([](Rig&, Spline& spline) { spline.hooks[0].target = {}; }),
            "spline \"Rail\" has a hook without a target");
  EXPECT_EQ(failure([](Rig&, Spline& spline) {
              spline.keys.push_back({"none", -1, {}});
            }),
            "spline \"Rail\" has a key with the value none, which is no property of one number");
  EXPECT_EQ(failure([](Rig& rig, Spline&) { rig.constraints[0].spline = 1; }),
            "SPLINE_IK \"SPLINE_IK 0\" of bone \"tip\" follows spline 1; the rig has 1");
  EXPECT_EQ(failure([](Rig& rig, Spline&) {
              rig.constraints.clear();
              add_constraint(rig, ConstraintType::follow_path, 1).spline = 1;
            }),
            "FOLLOW_PATH \"FOLLOW_PATH 0\" of bone \"tip\" follows spline 1; the rig has 1");
  EXPECT_EQ(
      failure([](Rig&, Spline& spline) { spline.is_closed = true; }),
      "SPLINE_IK \"SPLINE_IK 0\" of bone \"tip\" follows the closed spline \"Rail\", which is not computed; open it");
  EXPECT_EQ(failure([](Rig&, Spline& spline) { spline.tilts = {1}; }), "spline \"Rail\" has 2 points and 1 tilt");
  EXPECT_EQ(failure([](Rig&, Spline& spline) { spline.time = "radii"; }),
            "spline \"Rail\" has as its time radii, which is no property of one number");
  EXPECT_EQ(failure([](Rig&, Spline& spline) { spline.duration = 0; }),
            "spline \"Rail\" has the duration 0; expected 1 or more");
  EXPECT_EQ(failure([](Rig& rig, Spline&) {
              rig.constraints[0].joints = {1, 0.5F};
            }),
            "Spline IK of bone \"tip\" has 2 joints for 2 bones; expected one more joint than bones");
  EXPECT_EQ(
      failure([](Rig& rig, Spline&) { rig.constraints.push_back(rig.constraints[0]); }),
      "Spline IK of bone \"tip\" moves bone \"tip\", which another IK constraint moves, too; that is not computed");
  const std::string cycle = failure([](Rig&, Spline& spline) { spline.hooks[0].target.index = 0; });
  EXPECT_NE(cycle.find("the rig has a cycle: the Spline IK of bone [\"tip\"]"), std::string::npos) << cycle;
}

/// Two bones, the last with two IK constraints.
RigDescription two_goals() {
  RigDescription rig = two_bones();
  add_bone(rig, "goal", -1, {0.5F, 1.2F, 0.3F});
  add_bone(rig, "other", -1, {-0.5F, 1.2F, 0.3F});
  add_ik(rig, 1, 2).name = "first";
  add_ik(rig, 1, 3).name = "second";
  return rig;
}

/// The influence of the first one.
int first_influence(const RigProgram& program) {
  return program.find_value("pose.bones[\"tip\"].constraints[\"first\"].influence").first;
}

TEST(RigProgram, OfSeveralIkConstraintsOfABoneTheFirstThatActsCounts) {
  const RigProgram program(two_goals());
  const int influence = first_influence(program);
  const float off = 0;
  const GivenInputs without_first{{{influence, 1, &off, 0}}, {}};
  const std::vector<Mat4> before = poses_of(program);
  const auto reached = [](const std::vector<Mat4>& poses) { return poses[1].location() + poses[1].axis(1); };
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(reached(before)[k], before[2].location()[k], 1e-3F);
  const std::vector<Mat4> second = poses_of(program, 1, without_first);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(reached(second)[k], second[3].location()[k], 1e-3F);
  EXPECT_EQ(poses_of(program), before) << "what was solved before has no effect";
}

TEST(RigProgram, ChainsOfOneRootReachTheirGoalsTogether) {
  RigDescription rig = two_bones();
  add_bone(rig, "other", 0, {0, 1, 0});
  add_bone(rig, "goal", -1, {0.5F, 1.2F, 0.3F});
  add_bone(rig, "other goal", -1, {-0.2F, 1.6F, 0.4F});
  add_ik(rig, 1, 3);
  add_ik(rig, 2, 4);
  const std::vector<Mat4> poses = poses_of(rig);
  for (const int tip : {1, 2}) {
    const Vec3 tail = poses[tip].location() + poses[tip].axis(1);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(tail[k], poses[tip + 2].location()[k], 2e-2F) << tip;
  }
}

TEST(RigProgram, ChainsThatDoNotNeedEachOtherAreAsEachAlone) {
  const auto arms = [](int first, int last) {
    RigDescription rig;
    for (int i = first; i < last; ++i) {
      const std::string number = std::to_string(i);
      const auto x = static_cast<float>(3 * i);
      const int root = add_bone(rig, "root" + number, -1, {x, 0, 0});
      const int tip = add_bone(rig, "tip" + number, root, {x, 1, 0});
      const int goal = add_bone(rig, "goal" + number, -1, {x + 0.5F, 1.2F + 0.2F * static_cast<float>(i), 0.3F});
      add_ik(rig, tip, goal);
    }
    return rig;
  };
  const std::vector<Mat4> all = poses_of(arms(0, 6));
  for (int i = 0; i < 6; ++i) {
    const std::vector<Mat4> alone = poses_of(arms(i, i + 1));
    for (int k = 0; k < 3; ++k) EXPECT_EQ(all[3 * i + k], alone[k]) << "arm " << i;
  }
}

TEST(RigProgram, RefusesTooManyCombinationsOfIk) {
  RigDescription rig;
  constexpr int kBones = 13;
  for (int i = 0; i < kBones; ++i) add_bone(rig, "b" + std::to_string(i), i - 1, {0, static_cast<float>(i), 0});
  add_bone(rig, "goal", -1, {0.5F, 1.2F, 0.3F});
  for (int i = 0; i < 2 * kBones; ++i) add_ik(rig, i / 2, kBones);
  EXPECT_EQ(
      failure_of(rig),
      "the IK constraints of 13 bones that are solved together, the last of them pose.bones[\"b12\"].location[0], "
      "act in more than 4,096 combinations; remove those that are not needed");
}

#ifdef SINEW_COUNTS_MEMORY
TEST(RigProgram, EvaluatingTakesNoMoreMemoryAfterTheFirstFrame) {
  const RigProgram program(two_goals());
  const int influence = first_influence(program);
  const float frame = 1;
  for (const float share : {1.0F, 0.0F}) {
    const GivenInputs given{{{influence, 1, &share, 0}}, {}};
    const std::size_t bytes = bytes_allocated_by([&] { program.profile({&frame, 1}, given); });
    if (share == 0) {
      EXPECT_EQ(bytes, 0U);
    }
  }
}

TEST(RigProgram, EvaluatingAllKindsOfPartsTakesNoMemory) {
  RigDescription rig = two_goals();
  const int count = static_cast<int>(rig.bones.size());
  for (int type = 0; type < static_cast<int>(ConstraintType::ik); ++type) {
    const int bone = add_bone(rig, "constrained" + std::to_string(type), 0, {1, static_cast<float>(type), 0});
    ConstraintDescription& made = add_constraint(rig, static_cast<ConstraintType>(type), bone, 1);
    const std::string_view name = constraint_name(made.type);
    const bool limits = name.starts_with("LIMIT") && made.type != ConstraintType::limit_distance;
    if (limits || made.type == ConstraintType::maintain_volume) made.targets.clear();
    if (made.type == ConstraintType::armature) made.weights = {0.5F};
    if (made.type == ConstraintType::stretch_to) set(made, "rest_length", 1);
    if (made.type == ConstraintType::limit_distance) set(made, "distance", 1);
  }
  for (const int bendy : {count, count + 1}) rig.bones[bendy].segments = 5;
  rig.bones[count].maps_curved = true;
  const RigDescription chain = along_a_spline();
  rig.splines = chain.splines;
  rig.splines[0].type = SplineType::bezier;
  rig.splines[0].hooks[0].target.index = 0;
  rig.matrices = chain.matrices;
  rig.properties = chain.properties;
  for (const char* twist : {"least", "up"}) {
    rig.splines.push_back(rig.splines[0]);
    rig.splines.back().twist = twist[0] == 'l' ? SplineTwist::minimum : SplineTwist::z_up;
    rig.splines.back().is_closed = twist[0] == 'l';
    const int follower = add_bone(rig, twist, -1, {0, 0, 0});
    ConstraintDescription& follow = add_constraint(rig, ConstraintType::follow_path, follower);
    follow.spline = static_cast<int>(rig.splines.size()) - 1;
    set(follow, "use_curve_follow", 1);
  }
  const int end = add_bone(rig, "end", add_bone(rig, "middle", -1, {0, 5, 0}), {0, 6, 0});
  ConstraintDescription follows = chain.constraints[0];
  follows.bone = end;
  rig.constraints.push_back(follows);
  const std::string root = bone_path(rig.bones[0].name, "location");
  rig.curves.push_back(curve(root, 0, {{0, 0}, {10, 3}}));
  rig.drivers.push_back(driver(root, 1, {root + "[0]"}, "sin(a) + frame / 10"));
  rig.drivers.push_back(driver(bone_path(rig.bones[count].name, "bbone_rollin"), 0, {root + "[0]"}));
  add_object(rig, "aim", -1, 5);
  const RigProgram program(rig);
  const std::array<float, 4> frames = {1, 2.5F, 7, 12};
  const auto evaluate = [&] { program.profile(frames, {}); };
  evaluate();
  EXPECT_EQ(bytes_allocated_by(evaluate), 0U);
}
#endif

TEST(RigProgram, FindsValuesByPath) {
  RigDescription rig = two_bones();
  rig.bones[1].name = "a \"b\"";
  rig.bones[add_bone(rig, "1\n2\r3\t4\a5\b6\f7", -1, {0, 0, 0})].values[kScale] = 3;
  rig.properties.push_back({"pose.bones[\"root\"][\"x y\"]", 3, ValueKind::real, 0, 1, {0, 0.5F, 1}});
  rig.values.push_back({"Lamp energy", 9});
  add_constraint(rig, ConstraintType::copy_location, 1, 0).name = "follow";
  const RigProgram program(rig);
  const auto value = [&](std::string_view path) { return program.value(program.find_value(path).first); };
  EXPECT_EQ(value("pose.bones[\"a \\\"b\\\"\"].scale"), 1);
  EXPECT_EQ(value("pose.bones[\"1\\n2\\r3\\t4\\a5\\b6\\f7\"].scale"), 3);
  EXPECT_EQ(value("pose.bones['root']['x y'][1]"), 0.5F);
  EXPECT_EQ(value("Lamp energy"), 9);
  EXPECT_EQ(value("pose.bones[\"a \\\"b\\\"\"].constraints[\"follow\"].influence"), 1);
  EXPECT_EQ(value("data.bones[\"root\"].bbone_easein"), 1);
  EXPECT_EQ(value("pose.bones[\"root\"].bbone_easein"), 0);
  EXPECT_EQ(complaint([&] { program.find_value("pose.bones[\"no\"].scale"); }),
            "the rig has no property pose.bones[\"no\"].scale; expected a path such as pose.bones[\"Hand\"].location");
}

TEST(RigProgram, NamesACycle) {
  RigDescription rig = two_bones();
  add_constraint(rig, ConstraintType::copy_location, 0, 1);
  EXPECT_EQ(
      failure_of(rig),
      "the rig has a cycle: bone [\"root\"] -> bone [\"tip\"] -> bone [\"root\"]. Blender cuts it somewhere, so the "
      "order is its own; remove one of these dependencies");
}

TEST(RigProgram, ConstraintsWithinAChainReadWhatIsThereBeforeIk) {
  RigDescription rig = two_bones();
  add_bone(rig, "goal", -1, {0.5F, 1.2F, 0.3F});
  rig.bones[0].values[kEuler + 2] = 0.3F;
  RigDescription turned = rig;
  add_constraint(rig, ConstraintType::copy_rotation, 1, 0);
  add_ik(rig, 1, 2);
  turned.bones[1].inherits_rotation = false;
  turned.bones[1].values[kEuler + 2] = 0.3F;
  add_ik(turned, 1, 2);
  const std::vector<Mat4> poses = poses_of(rig), expected = poses_of(turned);
  for (int bone = 0; bone < 3; ++bone) {
    for (int k = 0; k < 4; ++k) expect_near(poses[bone].axis(k), expected[bone].axis(k));
  }
}

TEST(RigProgram, AGoalReadsItsChainBeforeIk) {
  RigDescription rig = two_bones();
  add_bone(rig, "child", 1, {0.5F, 1.2F, 0.3F});
  add_bone(rig, "limited", -1, {4, 1, 0});
  rig.bones[0].values[kEuler + 2] = 0.3F;
  ConstraintDescription limit = add_constraint(rig, ConstraintType::limit_distance, 3, 1);
  set(limit, "distance", 0.5F);
  rig.constraints = {limit};
  const std::vector<Mat4> still = poses_of(rig);
  for (const int goal : {2, 3}) {
    rig.constraints.clear();
    add_ik(rig, 1, goal);
    rig.constraints.push_back(limit);
    const std::vector<Mat4> poses = poses_of(rig);
    EXPECT_EQ(poses[goal], still[goal]) << "goal " << goal;
    EXPECT_NE(poses[1], still[1]);
  }
}

TEST(RigProgram, ChainsThatShareABoneAreSolvedOneAfterTheOther) {
  RigDescription rig;
  for (int i = 0; i < 4; ++i) add_bone(rig, "b" + std::to_string(i), i - 1, {0, static_cast<float>(i), 0});
  add_bone(rig, "hand goal", -1, {1.2F, 2, 0.4F});
  add_bone(rig, "finger goal", 1, {0.5F, 3.2F, 0.3F});  // which the arm moves
  set(add_ik(rig, 2, 4), "chain_count", 3);
  set(add_ik(rig, 3, 5), "chain_count", 2);
  const std::vector<Mat4> poses = poses_of(rig);
  rig.constraints.pop_back();
  const std::vector<Mat4> arm = poses_of(rig);
  for (const int bone : {0, 1, 5}) EXPECT_EQ(poses[bone], arm[bone]);
  const Vec3 finger = poses[3].location() + poses[3].axis(1);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(finger[k], arm[5].location()[k], 1e-3F);
}

TEST(RigProgram, AChainThatReadsABoneFurtherDownIsACycle) {
  RigDescription rig = two_bones();
  add_bone(rig, "goal", -1, {0.5F, 1.2F, 0.3F});
  set(add_constraint(rig, ConstraintType::copy_rotation, 0, 1), "mute", 1);
  add_ik(rig, 1, 2);
  EXPECT_EQ(failure_of(rig).substr(0, 67), "the rig has a cycle: bone [\"tip\"] -> bone [\"root\"] -> bone [\"tip\"].");
}

TEST(RigProgram, ReadingABendWaitsForTheSegments) {
  RigDescription rig = two_bones();
  add_bone(rig, "handle", -1, {1, 0, 0});
  rig.bones[1].segments = 2;
  rig.bones[1].handle_types = {HandleType::absolute, HandleType::automatic};
  rig.bones[1].handles = {2, -1};
  rig.drivers.push_back(driver(bone_path("handle", "location"), 0, {bone_path("tip", "bbone_rollin")}));
  EXPECT_EQ(failure_of(rig).substr(0, 20), "the rig has a cycle:");
  rig.bones[1].handles = {0, -1};
  EXPECT_EQ(failure_of(rig), "(no complaint)");
}

TEST(RigProgram, RefusesWhatItDoesNotCompute) {
  RigDescription rig = two_bones();
  rig.refused = {"the constraint \"Wrap\" is of type SHRINKWRAP", "and this"};
  EXPECT_EQ(failure_of(rig), "the constraint \"Wrap\" is of type SHRINKWRAP, and 1 other reason");

  rig = two_bones();
  rig.blender = 304;
  EXPECT_EQ(failure_of(rig), "the rig is for version 304 of Blender; expected 402 (4.2) to 599");

  rig = two_bones();
  set(add_constraint(rig, ConstraintType::stretch_to, 1, 0), "rest_length", 0);
  EXPECT_EQ(failure_of(rig),
            "STRETCH_TO \"STRETCH_TO 0\" of bone \"tip\" has a rest length of 0, which Blender replaces when it first "
            "acts; show a frame on which it does");
  rig.constraints[0].targets[0] = {};
  EXPECT_EQ(poses_of(rig), poses_of(two_bones())) << "without a target, nothing has a length";

  rig = two_bones();
  rig.drivers.push_back(driver(bone_path("tip", "location"), 0, {"[\"gone\"]"}));
  EXPECT_EQ(failure_of(rig),
            "the driver of pose.bones[\"tip\"].location[0] reads [\"gone\"], which the rig does not have; remove it or "
            "describe the property");

  rig = two_bones();
  rig.curves.push_back(curve(bone_path("tip", "location"), 3, {{0, 0}}));
  EXPECT_EQ(failure_of(rig), "a curve sets number 3 of pose.bones[\"tip\"].location, which has 3");

  rig = two_bones();
  rig.bones[0].parent = 1;
  EXPECT_EQ(failure_of(rig), "bone \"root\" is bone 0 and has parent 1; expected -1 or a bone in front of it");

  rig = two_bones();
  rig.bones[1].name = "root";
  EXPECT_EQ(failure_of(rig), "two bones are named \"root\"; give each a name of its own");

  rig = two_bones();
  rig.bones[1].rest[5] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(failure_of(rig), "the rest matrix of bone \"tip\" has inf in it; expected finite numbers");

  rig = two_bones();
  rig.bones[1].segments = 33;
  EXPECT_EQ(failure_of(rig), "bone \"tip\" has 33 segments; expected 1 to 32");

  rig = two_bones();
  add_constraint(rig, ConstraintType::copy_location, 1, 7);
  EXPECT_EQ(failure_of(rig), "COPY_LOCATION \"COPY_LOCATION 0\" of bone \"tip\" looks at bone 7; the rig has 2");

  rig = two_bones();
  add_constraint(rig, ConstraintType::copy_location, 1, 0).settings.pop_back();
  EXPECT_EQ(failure_of(rig), "constraint \"COPY_LOCATION 0\" has 14 settings; a COPY_LOCATION has 15");
}

TEST(RigProgram, StopsAtADriverWithoutAValue) {
  RigDescription rig = two_bones();
  rig.drivers.push_back(driver(bone_path("tip", "location"), 0, {bone_path("root", "location[0]")}, "1 / a"));
  const RigProgram program(rig);
  EXPECT_EQ(
      complaint([&] { poses_of(program, 3); }),
      "the driver of pose.bones[\"tip\"].location[0] divides by 0 or has no value on frame 3; Blender switches such "
      "a driver off. Change its expression");
}

}  // namespace
}  // namespace sinew
