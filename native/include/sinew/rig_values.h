/// The numbers of a rig that curves and drivers may set, and how each of them is stored.
///
/// A rig keeps its numbers in one array. First come the settings of each bone, kBoneValueCount of them; then those of
/// each constraint, in the order of its type's table; then the weights of an Armature constraint's targets; then custom
/// properties; then values from outside; then those of each object, kObjectValueCount of them. RigProgram::find_value
/// finds a number by Blender's path.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace sinew {

/// How Blender stores a number that is written to a property: real numbers are limited, whole ones cut and then limited,
/// booleans true from 1 on. Choices are Blender's numbers of an enumeration's items. Curves of whole numbers are rounded, those of booleans and choices are stepped.
enum class ValueKind : std::uint8_t { real, whole, boolean, choice };

/// A setting of a bone or a constraint: `count` consecutive numbers.
struct RigSetting {
  std::string_view name;  ///< Blender's name of the property
  int count = 1;
  ValueKind kind = ValueKind::real;
  float low = -3.4e38F;
  float high = 3.4e38F;
  float initial = 0;
};

/// A bone's settings. Those that begin at kArmatureValues or later belong to the armature's bone, and their paths begin
/// with data.bones.
std::span<const RigSetting> bone_settings();

/// An object's settings: its channels as those of a bone, up to kPoseBend, then its deltas in the same order.
std::span<const RigSetting> object_settings();

/// Where a bone's numbers begin.
enum BoneValue : int {
  kLocation = 0,
  kQuaternion = 3,
  kAxisAngle = 7,
  kEuler = 11,
  kScale = 14,
  kPoseBend = 17,  ///< in the order of kBend...
  kIk = 31,
  kIkStretch = kIk,
  kIkStiffness = kIk + 1,
  kIkLimits = kIk + 4,  ///< minimum and maximum of X, of Y, of Z
  kIkLocked = kIk + 10,
  kIkLimited = kIk + 13,
  kArmatureValues = 47,
  kRestBend = kArmatureValues,
  kBoneValueCount = 61,
};

inline constexpr int kObjectValueCount = 2 * kPoseBend;

/// The numbers of a B-bone's shape, from kPoseBend (of the pose) or kRestBend (of the armature's bone) on.
enum BendValue : int {
  kBendCurveInX = 0,
  kBendCurveInZ,
  kBendCurveOutX,
  kBendCurveOutZ,
  kBendRollIn,
  kBendRollOut,
  kBendEaseIn,
  kBendEaseOut,
  kBendScaleIn,
  kBendScaleOut = kBendScaleIn + 3,
  kBendValueCount = kBendScaleOut + 3,
};

/// The settings that every constraint has, before those of its type.
enum ConstraintValue : int {
  kInfluence = 0,
  kMuted,
  kValid,
  kOwnerSpace,
  kTargetSpace,
  kHeadTail,
  kAlongBend,  ///< use_bbone_shape
  kEnabled,    ///< the contrary of `mute`: one bit in Blender, so that one of the two at most may change
  kCommonValueCount,
};

}  // namespace sinew
