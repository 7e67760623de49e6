/// A rig that was checked and put in order: what RigProgram runs. Immutable.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rig/driver.h"
#include "rig/fcurve.h"
#include "rig/matrix.h"
#include "rig/nla.h"
#include "rig/rotation.h"
#include "rig/value_map.h"
#include "sinew/rig_description.h"

namespace sinew::rig {

/// How a B-bone bends, and where its segments are in State::segments.
struct Bend {
  int segments = 1;
  int first = -1;                         ///< of its segments + 1 matrices
  std::array<int, 2> handles = {-1, -1};  ///< bones at its start and end, or -1
  std::array<HandleType, 2> types = {};
  std::array<std::array<bool, 3>, 2> handles_scale = {};  ///< see BoneDescription
  std::array<bool, 2> handles_ease = {};
  bool uses_end_roll = false;
  bool scales_ease = false;
  bool maps_curved = false;
  int number = -1;  ///< among the B-bones
};

struct Bone {
  int parent = -1;
  int values = 0;            ///< where its numbers begin
  int first_constraint = 0;  ///< of those that are not solved by IK
  int constraint_count = 0;
  bool deforms = true;
  bool has_constraints = false;  ///< of any type: its pose goes to the world and back, which rounds
  int tree = -1;                 ///< the bones that IK may join with it
  int chain = -1;                ///< the chain of Spline IK that it is in
  RotationMode rotation_mode = RotationMode::quaternion;
  InheritScale inherit_scale = InheritScale::full;
  bool inherits_rotation = true;
  bool uses_local_location = true;
  bool is_connected = false;
  bool is_plain = true;  ///< takes its parent's whole matrix
  float length = 0;
  Vec3 head = {};  ///< in armature space
  Vec3 tail = {};
  Mat3 rest_in_parent = kIdentity3;
  Mat4 rest = kIdentity4;
  Mat4 inverse_rest = kIdentity4;
  Mat4 offset = kIdentity4;  ///< the rest matrix relative to the parent's
  Bend bend;

  bool is_bendy() const { return bend.segments > 1; }
  bool has_euler() const { return rotation_mode >= RotationMode::xyz; }

