#include <algorithm>

#include "rig/build.h"
#include "rig/constraints/constraint.h"
#include "rig/constraints/ik.h"
#include "rig/constraints/spline_ik.h"
#include "rig/ik_plan.h"
#include "rig/order.h"

namespace sinew::rig {
namespace {

/// Where Blender puts the joints of a chain along its spline, from the tip on: evenly, or by the bones' lengths.
std::vector<float> bound_joints(const Program& program, const Chain& chain, bool is_even) {
  std::vector<float> joints = {1};
  for (const int bone : chain.bones) {
    const float share = is_even || chain.length == 0 ? 1.0F / static_cast<float>(chain.bones.size())
                                                     : program.bones[bone].length / chain.length;
    joints.push_back(joints.back() - share);
  }
  return joints;
}

}  // namespace

void add_spline(const RigDescription& rig, int index, Program& program) {
  const SplineDescription& given = rig.splines[index];
  const auto text = [&] { return "spline \"" + given.name + "\""; };
  const int matrices = static_cast<int>(rig.matrices.size());
  if (given.matrix < 0 || given.matrix >= matrices) {
    fail(text(), " has matrix ", given.matrix, "; the rig has ", grouped(matrices));
  }
  constexpr int kMostPoints = 10000;
  constexpr int kMostPieces = 1024;  // Blender's limits
  constexpr int kMostOrder = 64;
  constexpr int kMostPlaces = 100'000;
  const int count = static_cast<int>(std::min<std::size_t>(given.points.size(), kMostPoints + 1));
  if (count < 2 || count > kMostPoints) {
    fail(text(), " has ", plural(static_cast<long long>(given.points.size()), "point"), "; expected 2 to ",
         grouped(kMostPoints));
  }
  if (given.handles.size() != given.points.size()) {
    fail(text(), " has handles of ", plural(static_cast<long long>(given.handles.size()), "point"), "; expected ",
         count);
  }
  if (given.resolution < 1 || given.resolution > kMostPieces) {
    fail(text(), " has resolution ", given.resolution, "; expected 1 to ", grouped(kMostPieces));
  }
  Spline spline;
  spline.matrix = given.matrix;
  spline.type = given.type;
  spline.resolution = given.resolution;
  const ValueMap::Found radii = program.map.find(given.radii);
  if (radii.first < 0 || radii.count != count) {
    fail(text(), " has ", count, " points and as their radii ", given.radii,
         ", which is no property of so many numbers");
  }
  spline.radii = radii.first;
  spline.radius_interpolation = given.radius_interpolation;
  for (const std::array<float, 9>& point : given.points) {
    check_finite(point, "a point of " + text());
    spline.points.push_back(
        {{{point[0], point[1], point[2]}, {point[3], point[4], point[5]}, {point[6], point[7], point[8]}}});
  }
  spline.handles = given.handles;
  spline.is_closed = given.is_closed;
  if (!given.tilts.empty() && given.tilts.size() != given.points.size()) {
    fail(text(), " has ", count, " points and ", plural(static_cast<long long>(given.tilts.size()), "tilt"));
  }
  check_finite(given.tilts, "a tilt of " + text());
  spline.tilts = given.tilts;
  spline.tilts.resize(given.points.size());
  spline.tilt_interpolation = given.tilt_interpolation;
  spline.twist = given.twist;
  if (given.type == SplineType::nurbs) {
    if (given.order < 2 || given.order > std::min(count, kMostOrder)) {
      fail(text(), " has ", count, " points and order ", given.order, "; expected 2 to ", std::min(count, kMostOrder));
    }
    if (!given.weights.empty() && given.weights.size() != given.points.size()) {
      fail(text(), " has ", count, " points and ", plural(static_cast<long long>(given.weights.size()), "weight"));
    }
    check_finite(given.weights, "a weight of " + text());
    if (count * given.resolution > kMostPlaces) {
      fail(text(), " has ", count, " points and resolution ", given.resolution, "; NURBS have at most ",
           grouped(kMostPlaces), " places");
    }
    spline.places = nurbs_places(given);
  }
  if (!given.time.empty()) {
    const ValueMap::Found time = program.map.find(given.time);
    if (time.first < 0 || time.count != 1) {
      fail(text(), " has as its time ", given.time, ", which is no property of one number");
    }
    spline.time = time.first;
  }
  if (given.duration < 1) fail(text(), " has the duration ", given.duration, "; expected 1 or more");
  spline.duration = static_cast<float>(given.duration);
  spline.stays_within = given.stays_within;
  spline.has_keys = given.has_keys;
  for (const SplineKey& key : given.keys) {
    const ValueMap::Found value = program.map.find(key.value);
    if (value.first < 0 || value.count != 1) {
      fail(text(), " has a key with the value ", key.value, ", which is no property of one number");
    }
    if (key.points.size() != given.points.size()) {
      fail(text(), " has ", count, " points and a key with ", key.points.size());
    }
    if (key.relative < -1 || key.relative >= static_cast<int>(given.keys.size())) {
      fail(text(), " has a key relative to key ", key.relative, "; expected -1 to ", given.keys.size() - 1);
    }
    for (const std::array<float, 10>& point : key.points) check_finite(point, "a point of a key of " + text());
    spline.keys.push_back({value.first, key.relative, key.points});
  }
  spline.hooks = given.hooks;
  for (const SplineHook& hook : spline.hooks) {
    check_target(rig, hook.target, text);
    if (hook.target.type == RigTarget::Type::none) fail(text(), " has a hook without a target");
    check_finite(hook.inverse, "the inverse matrix of a hook of " + text());
    check_finite({&hook.strength, 1}, "the strength of a hook of " + text());
    for (const int point : hook.points) {
      if (point < 0 || point >= 3 * count) fail(text(), " has a hook of handle ", point, "; it has ", 3 * count);
    }
  }
  program.splines.push_back(std::move(spline));
}

void add_chains(const RigDescription& rig, Program& program) {
  const std::vector<char> written = written_values(program);
  for (std::size_t i = 0; i < program.constraints.size(); ++i) {
    const Constraint& constraint = program.constraints[i];
    if (constraint.type != ConstraintType::spline_ik) continue;
    const auto initial = [&](int setting) { return program.map.values()[constraint.values + setting].initial; };
    if (!may_act(program, written, constraint.values)) continue;
    const std::string text = "Spline IK of " + bone_text(rig, constraint.bone);
    Chain chain;
    chain.constraint = static_cast<int>(i);
    chain.spline = constraint.spline;
    const int number = static_cast<int>(program.chains.size());
    for (const int bone : ik_chain(program.bones, constraint.bone, static_cast<int>(initial(kSplineChainLength)))) {
      if (program.bones[bone].tree >= 0 || program.bones[bone].chain >= 0) {
        fail(text, " moves ", bone_text(rig, bone), ", which another IK constraint moves, too; that is not computed");
      }
      program.bones[bone].chain = number;
      chain.bones.push_back(bone);
      chain.length += program.bones[bone].length;
    }
    chain.joints = constraint.joints;
    if (chain.joints.empty()) chain.joints = bound_joints(program, chain, initial(kSplineEvenDivisions) != 0);
    if (chain.joints.size() <= chain.bones.size()) {
      fail(text, " has ", plural(static_cast<long long>(chain.joints.size()), "joint"), " for ",
           plural(static_cast<long long>(chain.bones.size()), "bone"), "; expected one more joint than bones");
    }
    float& root = chain.joints[chain.bones.size()];
    root = std::max(root, 0.0F);
    program.chains.push_back(std::move(chain));
  }
}

}  // namespace sinew::rig
