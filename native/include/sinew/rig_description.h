/// A rig as plain data: what is needed to compute the bones of an armature as Blender does. Nothing is checked here;
/// RigProgram does that once, when it is built.
///
/// Numbers that curves and drivers may set are named by Blender's paths, relative to the armature's object:
/// pose.bones["Hand"].location with index 2, or ["ik"]. Paths of the armature's data begin with "data.":
/// data.bones["Hand"].bbone_rollin, data["size"]. Matrices are column after column.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sinew/rig_values.h"

namespace sinew {

struct ValuePath {
  std::string path;
  int index = 0;
};

/// How the curve goes on after a key, numbered in the order of Blender's list.
enum class KeyInterpolation : std::uint8_t {
  constant,
  linear,
  bezier,
  sine,
  quadratic,
  cubic,
  quartic,
  quintic,
  exponential,
  circular,
  back,
  bounce,
  elastic,
};
enum class KeyEasing : std::uint8_t { automatic, in, out, in_out };

/// Points are frame and value.
struct CurveKey {
  float left[2] = {};  ///< handle
  float point[2] = {};
  float right[2] = {};  ///< handle
  float amplitude = 0;
  float period = 0;
  float back = 0;
  KeyInterpolation interpolation = KeyInterpolation::bezier;
  KeyEasing easing = KeyEasing::automatic;
};

enum class CycleMode : std::uint8_t { none, repeat, repeat_with_offset, mirror };

enum class CurveFunction : std::uint8_t { sine, cosine, tangent, square_root, natural_logarithm, normalized_sine };

/// Range that the Envelope has at a frame, in place of CurveModifier::envelope_low and _high.
struct EnvelopePoint {
  float frame = 0;
  float low = 0;
  float high = 0;
};

/// A modifier of a curve. Muted ones are left out.
struct CurveModifier {
  enum class Type : std::uint8_t { cycles, generator, function, envelope, limits, stepped } type = Type::cycles;
  CycleMode before = CycleMode::none;
  CycleMode after = CycleMode::none;
  int cycles_before = 0;  ///< 0: without end
  int cycles_after = 0;
  bool is_additive = false;         ///< Generator and function: adds to the curve instead of replacing it
  std::vector<float> coefficients;  ///< Generator: from the constant term on, or pairs a, b of factors a x + b
  bool is_factorised = false;

  /// amplitude * f(phase_multiplier * frame + phase_offset) + value_offset
  CurveFunction function = CurveFunction::sine;
  float amplitude = 1;
  float phase_multiplier = 1;
  float phase_offset = 0;
  float value_offset = 0;

  /// Envelope: the curve's range, relative to `reference` at its lower end, is taken to that of the points.
  float reference = 0;
  float envelope_low = -1;
  float envelope_high = 1;
  std::vector<EnvelopePoint> points;  ///< frames ascending; none: no effect

  std::optional<float> least_frame, most_frame, least_value, most_value;  ///< Limits

  float step = 2;  ///< Stepped: frames
  float step_offset = 0;
  std::optional<float> first_stepped, last_stepped;

