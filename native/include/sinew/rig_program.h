/// Blender's evaluation of an armature, without Blender.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sinew/rig_description.h"
#include "sinew/types.h"

namespace sinew {

namespace rig {
struct Program;
class States;
}  // namespace rig

/// Numbers of a rig that the caller gives instead of what the description holds. They replace curves; drivers replace
/// them.
struct GivenValues {
  int first = 0;  ///< see RigProgram::find_value
  int count = 1;
  const float* numbers = nullptr;
  std::ptrdiff_t frame_stride = 0;  ///< from frame to frame; 0 if they stay
};

/// World matrices from outside, column after column.
struct GivenMatrix {
  int index = 0;  ///< in RigDescription::matrices
  const float* numbers = nullptr;
  std::ptrdiff_t frame_stride = 0;
};

struct GivenInputs {
  std::vector<GivenValues> values;
  std::vector<GivenMatrix> matrices;
};

/// A part of what Blender's evaluation leaves in the memory of each bone.
struct RecordField {
  enum class Part : std::uint8_t {
    channel_matrix,  ///< pose relative to rest, 16 floats, column after column
    pose_matrix,     ///< in armature space, 16 floats
    head,            ///< 3 floats
    tail,            ///< 3 floats
    values,          ///< `count` of the bone's numbers from `first` on, see rig_values.h
  } part = Part::pose_matrix;
  int first = 0;
  int count = 0;
};

/// All that Blender's evaluation leaves in the memory of the bones, one frame after the other. A record is the number of
/// bones and the number of segments of each, 0 for those that are no B-bones, as 32-bit integers; then of each bone its
/// fields and a dual quaternion of 25 floats, all 0 if it does not deform; and of each B-bone with S segments S + 1 poses
/// of their ends and S + 2 matrices for deforming, 16 floats each, and S + 1 dual quaternions.
struct RigRecords {
  std::span<const RecordField> fields;
  std::byte* bytes = nullptr;       ///< of any alignment
  std::ptrdiff_t frame_stride = 0;  ///< in bytes; at least RigProgram::record_size(fields)
};

/// What an evaluation writes. Empty parts are not written.
struct RigOutputs {
  std::optional<MatrixStack<float>> poses;     ///< F x B: each bone in armature space
  std::optional<MatrixStack<float>> segments;  ///< F x S: see RigProgram::segment_begin
  std::optional<MatrixStack<float>> motions;   ///< F x J: see RigProgram::joint_begin
  std::span<const int> values = {};            ///< which numbers
  float* numbers = nullptr;                    ///< F x the count of `values`
  std::optional<RigRecords> records;           ///< F
};

/// Of those that Blender converts matrices of bones between.
enum class BoneSpace : std::uint8_t { world, pose, local, local_with_parent };

/// What the time of an evaluation is spent on. Bones include their constraints other than IK.
enum class RigPart : std::uint8_t { curves, drivers, bones, ik, segments };
inline constexpr int kRigPartCount = 5;

/// Immutable: any number of threads may evaluate it at the same time. With the same C library as Blender's, every number
/// has Blender's bits.
class RigProgram {
 public:
  /// Throws InputError, which names what is wrong or what is not covered: see docs/rigs.md.
  explicit RigProgram(const RigDescription& description);
  RigProgram(RigProgram&&) noexcept;

  /// Returns the same rig after an edit of its pose or its keys, without putting it in order again.
  ///
  /// given   what the description holds from now on, for all frames and as Blender stores it; curves replace it. Not for
  ///         settings of constraints.
  /// curves  replace those of the same properties
  /// Throws InputError for a setting of a constraint, a number that is not finite, and a property without a curve.
  RigProgram edited(const GivenInputs& given, std::span<const AnimatedValue> curves) const;
  ~RigProgram();

  std::ptrdiff_t bone_count() const { return static_cast<std::ptrdiff_t>(bone_names_.size()); }
  const std::vector<std::string>& bone_names() const { return bone_names_; }
  std::span<const std::int32_t> parents() const { return parents_; }

  /// Of B-bone b, segments segment_begin()[b] up to segment_begin()[b + 1] in RigOutputs::segments, one more than it is
  /// divided into, relative to the bone. Other bones have none.
  std::span<const std::int32_t> segment_begin() const { return segment_begin_; }

  /// What moves vertices from rest to pose, in armature space, is numbered as joints: of bone b, joint_begin()[b] up to
  /// joint_begin()[b + 1]. A B-bone has one for each end of a segment, another bone has one.
  std::span<const std::int32_t> joint_begin() const { return joint_begin_; }

  /// The rest matrix of a bone, in armature space.
  Matrix4<float> rest(std::ptrdiff_t bone) const;

  /// Converts the matrices of a bone as Blender does for constraints, which begin in world space, and for drivers.
  ///
  /// poses  F x B: each bone in armature space
  /// out    F x 1
  void convert(const MatrixStack<const float>& poses, std::ptrdiff_t bone, BoneSpace from, BoneSpace to,
               const MatrixStack<float>& out) const;

  /// How many numbers the rig has.
  int value_count() const;

  const std::vector<std::string>& matrix_names() const { return matrix_names_; }

  /// The place of a property's first number, and how many it has. Throws InputError for an unknown path.
  struct Place {
    int first = 0;
    int count = 0;
  };
  Place find_value(std::string_view path) const;

  /// All that find_value finds, apart from single numbers of several: settings of bones and constraints, custom
  /// properties, and values from outside.
  struct Property {
    std::string path;
    Place place;
  };
  std::vector<Property> properties() const;

  /// The numbers that drivers set, and those that curves set.
  std::vector<std::string> driven() const;
  std::vector<std::string> keyed() const;

  /// The value of a number in the description.
  float value(int place) const;

  /// The size of a record in bytes. Throws InputError for a field that bones do not have.
  std::ptrdiff_t record_size(std::span<const RecordField> fields) const;

  /// Evaluates frames, in parallel if there are several. Throws InputError if a driver divides by 0 or takes the root of
  /// a negative number, for which Blender switches it off.
  void evaluate(std::span<const float> frames, const GivenInputs& given, const RigOutputs& out) const;

  /// Evaluates frames on this thread and returns the seconds that each RigPart took, all frames together. Reading the
  /// clock makes them longer.
  std::array<double, kRigPartCount> profile(std::span<const float> frames, const GivenInputs& given) const;

 private:
  RigProgram(std::unique_ptr<const rig::Program> program, const RigProgram& like);

  std::unique_ptr<const rig::Program> program_;
  std::unique_ptr<rig::States> states_;
  std::vector<std::string> bone_names_;
  std::vector<std::string> matrix_names_;
  std::vector<std::int32_t> parents_;
  std::vector<std::int32_t> segment_begin_;
  std::vector<std::int32_t> joint_begin_;
};

}  // namespace sinew