  /// The order in which constraints take its rotation apart.
  EulerOrder order() const { return has_euler() ? static_cast<EulerOrder>(rotation_mode) : EulerOrder::xyz; }
};

/// The curves of an Action constraint, and the channels of the bone that they set.
struct ActionCurve {
  int channel = 0;
  FCurve curve;
};

struct Constraint {
  ConstraintType type = ConstraintType::copy_location;
  int bone = 0;
  int values = 0;         ///< where its settings begin
  int weights = 0;        ///< where its targets' weights begin
  int first_binding = 0;  ///< of an Armature constraint's targets, in State::bindings
  RigTarget space;
  std::vector<RigTarget> targets;
  std::vector<ActionCurve> action;
  int spline = -1;            ///< of Spline IK and Follow Path
  std::vector<float> joints;  ///< of Spline IK; see ConstraintDescription
};

/// What a variable reads of a target, see VariableTarget. Small: a rig may have thousands, which are not in the caches.
struct ReadTarget {
  RigTarget target;
  TransformChannel channel = TransformChannel::location_x;
  TransformSpace space = TransformSpace::world;
  ChannelRotation rotation = ChannelRotation::automatic;
  RotationMode order = RotationMode::quaternion;
};

struct Variable {
  enum class Type : std::uint8_t { value, bone_length, transform, location_difference, rotation_difference };
  Type type = Type::value;
  int value = -1;                            ///< the number or bone that it reads
  std::array<int, 3> angles = {-1, -1, -1};  ///< the numbers that VariableTarget::angles names
  std::array<ReadTarget, 2> targets;
};

struct ProgramDriver {
  int value = 0;  ///< the number that it sets
  std::vector<Variable> variables;
  Driver driver;
};

struct ProgramCurve {
  int value = 0;
  FCurve curve;
};

/// An object that curves move.
struct MovingObject {
  int values = 0;  ///< where its numbers begin
  int matrix = 0;  ///< in State::outside
  int parent = -1;
  int local = -1;
  int basis = -1;
  Mat4 parent_inverse = kIdentity4;
  RotationMode rotation_mode = RotationMode::xyz;
};

/// Bones that IK solves at once, parents first, and their goals.
struct IkPlan {
  std::vector<int> bones;        ///< of the rig
  std::vector<int> parents;      ///< of each bone, in the plan
  std::vector<int> tips;         ///< of each goal, in the plan
  std::vector<int> constraints;  ///< of each goal
  int iterations = 0;
  bool is_stretching = false;
};

/// Bones that IK may solve together, parents first, and the IK constraints among them.
struct Tree {
  std::vector<int> bones;
  std::vector<int> constraints;  ///< bone after bone
  std::vector<int> tips;         ///< of each constraint, the bone at which its chain ends
  std::vector<int> owners;       ///< of each bone that has some, where they end in `constraints`
  /// What is solved one after the other, for each combination of constraints that act: see ik_plan.h.
  std::vector<std::vector<IkPlan>> plans;
};

/// The chains of a tree that begin at the same bone.
struct Solve {
  int tree = 0;
  int root = 0;
  std::vector<int> bones;  ///< of these chains; of each, parents first
};

struct ShapeOfSpline {
  int value = 0;      ///< the number that says how much of it there is
  int relative = -1;  ///< see SplineKey
  std::vector<std::array<float, 10>> points;
};

/// A place on NURBS: the points from `first` on, in a circle, each with its share.
struct NurbsPlace {
  int first = 0;
  std::vector<float> shares;
};

/// A curve that Spline IK and Follow Path follow.
struct Spline {
  int matrix = 0;  ///< in State::outside
  SplineType type = SplineType::bezier;
  bool is_closed = false;
  int resolution = 1;
  int radii = 0;  ///< where its points' radii begin among the numbers
  RadiusInterpolation radius_interpolation = RadiusInterpolation::linear;
  std::vector<float> tilts;  ///< of its points
  RadiusInterpolation tilt_interpolation = RadiusInterpolation::linear;
  SplineTwist twist = SplineTwist::minimum;
  std::vector<NurbsPlace> places;  ///< along NURBS
  int time = -1;                   ///< the number that says where on the curve its followers are; -1 without one
  float duration = 1;              ///< the time at the end of the curve
  bool stays_within = false;
  std::vector<std::array<Vec3, 3>> points;
  std::vector<std::array<SplineHandle, 2>> handles;
  bool has_keys = false;  ///< also if all are muted
  std::vector<ShapeOfSpline> keys;
  std::vector<SplineHook> hooks;
};

/// Bones that Spline IK moves together.
struct Chain {
  int constraint = 0;
  int spline = 0;
  std::vector<int> bones;     ///< from the tip to the root
  std::vector<float> joints;  ///< where they are along the spline, from 1 on; one more than bones
  float length = 0;           ///< of all bones at rest
};

struct Operation {
  enum class Type : std::uint8_t { bone, driver, tree, segments, chain };
  Type type;
  int index;              ///< of a tree, in Program::solves
  int level = 0;          ///< how many trees come before it, one needing the other
  bool is_shown = false;  ///< segments on which no bone and no driver depends
};

struct Program {
  int blender = 502;
  Mat4 world = kIdentity4;  ///< the armature object's matrix
  int place = -1;           ///< what it is on each frame, in State::outside; -1 for one that stays
  ValueMap map;
  std::vector<Bone> bones;
  std::vector<Constraint> constraints;
  std::vector<ProgramDriver> drivers;
  std::vector<ProgramCurve> curves;
  Nla nla;
  std::vector<int> written;  ///< the numbers that curves, strips and drivers set
  std::vector<Mat4> outside;
  std::vector<MovingObject> objects;  ///< parents first
  std::vector<Tree> trees;
  std::vector<Solve> solves;
  std::vector<Spline> splines;
  std::vector<Chain> chains;
  std::vector<Operation> order;
  int segment_count = 0;
  int bendy_count = 0;
  int binding_count = 0;
};

/// The trees from an operation on that do not need each other; none if it is no tree.
inline std::span<const Operation> trees_from(const Program& program, std::size_t begin) {
  std::size_t end = begin;
  while (end < program.order.size() && program.order[end].type == Operation::Type::tree &&
         program.order[end].level == program.order[begin].level) {
    ++end;
  }
  return {program.order.data() + begin, end - begin};
}

/// Throws InputError, which begins with `what`.
void check_finite(std::span<const float> numbers, const std::string& what);

/// Checks a description and puts it in order. Throws InputError.
Program build_program(const RigDescription& description);

/// Gives a property that follows a curve another one. Throws InputError if it follows none.
void replace_curve(const AnimatedValue& given, Program& program);

}  // namespace sinew::rig