  /// Of all but Cycles: how much of it there is, and the frames between which it acts.
  float influence = 1;
  bool has_range = false;
  float range_start = 0;
  float range_end = 0;
  float blend_in = 0;
  float blend_out = 0;
};

struct CurveDescription {
  std::vector<CurveKey> keys;  ///< frames ascending
  std::vector<CurveModifier> modifiers;
  bool is_extrapolated = false;  ///< linearly; otherwise the first and last values stay
  /// Not made by keying, which has Blender round the curves of whole numbers, and those of switches and choices step.
  bool is_free = false;
};

/// A value that follows a curve over time.
struct AnimatedValue {
  ValuePath value;
  CurveDescription curve;
};

enum class StripType : std::uint8_t { clip, transition, meta };
enum class StripBlend : std::uint8_t { replace, add, subtract, multiply, combine };
enum class StripExtrapolation : std::uint8_t { hold, hold_forward, nothing };

/// A strip of the NLA. Frames are the scene's unless they are an action's.
struct StripSettings {
  StripType type = StripType::clip;
  float start = 0;
  float end = 0;
  float action_start = 0;  ///< a frame of the action
  float action_end = 0;
  float scale = 1;
  float repeat = 1;
  float blend_in = 0;  ///< frames
  float blend_out = 0;
  StripBlend blend = StripBlend::replace;
  StripExtrapolation extrapolation = StripExtrapolation::hold;
  bool is_reversed = false;
  bool is_muted = false;           ///< what it would set counts as set all the same
  bool keeps_frames = false;       ///< plays the action on the scene's frames, as the active one above all tracks
  bool is_time_cyclic = false;     ///< `time` is taken modulo the action's length
  std::optional<float> influence;  ///< none: it follows from the frames of blending
  std::optional<float> time;       ///< of the action, or of a transition or meta strip 0 to 1; none: from the frame
  int action = -1;                 ///< of a clip: in RigDescription::actions
};

struct StripDescription : StripSettings {
  CurveDescription influence_curve;  ///< without keys: `influence` stays
  CurveDescription time_curve;
  std::vector<StripDescription> strips;  ///< of a meta strip
};

/// How Combine mixes a property.
enum class PropertyMix : std::uint8_t { add, multiply, quaternion };

/// A property that strips set.
struct MixedPropertyDescription {
  std::string path;
  PropertyMix mix = PropertyMix::add;
  std::vector<float> defaults;  ///< where no strip sets it; as many as the property has numbers
};

/// What a constraint or driver looks at.
struct RigTarget {
  enum class Type : std::uint8_t { none, bone, armature, outside } type = Type::none;
  int index = -1;  ///< of the bone, or in RigDescription::matrices
};

enum class RotationMode : signed char { axis_angle = -1, quaternion, xyz, xzy, yxz, yzx, zxy, zyx };
enum class InheritScale : std::uint8_t { full, fix_shear, aligned, average, none, none_legacy };
enum class HandleType : std::uint8_t { automatic, absolute, relative, tangent };

struct BoneDescription {
  std::string name;
  int parent = -1;
  std::array<float, 16> rest = {};             ///< Bone.matrix_local, in armature space
  std::array<float, 9> rest_in_parent = {};    ///< Bone.matrix
  std::array<float, 3> head = {};              ///< Bone.head, relative to the parent's tail
  std::array<float, 3> head_in_armature = {};  ///< Bone.head_local; not always the last column of `rest` to the bit
  std::array<float, 3> tail_in_armature = {};  ///< Bone.tail_local
  float length = 0;
  RotationMode rotation_mode = RotationMode::quaternion;
  InheritScale inherit_scale = InheritScale::full;
  bool inherits_rotation = true;
  bool uses_local_location = true;
  bool is_connected = false;
  bool deforms = true;           ///< Bone.use_deform; its record has a dual quaternion
  bool has_constraints = false;  ///< any, even if none is described: its pose goes to the world and back, which rounds

  int segments = 1;                                       ///< more than one make a B-bone
  std::array<HandleType, 2> handle_types = {};            ///< start, end
  std::array<int, 2> handles = {-1, -1};                  ///< bones; used unless the type is automatic
  int connected_child = -1;                               ///< the last connected one of Bone.children
  std::array<std::array<bool, 3>, 2> handles_scale = {};  ///< Bone.bbone_handle_use_scale_start and _end
  std::array<bool, 2> handles_ease = {};                  ///< Bone.bbone_handle_use_ease_start and _end
  bool uses_end_roll = false;                             ///< Bone.use_endroll_as_inroll
  bool scales_ease = false;                               ///< Bone.use_scale_easing
  bool maps_curved = false;                               ///< Bone.bbone_mapping_mode is CURVED

