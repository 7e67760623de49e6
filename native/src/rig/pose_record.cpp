#include "rig/pose_record.h"

#include <cstddef>
#include <cstring>

#include "base/check.h"
#include "rig/channels.h"
#include "rig/dual_quaternion.h"
#include "rig/eigen.h"

namespace sinew::rig {
namespace {

constexpr std::ptrdiff_t kMatrixSize = sizeof(Mat4);
constexpr std::ptrdiff_t kDualQuaternionSize = 25 * sizeof(float);
static_assert(kMatrixSize == 16 * sizeof(float));
static_assert(offsetof(DualQuaternion, scale_weight) == 24 * sizeof(float));

int count_of(const RecordField& field) {
  switch (field.part) {
    case RecordField::Part::channel_matrix:
    case RecordField::Part::pose_matrix:
      return 16;
    case RecordField::Part::head:
    case RecordField::Part::tail:
      return 3;
    case RecordField::Part::values:
      break;
  }
  return field.count;
}

class Writer {
 public:
  explicit Writer(std::byte* to) : to_(to) {}

  void put(const void* from, std::size_t size) {
    std::memcpy(to_, from, size);
    to_ += size;
  }
  void put(std::int32_t number) { put(&number, sizeof number); }
  void put(const Mat4& matrix) { put(&matrix, sizeof matrix); }
  void put(const Vec3& point) { put(&point, sizeof point); }
  void put(const DualQuaternion& quaternion) { put(&quaternion, kDualQuaternionSize); }

 private:
  std::byte* to_;
};

void put_field(const Program& program, State& state, int index, const RecordField& field, Writer& writer) {
  switch (field.part) {
    case RecordField::Part::channel_matrix:
      writer.put(channel_of(program, state, index));
      break;
    case RecordField::Part::pose_matrix:
      writer.put(state.poses[index]);
      break;
    case RecordField::Part::head:
      writer.put(state.poses[index].location());
      break;
    case RecordField::Part::tail:
      writer.put(state.tails[index]);
      break;
    case RecordField::Part::values:
      writer.put(state.values.data() + program.bones[index].values + field.first, field.count * sizeof(float));
      break;
  }
}

/// What moves vertices at the ends of a B-bone's segments.
class SegmentMotions {
 public:
  SegmentMotions(const Program& program, State& state, int index)
      : bone_(program.bones[index]),
        inverses_(state.rest_shapes[bone_.bend.number].inverses.data()),
        poses_(state.segments.data() + bone_.bend.first),
        base_(channel_of(program, state, index) * bone_.rest) {}

  Mat4 operator[](int end) const { return ((base_ * poses_[end]) * inverses_[end]) * bone_.inverse_rest; }

 private:
  const Bone& bone_;
  const Mat4* inverses_;
  const Mat4* poses_;
  Mat4 base_;
};

void put_segments(const Program& program, State& state, int index, Writer& writer) {
  const Bone& bone = program.bones[index];
  const RestShape& rest = state.rest_shapes[bone.bend.number];
  const Mat4* const poses = state.segments.data() + bone.bend.first;
  const SegmentMotions motions(program, state, index);
  const int ends = bone.bend.segments + 1;
  for (int end = 0; end < ends; ++end) writer.put(poses[end]);
  writer.put(bone.inverse_rest);
  for (int end = 0; end < ends; ++end) writer.put(motions[end]);
  for (int end = 0; end < ends; ++end) {
    Mat4 axes = rest.in_armature[end];
    normalize_columns(axes);
    writer.put(dual_quaternion_of(axes, motions[end]));
  }
}

}  // namespace

std::ptrdiff_t record_size(const Program& program, std::span<const RecordField> fields) {
  std::ptrdiff_t per_bone = kDualQuaternionSize;
  for (const RecordField& field : fields) {
    const bool has_values = field.part == RecordField::Part::values;
    if (has_values && (field.first < 0 || field.count < 1 || field.first > kBoneValueCount - field.count)) {
      fail("a field has ", field.count, " numbers from ", field.first, " on; a bone has ", int{kBoneValueCount});
    }
    per_bone += count_of(field) * static_cast<std::ptrdiff_t>(sizeof(float));
  }
  const auto bones = static_cast<std::ptrdiff_t>(program.bones.size());
  std::ptrdiff_t size = (bones + 1) * static_cast<std::ptrdiff_t>(sizeof(std::int32_t)) + bones * per_bone;
  for (const Bone& bone : program.bones) {
    if (!bone.is_bendy()) continue;
    const std::ptrdiff_t ends = bone.bend.segments + 1;
    size += ends * (2 * kMatrixSize + kDualQuaternionSize) + kMatrixSize;
  }
  return size;
}

void write_record(const Program& program, State& state, std::span<const RecordField> fields, std::byte* to) {
  Writer writer(to);
  const int count = static_cast<int>(program.bones.size());
  writer.put(count);
  for (const Bone& bone : program.bones) writer.put(bone.is_bendy() ? bone.bend.segments : 0);
  for (int index = 0; index < count; ++index) {
    for (const RecordField& field : fields) put_field(program, state, index, field, writer);
    const Bone& bone = program.bones[index];
    writer.put(bone.deforms ? dual_quaternion_of(bone.rest, channel_of(program, state, index)) : DualQuaternion());
    if (bone.is_bendy()) put_segments(program, state, index, writer);
  }
}

void write_motions(const Program& program, State& state, const MatrixStack<float>& out, std::ptrdiff_t frame) {
  std::ptrdiff_t joint = 0;
  const auto write = [&](const Mat4& motion) { out.at(frame, joint++) = eigen_of(motion); };
  for (int index = 0; index < static_cast<int>(program.bones.size()); ++index) {
    const Bone& bone = program.bones[index];
    if (!bone.is_bendy()) {
      write(channel_of(program, state, index));
      continue;
    }
    const SegmentMotions motions(program, state, index);
    for (int end = 0; end <= bone.bend.segments; ++end) write(motions[end]);
  }
}

}  // namespace sinew::rig
