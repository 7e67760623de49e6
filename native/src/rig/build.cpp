#include <algorithm>
#include <cmath>
#include <span>

#include "base/check.h"
#include "rig/constraints/constraint.h"
#include "rig/constraints/ik.h"
#include "rig/constraints/spline_ik.h"
#include "rig/ik_plan.h"
#include "rig/order.h"
#include "rig/program.h"

namespace sinew::rig {
namespace {

std::string bone_text(const RigDescription& rig, int bone) { return "bone \"" + rig.bones[bone].name + "\""; }

std::string constraint_text(const RigDescription& rig, const ConstraintDescription& constraint) {
  return std::string(constraint_name(constraint.type)) + " \"" + constraint.name + "\" of " +
         bone_text(rig, constraint.bone);
}

/// owner: returns what has the target, for messages. To write them takes longer than all else.
template <class Owner>
void check_target(const RigDescription& rig, const RigTarget& target, const Owner& owner) {
  const auto check = [&](std::size_t count, const char* what) {
    if (target.index < 0 || target.index >= static_cast<int>(count)) {
      fail(owner(), " looks at ", what, " ", target.index, "; the rig has ", grouped(static_cast<long long>(count)));
    }
  };
  if (target.type == RigTarget::Type::bone) check(rig.bones.size(), "bone");
  if (target.type == RigTarget::Type::outside) check(rig.matrices.size(), "matrix");
}

Mat3 matrix3_of(const std::array<float, 9>& numbers) {
  return {{{numbers[0], numbers[1], numbers[2]},
           {numbers[3], numbers[4], numbers[5]},
           {numbers[6], numbers[7], numbers[8]}}};
}

Vec3 vector_of(const std::array<float, 3>& numbers) { return {numbers[0], numbers[1], numbers[2]}; }

void check_bone(const RigDescription& rig, int index) {
  const BoneDescription& bone = rig.bones[index];
  const auto text = [&] { return bone_text(rig, index); };
  if (bone.parent < -1 || bone.parent >= index) {
    fail(text(), " is bone ", index, " and has parent ", bone.parent, "; expected -1 or a bone in front of it");
  }
  const auto check = [&](std::span<const float> numbers, const char* what) {
    if (!std::ranges::all_of(numbers, [](float number) { return std::isfinite(number); })) {
      check_finite(numbers, what + text());
    }
  };
  check(bone.rest, "the rest matrix of ");
  check(bone.rest_in_parent, "the rest matrix of ");
  check(bone.head, "the head of ");
  check(bone.head_in_armature, "the head of ");
  check(bone.tail_in_armature, "the tail of ");
  check({&bone.length, 1}, "the length of ");
  if (bone.segments < 1 || bone.segments > 32) {
    fail(text(), " has ", plural(bone.segments, "segment"), "; expected 1 to 32");
  }
  const int count = static_cast<int>(rig.bones.size());
  for (const int handle : {bone.handles[0], bone.handles[1], bone.connected_child}) {
    if (handle < -1 || handle >= count) {
      fail(text(), " has bone ", handle, " as a handle; expected -1 to ", count - 1);
    }
  }
}

Bend bend_of(const BoneDescription& bone, Program& program) {
  Bend bend;
  bend.segments = bone.segments;
  if (bone.segments == 1) return bend;
  bend.types = bone.handle_types;
  bend.handles = bone.handles;
  // The automatic handles are what the bone is connected to.
  if (bend.types[0] == HandleType::automatic) bend.handles[0] = bone.is_connected ? bone.parent : -1;
  if (bend.types[1] == HandleType::automatic) bend.handles[1] = bone.connected_child;
  bend.handles_scale = bone.handles_scale;
  bend.handles_ease = bone.handles_ease;
  bend.uses_end_roll = bone.uses_end_roll;
  bend.scales_ease = bone.scales_ease;
  bend.maps_curved = bone.maps_curved;
  bend.first = program.segment_count;
  bend.number = program.bendy_count++;
  program.segment_count += bone.segments + 1;
  return bend;
}

void add_bone(const RigDescription& rig, int index, Program& program) {
  check_bone(rig, index);
  const BoneDescription& given = rig.bones[index];
  Bone bone;
  bone.parent = given.parent;
  bone.values = program.map.first_of_bone(index);
  bone.rotation_mode = given.rotation_mode;
  bone.inherit_scale = given.inherit_scale;
  bone.inherits_rotation = given.inherits_rotation;
  bone.uses_local_location = given.uses_local_location;
  bone.is_connected = given.is_connected;
  bone.has_constraints = given.has_constraints;
  bone.deforms = given.deforms;
  bone.is_plain = given.inherits_rotation && given.inherit_scale == InheritScale::full;
  bone.length = given.length;
  bone.head = vector_of(given.head_in_armature);
  bone.tail = vector_of(given.tail_in_armature);
  bone.rest_in_parent = matrix3_of(given.rest_in_parent);
  bone.rest = matrix_of(given.rest);
  bone.inverse_rest = inverse(bone.rest);
  bone.offset = bone.rest;
  if (bone.parent >= 0) {
    bone.offset = widened(bone.rest_in_parent, vector_of(given.head));
    bone.offset[3][1] += rig.bones[bone.parent].length;
  }
  bone.bend = bend_of(given, program);
  program.bones.push_back(bone);
}

/// How many targets a constraint of this type has; -1 for any number.
int target_count(ConstraintType type) {
  switch (type) {
    case ConstraintType::armature:
      return -1;
    case ConstraintType::ik:
      return 2;
    case ConstraintType::limit_location:
    case ConstraintType::limit_rotation:
    case ConstraintType::limit_scale:
    case ConstraintType::maintain_volume:
    case ConstraintType::spline_ik:
      return 0;
    default:
      return 1;
  }
}

void add_constraint(const RigDescription& rig, int index, Program& program) {
  const ConstraintDescription& given = rig.constraints[index];
  const int bones = static_cast<int>(rig.bones.size());
  if (given.bone < 0 || given.bone >= bones) {
    fail("constraint \"", given.name, "\" is on bone ", given.bone, "; expected 0 to ", bones - 1);
  }
  if (index > 0 && rig.constraints[index - 1].bone > given.bone) {
    fail(constraint_text(rig, given), " comes after a constraint of bone ", rig.constraints[index - 1].bone,
         "; sort the constraints by bone");
  }
  const auto text = [&] { return constraint_text(rig, given); };
  const int expected = target_count(given.type);
  const int targets = static_cast<int>(given.targets.size());
  if (expected >= 0 && targets != expected) {
    fail(text(), " has ", plural(targets, "target"), "; expected ", expected);
  }
  if (given.weights.size() != (expected < 0 ? given.targets.size() : 0)) {
    fail(text(), " has ", plural(given.weights.size(), "weight"), " and ", plural(targets, "target"),
         "; only Armature constraints have weights, one for each target");
  }
  check_target(rig, given.space, text);
  for (const RigTarget& target : given.targets) check_target(rig, target, text);

  Constraint constraint;
  constraint.type = given.type;
  constraint.bone = given.bone;
  constraint.values = program.map.first_of_constraint(index);
  constraint.weights = program.map.first_weight(index);
  constraint.space = given.space;
  constraint.targets = given.targets;
  constraint.spline = given.spline;
  constraint.joints = given.joints;
  if (given.type == ConstraintType::spline_ik) {
    if (given.spline < 0 || given.spline >= static_cast<int>(rig.splines.size())) {
      fail(text(), " follows spline ", given.spline, "; the rig has ", rig.splines.size());
    }
    check_finite(given.joints, "the joints of " + text());
  }
  if (given.type == ConstraintType::armature) {
    constraint.first_binding = program.binding_count;
    program.binding_count += targets;
  }
  for (const ActionChannel& channel : given.action) {
    if (channel.value < 0 || channel.value >= kPoseBend) {
      fail(text(), " sets channel ", channel.value, "; expected 0 to ", kPoseBend - 1);
    }
    constraint.action.push_back({channel.value, FCurve(channel.curve)});
  }
  program.constraints.push_back(std::move(constraint));
}

bool moves_several_bones(ConstraintType type) {
  return type == ConstraintType::ik || type == ConstraintType::spline_ik;
}

/// Says of each bone which constraints act on it one after the other. IK acts on trees, Spline IK on chains.
void assign_constraints(Program& program) {
  std::stable_sort(
      program.constraints.begin(), program.constraints.end(), [](const Constraint& a, const Constraint& b) {
        const auto place = [](const Constraint& c) { return std::pair(c.bone, moves_several_bones(c.type)); };
        return place(a) < place(b);
      });
  for (std::size_t i = 0; i < program.constraints.size(); ++i) {
    const Constraint& constraint = program.constraints[i];
    Bone& bone = program.bones[constraint.bone];
    bone.has_constraints = true;
    if (moves_several_bones(constraint.type)) continue;
    if (bone.constraint_count++ == 0) bone.first_constraint = static_cast<int>(i);
  }
}

int place_of(const ValueMap& map, const ValuePath& value, const char* what) {
  const ValueMap::Found found = map.find(value.path);
  if (found.first < 0) {
    fail("a ", what, " sets ", value.path, ", which the rig does not have; remove it or describe the property");
  }
  if (value.index < 0 || value.index >= found.count) {
    fail("a ", what, " sets number ", value.index, " of ", value.path, ", which has ", found.count);
  }
  return found.first + value.index;
}

void add_object(const RigDescription& rig, int index, Program& program) {
  const ObjectDescription& given = rig.objects[index];
  const std::string text = "object \"" + given.name + "\"";
  const int matrices = static_cast<int>(rig.matrices.size());
  if (given.matrix < 0 || given.matrix >= matrices) {
    fail(text, " has matrix ", given.matrix, "; the rig has ", grouped(matrices));
  }
  if (given.parent < -1 || given.parent >= matrices) {
    fail(text, " has matrix ", given.parent, " as its parent; expected -1 to ", matrices - 1);
  }
  for (int other = 0; other < static_cast<int>(rig.objects.size()); ++other) {
    const int matrix = rig.objects[other].matrix;
    if (other < index && matrix == given.matrix) fail(text, " has the matrix of another object");
    if (other >= index && matrix == given.parent) fail(text, " comes before its parent; sort the objects");
  }
  check_finite(given.parent_inverse, "the parent inverse matrix of " + text);
  program.objects.push_back({program.map.first_of_object(index), given.matrix, given.parent,
                             matrix_of(given.parent_inverse), given.rotation_mode});
}

void add_spline(const RigDescription& rig, int index, Program& program) {
  const SplineDescription& given = rig.splines[index];
  const auto text = [&] { return "spline \"" + given.name + "\""; };
  const int matrices = static_cast<int>(rig.matrices.size());
  if (given.matrix < 0 || given.matrix >= matrices) {
    fail(text(), " has matrix ", given.matrix, "; the rig has ", grouped(matrices));
  }
  constexpr int kMostPoints = 10000;
  constexpr int kMostPieces = 1024;  // Blender's limit
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
  spline.is_poly = given.is_poly;
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

/// Finds the chains of Spline IK. Throws InputError for bones that several constraints would move together.
void add_chains(const RigDescription& rig, Program& program) {
  const std::vector<char> written = written_values(program);
  for (std::size_t i = 0; i < program.constraints.size(); ++i) {
    const Constraint& constraint = program.constraints[i];
    if (constraint.type != ConstraintType::spline_ik) continue;
    const auto initial = [&](int setting) { return program.map.values()[constraint.values + setting].initial; };
    const auto is_always = [&](int setting, bool wanted) {
      return !written[constraint.values + setting] && (initial(setting) != 0) == wanted;
    };
    if (is_always(kMuted, true) || is_always(kValid, false) || is_always(kInfluence, false)) continue;
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

/// owner: as above.
template <class Owner>
Variable variable_of(const RigDescription& rig, const VariableDescription& given, const ValueMap& map,
                     const Owner& owner) {
  const auto refuse_unknown = [&](const std::string& name) {
    fail(owner(), " reads ", name, ", which is not among the rig's values from outside; describe it there");
  };
  Variable variable;
  for (std::size_t i = 0; i < variable.targets.size(); ++i) {
    const VariableTarget& target = given.targets[i];
    variable.targets[i] = {target.target, target.channel, target.space, target.rotation, target.order};
  }
  switch (given.type) {
    case VariableType::property: {
      for (ReadTarget& target : variable.targets) target.target = {};
      if (!given.outside.empty()) {
        variable.value = map.find_outside(given.outside);
        if (variable.value < 0) refuse_unknown(given.outside);
        return variable;
      }
      variable.value = map.find_element(given.path);
      if (variable.value >= 0) return variable;
      constexpr std::string_view kLength = ".length";
      if (given.path.starts_with("pose.bones[") && given.path.ends_with(kLength)) {
        const ValueMap::Found bone = map.find(given.path.substr(0, given.path.size() - kLength.size()) + ".location");
        if (bone.first >= 0) {
          variable.type = Variable::Type::bone_length;
          variable.value = bone.first / kBoneValueCount;
          return variable;
        }
      }
      fail(owner(), " reads ", given.path, ", which the rig does not have; remove it or describe the property");
    }
    case VariableType::transform:
      variable.type = Variable::Type::transform;
      for (std::size_t i = 0; i < variable.angles.size(); ++i) {
        const std::string& angle = given.targets[0].angles[i];
        variable.angles[i] = map.find_outside(angle);
        if (variable.angles[i] < 0) variable.angles[i] = map.find_element(angle);
        if (variable.angles[i] < 0 && !angle.empty()) refuse_unknown(angle);
      }
      variable.targets[1].target = {};
      break;
    case VariableType::location_difference:
      variable.type = Variable::Type::location_difference;
      break;
    case VariableType::rotation_difference:
      variable.type = Variable::Type::rotation_difference;
      break;
  }
  for (const ReadTarget& target : variable.targets) check_target(rig, target.target, owner);
  return variable;
}

/// Builds a part whose errors do not say where they are. owner: as above.
template <class Owner, class Build>
auto named(const Owner& owner, const Build& build) {
  try {
    return build();
  } catch (const InputError& error) {
    fail(owner(), ": ", error.what());
  }
}

void add_driver(const RigDescription& rig, const DriverDescription& given, Program& program) {
  const int value = place_of(program.map, given.value, "driver");
  if (given.value.path.starts_with("objects[")) {
    fail("a driver sets ", given.value.path, ", which is not computed; use keyframes");
  }
  const auto owner = [&] { return "the driver of " + program.map.name(value); };
  std::vector<Variable> variables;
  for (const VariableDescription& variable : given.variables) {
    variables.push_back(variable_of(rig, variable, program.map, owner));
  }
  program.drivers.push_back({value, std::move(variables), named(owner, [&] { return Driver(given); })});
}

ProgramCurve curve_of(const AnimatedValue& given, const Program& program) {
  const int value = place_of(program.map, given.value, "curve");
  const ValueKind kind = program.map.values()[value].kind;
  const auto owner = [&] { return "the curve of " + program.map.name(value); };
  return {value, named(owner, [&] { return FCurve(given.curve, kind); })};
}

/// Refuses choices that are not known, as those of a newer Blender.
template <class Text>
void check_choices(const ConstraintDescription& constraint, const Text& text) {
  auto number = constraint.settings.begin();
  for (const RigSetting& setting : constraint_settings(constraint.type)) {
    if (setting.kind == ValueKind::choice && !(*number >= setting.low && *number <= setting.high)) {
      fail(text(), " has ", *number, " as ", setting.name, "; known are ", setting.low, " to ", setting.high);
    }
    number += setting.count;
  }
}

/// Refuses settings whose result does not follow from a frame alone, or that are not computed.
void check_settings(const RigDescription& rig, const Program& program) {
  const std::vector<char> written = written_values(program);
  for (std::size_t i = 0; i < rig.constraints.size(); ++i) {
    const ConstraintDescription& constraint = rig.constraints[i];
    const int values = program.map.first_of_constraint(static_cast<int>(i));
    const auto is_always = [&](int setting, bool wanted) {
      return !written[values + setting] && (constraint.settings[setting] != 0) == wanted;
    };
    if (is_always(kMuted, true) || is_always(kValid, false) || is_always(kInfluence, false)) continue;
    const auto text = [&] { return constraint_text(rig, constraint); };
    check_choices(constraint, text);
    const auto place = [&](std::string_view name) {
      int at = 0;
      for (const RigSetting& setting : constraint_settings(constraint.type)) {
        if (setting.name == name) break;
        at += setting.count;
      }
      return at;
    };
    const auto refuse_unless_off = [&](std::string_view setting, const char* reason) {
      if (!is_always(place(setting), false)) fail(text(), reason);
    };
    switch (constraint.type) {
      case ConstraintType::stretch_to:
        if (is_always(place("rest_length"), false)) {
          fail(text(), " has a rest length of 0, which Blender replaces at its first evaluation; press Reset there");
        }
        break;
      case ConstraintType::limit_distance:
        if (is_always(place("distance"), false)) {
          fail(text(), " has a distance of 0, which Blender replaces at its first evaluation; press Reset there");
        }
        break;
      case ConstraintType::armature:
        refuse_unless_off("use_bone_envelopes", " uses envelopes, which are not computed; switch them off");
        break;
      case ConstraintType::action:
        refuse_unless_off("use_bone_object_action", " plays the object's part of an action, which is not computed");
        break;
      case ConstraintType::ik:
        for (const char* setting : {"chain_count", "use_tail", "use_stretch"}) {
          if (written[values + place(setting)]) fail(text(), ": its ", setting, " is animated, which is not computed");
        }
        break;
      case ConstraintType::spline_ik:
        for (const char* setting : {"chain_count", "use_even_divisions"}) {
          if (written[values + place(setting)]) fail(text(), ": its ", setting, " is animated, which is not computed");
        }
        break;
      default:
        break;
    }
    if (constraint.targets.size() != 1) continue;
    const RigTarget& target = constraint.targets[0];
    const bool is_object =
        target.type == RigTarget::Type::outside || (target.type == RigTarget::Type::armature && !program.is_at_origin);
    const bool is_world = is_always(kTargetSpace, false) || constraint.settings[kTargetSpace] != 1;
    if (is_object && !is_world) {
      fail(text(), " reads an object in local space, which is not computed; choose world space");
    }
  }
}

/// Puts the drivers in the order in which they run, each with what it needs behind that of the one before: on a frame
/// they are not in the caches.
void store_in_order(Program& program) {
  std::vector<ProgramDriver> stored;
  stored.reserve(program.drivers.size());
  for (Operation& operation : program.order) {
    if (operation.type != Operation::Type::driver) continue;
    stored.push_back(program.drivers[operation.index]);
    operation.index = static_cast<int>(stored.size()) - 1;
  }
  program.drivers = std::move(stored);
}

void check_description(const RigDescription& rig) {
  if (!rig.refused.empty()) {
    const std::size_t others = rig.refused.size() - 1;
    fail(rig.refused.front(), others ? ", and " + plural(static_cast<long long>(others), "other reason") : "");
  }
  if (rig.blender < 402 || rig.blender >= 600) {
    fail("the rig is for version ", rig.blender, " of Blender; expected 402 (4.2) to 599");
  }
  check_finite(rig.world, "the armature's world matrix");
  for (const OutsideMatrix& matrix : rig.matrices) check_finite(matrix.matrix, "matrix \"" + matrix.name + "\"");
}

}  // namespace

void check_finite(std::span<const float> numbers, const std::string& what) {
  for (const float number : numbers) {
    if (!std::isfinite(number)) fail(what, " has ", number, " in it; expected finite numbers");
  }
}

Program build_program(const RigDescription& rig) {
  check_description(rig);
  Program program;
  program.blender = rig.blender;
  program.map = ValueMap(rig);
  program.world = matrix_of(rig.world);
  program.is_at_origin = program.world == kIdentity4;
  program.inverse_world = inverse(program.world);
  for (int i = 0; i < static_cast<int>(rig.bones.size()); ++i) add_bone(rig, i, program);
  for (int i = 0; i < static_cast<int>(rig.constraints.size()); ++i) add_constraint(rig, i, program);
  for (const OutsideMatrix& matrix : rig.matrices) program.outside.push_back(matrix_of(matrix.matrix));
  for (int i = 0; i < static_cast<int>(rig.objects.size()); ++i) add_object(rig, i, program);
  for (int i = 0; i < static_cast<int>(rig.splines.size()); ++i) add_spline(rig, i, program);
  for (const AnimatedValue& curve : rig.curves) program.curves.push_back(curve_of(curve, program));
  program.nla = build_nla(rig, program.map);
  for (const DriverDescription& driver : rig.drivers) add_driver(rig, driver, program);
  check_settings(rig, program);
  assign_constraints(program);
  program.trees = find_trees(program.bones, program.constraints, program.map);
  for (Tree& tree : program.trees) add_plans(program, tree);
  add_chains(rig, program);
  program.order = put_in_order(program);
  store_in_order(program);
  const std::vector<char> written = written_values(program);
  for (std::size_t i = 0; i < written.size(); ++i) {
    if (written[i]) program.written.push_back(static_cast<int>(i));
  }
  return program;
}

void replace_curve(const AnimatedValue& given, Program& program) {
  ProgramCurve curve = curve_of(given, program);
  const auto found = std::ranges::find(program.curves, curve.value, &ProgramCurve::value);
  if (found == program.curves.end()) fail(program.map.name(curve.value), " follows no curve; build the rig again");
  *found = std::move(curve);
}

}  // namespace sinew::rig