  std::array<float, kBoneValueCount> values = {};  ///< see rig_values.h
};

/// Blender's types of constraints that a rig may have.
enum class ConstraintType : std::uint8_t {
  copy_location,
  copy_rotation,
  copy_scale,
  copy_transforms,
  limit_location,
  limit_rotation,
  limit_scale,
  limit_distance,
  maintain_volume,
  transformation,
  damped_track,
  locked_track,
  stretch_to,
  track_to,
  armature,
  child_of,
  floor,
  pivot,
  action,
  ik,
  spline_ik,
  follow_path,
};
inline constexpr int kConstraintTypeCount = static_cast<int>(ConstraintType::follow_path) + 1;

/// A bone's channel that an Action constraint's action sets.
struct ActionChannel {
  int value = kLocation;  ///< one of kLocation to kScale + 2
  CurveDescription curve;
};

struct ConstraintDescription {
  int bone = 0;
  std::string name;
  ConstraintType type = ConstraintType::copy_location;
  std::vector<float> settings;     ///< in the order of constraint_settings(type)
  std::vector<RigTarget> targets;  ///< one; Armature constraints have any number, IK a second one, the pole
  std::vector<float> weights;      ///< of an Armature constraint's targets
  RigTarget space;                 ///< the object or bone of the space CUSTOM
  std::vector<ActionChannel> action;
  int spline = -1;            ///< of Spline IK and Follow Path: in RigDescription::splines
  std::vector<float> joints;  ///< of Spline IK: SplineIKConstraint.joint_bindings; empty if Blender divides the spline
};

/// A number that drivers may read and curves may set, and which is no setting of a bone or constraint.
struct CustomProperty {
  std::string path;
  int count = 1;
  ValueKind kind = ValueKind::real;
  float low = -3.4e38F;
  float high = 3.4e38F;
  std::vector<float> values;
};

/// A property of another data-block. Drivers read it by name.
struct OutsideValue {
  std::string name;
  float value = 0;
};

/// The world matrix of another object, or of a bone of another armature.
struct OutsideMatrix {
  std::string name;
  std::array<float, 16> matrix = {};
};

/// Another object that curves move. Its numbers have paths such as objects["Aim"].location.
struct ObjectDescription {
  std::string name;
  int matrix = -1;  ///< in RigDescription::matrices, where it puts its world matrix
  int parent = -1;  ///< the matrix there that it is a child of, or -1; that of an object has to be one in front of it
  int local = -1;   ///< where it puts its matrix in Blender's local space of objects, or -1
  int basis = -1;   ///< where it puts what its own channels say, or -1
  std::array<float, 16> parent_inverse = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  RotationMode rotation_mode = RotationMode::xyz;
  std::array<float, kObjectValueCount> values = {};  ///< in the order of object_settings()
};

enum class SplineHandle : std::uint8_t { free, automatic, vector, aligned };
enum class RadiusInterpolation : std::uint8_t { linear, cardinal, bspline, ease };
/// How what follows a spline is turned from one point to the next.
enum class SplineTwist : std::uint8_t { minimum, z_up };

/// A Hook modifier that moves points of a spline with a bone or an object.
struct SplineHook {
  RigTarget target;
  std::array<float, 16> inverse = {};  ///< HookModifier.matrix_inverse
  float strength = 1;
  std::vector<int> points;  ///< 3 * point + 0 for its left handle, 1 for itself, 2 for its right handle
};

/// A shape key of a spline that is not its Basis.
struct SplineKey {
  std::string value;  ///< path of a property with one number
  int relative = -1;  ///< the key that it is relative to, among those of the spline, or -1 for the spline's own points
  std::vector<std::array<float, 10>> points;  ///< left handle, point, right handle, radius
};

enum class SplineType : std::uint8_t { bezier, poly, nurbs };

/// The first spline of a curve object that Spline IK or Follow Path follows, in three dimensions.
struct SplineDescription {
  std::string name;
  int matrix = -1;  ///< in RigDescription::matrices: of the curve object
  SplineType type = SplineType::bezier;
  bool is_closed = false;                            ///< only Follow Path follows such a one
  int resolution = 12;                               ///< segments between two points
  std::vector<std::array<float, 9>> points;          ///< left handle, point, right handle; in the object's space
  std::vector<std::array<SplineHandle, 2>> handles;  ///< of each point; hooks have Blender place some again
  std::string radii;                                 ///< path of a property with a number for each point
  RadiusInterpolation radius_interpolation = RadiusInterpolation::linear;
  std::vector<float> tilts;    ///< of each point; empty: none
  std::vector<float> weights;  ///< of each point of NURBS; empty: 1
  int order = 4;               ///< of NURBS
  bool reaches_ends = false;   ///< open NURBS begin and end at their first and last point; closed ones are as circles
  RadiusInterpolation tilt_interpolation = RadiusInterpolation::linear;
  SplineTwist twist = SplineTwist::minimum;
  std::string time;          ///< path of a property with one number: Curve.eval_time
  int duration = 100;        ///< Curve.path_duration
  bool stays_within = true;  ///< Curve.use_path_clamp
  bool has_keys = false;     ///< shape keys, also if none but the Basis counts: Blender places handles again
  std::vector<SplineKey> keys;
  std::vector<SplineHook> hooks;  ///< in the order of the modifiers
};

enum class DriverType : std::uint8_t { average, scripted, sum, minimum, maximum };
enum class VariableType : std::uint8_t { property, transform, location_difference, rotation_difference };
enum class TransformChannel : std::uint8_t {
  location_x,
  location_y,
  location_z,
  rotation_x,
  rotation_y,
  rotation_z,
  scale_x,
  scale_y,
  scale_z,
  scale_average,
  rotation_w,
};
enum class TransformSpace : std::uint8_t { world, transform, local };
/// How a transform variable reads a rotation; numbered as in Blender.
enum class ChannelRotation : std::uint8_t {
  automatic,
  xyz,
  xzy,
  yxz,
  yzx,
  zxy,
  zyx,
  quaternion,
  swing_twist_x,
  swing_twist_y,
  swing_twist_z,
};

struct VariableTarget {
  RigTarget target;  ///< unless the variable reads a property
  TransformChannel channel = TransformChannel::location_x;
  TransformSpace space = TransformSpace::world;
  ChannelRotation rotation = ChannelRotation::automatic;
  /// How what is outside stores its rotation, of which automatic angles are those nearest to the stored ones.
  RotationMode order = RotationMode::quaternion;
  std::array<std::string, 3> angles = {};  ///< OutsideValues or paths: its Euler angles, if it stores some
};

struct VariableDescription {
  std::string name;
  VariableType type = VariableType::property;
  std::string path;     ///< a property's: of the rig, as in ValuePath but with the index in it, as Blender writes it
  std::string outside;  ///< or the name of an OutsideValue
  std::array<VariableTarget, 2> targets;
};

struct DriverDescription {
  ValuePath value;
  DriverType type = DriverType::scripted;
  std::string expression;
  std::vector<VariableDescription> variables;
  CurveDescription curve;
};

/// Of the whole armature. What Blender ignores, such as muted curves and drivers, is left out.
struct RigDescription {
  std::string name;
  int blender = 502;  ///< whose rules: 100 * major + minor of the version
  std::array<float, 16> world = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};  ///< the armature object's matrix
  int place = -1;                                  ///< the matrix that it is on each frame, in place of `world`, or -1
  std::vector<BoneDescription> bones;              ///< in the order of the pose: parents before children
  std::vector<ConstraintDescription> constraints;  ///< bone after bone, each bone's in their order
  std::vector<CustomProperty> properties;
  std::vector<OutsideValue> values;
  std::vector<OutsideMatrix> matrices;
  std::vector<ObjectDescription> objects;
  std::vector<SplineDescription> splines;
  std::vector<AnimatedValue> curves;
  /// The NLA, instead of the curves of the object: tracks of strips, the lowest first, and what they play.
  std::vector<std::vector<AnimatedValue>> actions;
  std::vector<std::vector<StripDescription>> tracks;
  std::vector<MixedPropertyDescription> mixed;  ///< all that they set
  std::vector<DriverDescription> drivers;
  std::vector<std::string> refused;  ///< what the description cannot say, each as a reason; a program is then refused
};

/// A rig has at most this many bones, and as many objects.
inline constexpr std::size_t kMostBones = 65'536;
inline constexpr std::size_t kMostObjects = 65'536;

/// Throws InputError for more than that. Call it before a description of that size is made.
void check_rig_size(std::size_t bones, std::size_t objects);

/// The settings of a type of constraint.
std::span<const RigSetting> constraint_settings(ConstraintType type);

/// Blender's name of the type, such as COPY_LOCATION.
std::string_view constraint_name(ConstraintType type);

}  // namespace sinew
