/// What all types of constraints share, and the table of them. Each type is in a file of its own, which has its
/// settings and its formula.
#pragma once

#include <optional>
#include <span>
#include <string_view>

#include "rig/spaces.h"
#include "rig/state.h"

namespace sinew::rig {

/// A constraint at work on its bone.
class Acting {
 public:
  Acting(const Program& program, State& state, const Constraint& constraint)
      : program_(program), state_(state), constraint_(constraint) {}

  const Program& program() const { return program_; }
  State& state() const { return state_; }
  const Constraint& constraint() const { return constraint_; }
  const Bone& bone() const { return program_.bones[constraint_.bone]; }

  /// A setting: one of ConstraintValue, or of the type's own numbers, which begin at kCommonValueCount.
  float number(int setting) const { return state_.values[constraint_.values + setting]; }
  bool flag(int setting) const { return number(setting) != 0; }
  bool flag(int setting, int axis) const { return flag(setting + axis); }

  /// Whether it is switched on, by both of its switches.
  bool is_on() const { return !flag(kMuted) && flag(kEnabled); }

  /// An enumeration's item, made one of 0 to count - 1.
  int choice(int setting, int count) const {
    const float chosen = number(setting);
    if (!(chosen >= 0)) return 0;  // NaN too
    return chosen >= static_cast<float>(count) ? count - 1 : static_cast<int>(chosen);
  }

  Vec3 vector(int setting) const { return {number(setting), number(setting + 1), number(setting + 2)}; }

  /// The order of an `euler_order` setting; 0 stands for the bone's own.
  EulerOrder order(int setting) const {
    const int chosen = choice(setting, 7);
    return chosen == 0 ? bone().order() : static_cast<EulerOrder>(chosen);
  }

  Space owner_space() const { return space_of(number(kOwnerSpace)); }
  Space target_space() const { return space_of(number(kTargetSpace)); }

  /// The matrix of the constraint's custom space.
  Mat4 custom_space() const;

  /// The matrix of a target in the target space, or nothing without a target.
  ///
  /// is_whole  of a B-bone the constraint wants the rotation along it too, not only the location.
  std::optional<Mat4> target(bool is_whole = false) const;

  /// A target's world matrix.
  std::optional<Mat4> target_in_world(int number, bool is_whole = false) const;

 private:
  const Program& program_;
  State& state_;
  const Constraint& constraint_;
};

/// A type of constraint.
struct ConstraintKind {
  std::string_view name;
  std::span<const RigSetting> settings;  ///< those that all have, then its own

  /// Changes the owner's matrix, which is in the owner space. Null for IK and Spline IK, which move several bones at
  /// once.
  void (*apply)(const Acting& acting, Mat4& owner);

  /// The owner's matrix is not taken back to the world after it.
  bool leaves_space = false;
};

const ConstraintKind& kind_of(ConstraintType type);

/// All types, by ConstraintType.
std::span<const ConstraintKind* const> constraint_kinds();

/// Lets a constraint act on its bone's world matrix.
void apply_constraint(const Program& program, State& state, const Constraint& constraint, Mat4& world);

// The kinds' table entries, one from each file.
extern const ConstraintKind kCopyLocation, kCopyRotation, kCopyScale, kCopyTransforms, kLimitLocation, kLimitRotation,
    kLimitScale, kLimitDistance, kMaintainVolume, kTransformation, kDampedTrack, kLockedTrack, kStretchTo, kTrackTo,
    kArmature, kChildOf, kFloor, kPivot, kAction, kIkConstraint, kSplineIk, kFollowPath;

}  // namespace sinew::rig
