#include "rig/build.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/check.h"
#include "rig/constraints/constraint.h"
#include "rig/ik_plan.h"
#include "rig/order.h"
#include "rig/program.h"

namespace sinew::rig {
namespace {

std::string constraint_text(const RigDescription& rig, const ConstraintDescription& constraint) {
  return std::string(constraint_name(constraint.type)) + " \"" + constraint.name + "\" of " +
         bone_text(rig, constraint.bone);
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
    case ConstraintType::follow_path:
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
    if (rig.splines[given.spline].is_closed) {
      fail(text(), " follows the closed spline \"", rig.splines[given.spline].name,
           "\", which is not computed; open it");
    }
  }
  if (given.type == ConstraintType::follow_path && given.spline >= static_cast<int>(rig.splines.size())) {
    fail(text(), " follows spline ", given.spline, "; the rig has ", rig.splines.size());
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

/// Of each matrix, the first object that puts its world matrix there, or -1.
std::vector<int> owners_of_matrices(const RigDescription& rig) {
  std::vector<int> owners(rig.matrices.size(), -1);
  for (std::size_t i = 0; i < rig.objects.size(); ++i) {
    const int matrix = rig.objects[i].matrix;
    if (matrix >= 0 && matrix < std::ssize(owners) && owners[matrix] < 0) owners[matrix] = static_cast<int>(i);
  }
  return owners;
}

void add_object(const RigDescription& rig, int index, std::span<const int> owners, Program& program) {
  const ObjectDescription& given = rig.objects[index];
  const std::string text = "object \"" + given.name + "\"";
  const int matrices = static_cast<int>(rig.matrices.size());
  if (given.matrix < 0 || given.matrix >= matrices) {
    fail(text, " has matrix ", given.matrix, "; the rig has ", grouped(matrices));
  }
  if (given.parent < -1 || given.parent >= matrices) {
    fail(text, " has matrix ", given.parent, " as its parent; expected -1 to ", matrices - 1);
  }
  for (const int own : {given.local, given.basis}) {
    if (own < -1 || own >= matrices) fail(text, " has matrix ", own, "; expected -1 to ", matrices - 1);
  }
  const auto object_of = [&](int matrix) { return matrix < 0 ? -1 : owners[matrix]; };
  if (object_of(given.local) >= 0 || object_of(given.basis) >= 0) {
    fail(text, " has the matrix of an object in another space");
  }
  if (object_of(given.matrix) != index) fail(text, " has the matrix of another object");
  if (object_of(given.parent) >= index) fail(text, " comes before its parent; sort the objects");
  check_finite(given.parent_inverse, "the parent inverse matrix of " + text);
  program.objects.push_back({program.map.first_of_object(index), given.matrix, given.parent, given.local, given.basis,
                             matrix_of(given.parent_inverse), given.rotation_mode});
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
  const bool is_at_origin = program.place < 0 && program.world == kIdentity4;
  for (std::size_t i = 0; i < rig.constraints.size(); ++i) {
    const ConstraintDescription& constraint = rig.constraints[i];
    const int values = program.map.first_of_constraint(static_cast<int>(i));
    if (!may_act(program, written, values)) continue;
    const auto is_always_off = [&](int setting) { return stays(program, written, values + setting, false); };
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
      if (!is_always_off(place(setting))) fail(text(), reason);
    };
    const bool has_target = !constraint.targets.empty() && constraint.targets[0].type != RigTarget::Type::none;
    switch (constraint.type) {
      case ConstraintType::stretch_to:
        if (has_target && is_always_off(place("rest_length"))) {
          fail(text(),
               " has a rest length of 0, which Blender replaces when it first acts; show a frame on which it does");
        }
        break;
      case ConstraintType::limit_distance:
        if (has_target && is_always_off(place("distance"))) {
          fail(text(),
               " has a distance of 0, which Blender replaces when it first acts; show a frame on which it does");
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
        target.type == RigTarget::Type::outside || (target.type == RigTarget::Type::armature && !is_at_origin);
    const bool is_world = is_always_off(kTargetSpace) || constraint.settings[kTargetSpace] != 1;
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
  check_rig_size(rig.bones.size(), rig.objects.size());
  if (!rig.refused.empty()) {
    const std::size_t others = rig.refused.size() - 1;
    fail(rig.refused.front(), others ? ", and " + plural(static_cast<long long>(others), "other reason") : "");
  }
  if (rig.blender < 402 || rig.blender >= 600) {
    fail("the rig is for version ", rig.blender, " of Blender; expected 402 (4.2) to 599");
  }
  check_finite(rig.world, "the armature's world matrix");
  const int matrices = static_cast<int>(rig.matrices.size());
  if (rig.place < -1 || rig.place >= matrices) {
    fail("the armature's object has matrix ", rig.place, "; expected -1 to ", matrices - 1);
  }
  for (const OutsideMatrix& matrix : rig.matrices) check_finite(matrix.matrix, "matrix \"" + matrix.name + "\"");
}

}  // namespace

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
  program.place = rig.place;
  for (int i = 0; i < static_cast<int>(rig.bones.size()); ++i) add_bone(rig, i, program);
  for (int i = 0; i < static_cast<int>(rig.constraints.size()); ++i) add_constraint(rig, i, program);
  for (const OutsideMatrix& matrix : rig.matrices) program.outside.push_back(matrix_of(matrix.matrix));
  const std::vector<int> owners = owners_of_matrices(rig);
  for (int i = 0; i < static_cast<int>(rig.objects.size()); ++i) add_object(rig, i, owners, program);
  for (int i = 0; i < static_cast<int>(rig.splines.size()); ++i) add_spline(rig, i, program);
  for (const AnimatedValue& curve : rig.curves) program.curves.push_back(curve_of(curve, program));
  program.nla = build_nla(rig, program.map);
  for (const DriverDescription& driver : rig.drivers) add_driver(rig, driver, program);
  check_settings(rig, program);
  assign_constraints(program);
  program.trees = find_trees(program.bones, program.constraints, program.map);
  for (Tree& tree : program.trees) add_plans(program, tree);
  program.solves = find_solves(program);
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
