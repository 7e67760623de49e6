#include "sinew/rig_program.h"

#include <algorithm>
#include <array>
#include <utility>

#include "base/check.h"
#include "base/parallel.h"
#include "rig/eigen.h"
#include "rig/pose_record.h"
#include "rig/program.h"
#include "rig/spaces.h"
#include "rig/state.h"
#include "sinew/threads.h"

namespace sinew {
namespace {

/// A state for a while.
class Borrowed {
 public:
  Borrowed(rig::States& states, const rig::Program& program) : states_(states), state_(states.borrow(program)) {}
  Borrowed(const Borrowed&) = delete;
  Borrowed& operator=(const Borrowed&) = delete;
  ~Borrowed() { states_.give_back(std::move(state_)); }

  rig::State& operator*() const { return *state_; }

 private:
  rig::States& states_;
  std::unique_ptr<rig::State> state_;
};

/// Has a clock measure what is done with a state, even if that throws.
class Timed {
 public:
  Timed(rig::State& state, rig::PartClock& clock) : state_(state) { state_.clock = &clock; }
  Timed(const Timed&) = delete;
  Timed& operator=(const Timed&) = delete;
  ~Timed() { state_.clock = nullptr; }

 private:
  rig::State& state_;
};

std::span<const float, 16> matrix_at(const GivenMatrix& given, std::ptrdiff_t frame) {
  return std::span<const float, 16>(given.numbers + frame * given.frame_stride, 16);
}

/// Puts what the caller gives for a frame into a state.
void take_inputs(const GivenInputs& given, const rig::Program& program, std::ptrdiff_t frame, rig::State& state) {
  for (const rig::GivenNumber& last : state.given) state.values[last.value] = state.base[last.value];
  state.given.clear();
  std::ranges::copy(program.outside, state.outside.begin());
  std::ranges::fill(state.is_given, 0);
  for (const GivenValues& values : given.values) {
    const float* numbers = values.numbers + frame * values.frame_stride;
    for (int i = 0; i < values.count; ++i) {
      const int place = values.first + i;
      const rig::ValueInfo& info = program.map.values()[place];
      state.given.push_back({place, rig::stored_value(info.kind, info.low, info.high, numbers[i])});
    }
  }
  for (const GivenMatrix& matrix : given.matrices) {
    state.outside[matrix.index] = rig::matrix_of(matrix_at(matrix, frame));
    state.is_given[matrix.index] = 1;
  }
}

void write_matrices(const std::vector<rig::Mat4>& matrices, const MatrixStack<float>& out, std::ptrdiff_t frame) {
  for (std::size_t i = 0; i < matrices.size(); ++i) {
    out.at(frame, static_cast<std::ptrdiff_t>(i)) = rig::eigen_of(matrices[i]);
  }
}

}  // namespace

void check_rig_size(std::size_t bones, std::size_t objects) {
  if (bones > kMostBones) fail("the rig has ", grouped(bones), " bones; expected at most ", grouped(kMostBones));
  if (objects > kMostObjects) {
    fail("the rig has ", grouped(objects), " objects; expected at most ", grouped(kMostObjects));
  }
}

RigProgram::RigProgram(const RigDescription& description)
    : program_(std::make_unique<const rig::Program>(rig::build_program(description))),
      states_(std::make_unique<rig::States>()) {
  for (const BoneDescription& bone : description.bones) {
    bone_names_.push_back(bone.name);
    parents_.push_back(bone.parent);
  }
  for (const OutsideMatrix& matrix : description.matrices) matrix_names_.push_back(matrix.name);
  segment_begin_.push_back(0);
  joint_begin_.push_back(0);
  for (const rig::Bone& bone : program_->bones) {
    const int ends = bone.is_bendy() ? bone.bend.segments + 1 : 0;
    segment_begin_.push_back(segment_begin_.back() + ends);
    joint_begin_.push_back(joint_begin_.back() + std::max(ends, 1));
  }
}

RigProgram::RigProgram(std::unique_ptr<const rig::Program> program, const RigProgram& like)
    : program_(std::move(program)),
      states_(std::make_unique<rig::States>()),
      bone_names_(like.bone_names_),
      matrix_names_(like.matrix_names_),
      parents_(like.parents_),
      segment_begin_(like.segment_begin_),
      joint_begin_(like.joint_begin_) {}

RigProgram RigProgram::edited(const GivenInputs& given, std::span<const AnimatedValue> curves) const {
  auto program = std::make_unique<rig::Program>(*program_);
  for (const GivenValues& values : given.values) {
    for (int place = values.first; place < values.first + values.count; ++place) {
      const float number = values.numbers[place - values.first];
      const std::string name = program->map.name(place);
      if (program->map.is_of_constraint(place)) {
        fail(name, " is a setting of a constraint; build the rig again");
      }
      rig::check_finite({&number, 1}, name);
      program->map.set_initial(place, number);
    }
  }
  for (const GivenMatrix& matrix : given.matrices) {
    const std::span<const float, 16> numbers = matrix_at(matrix, 0);
    const std::string name = "matrix \"" + matrix_names_[matrix.index] + "\"";
    rig::check_finite(numbers, name);
    if (std::ranges::find(program->objects, matrix.index, &rig::MovingObject::matrix) != program->objects.end()) {
      fail(name, " is that of an object that moves; set the object's channels instead");
    }
    program->outside[matrix.index] = rig::matrix_of(numbers);
  }
  for (const AnimatedValue& curve : curves) rig::replace_curve(curve, *program);
  return {std::move(program), *this};
}

RigProgram::RigProgram(RigProgram&&) noexcept = default;
RigProgram::~RigProgram() = default;

RigProgram::Place RigProgram::find_value(std::string_view path) const {
  const rig::ValueMap::Found found = program_->map.find(path);
  if (found.first >= 0) return {found.first, found.count};
  const int element = program_->map.find_element(path);
  const int place = element >= 0 ? element : program_->map.find_outside(path);
  if (place < 0) fail("the rig has no property ", path, "; expected a path such as pose.bones[\"Hand\"].location");
  return {place, 1};
}

std::vector<RigProgram::Property> RigProgram::properties() const {
  std::vector<Property> found;
  for (const auto& [path, place] : program_->map.properties()) found.push_back({path, {place.first, place.count}});
  return found;
}

std::vector<std::string> RigProgram::driven() const {
  std::vector<std::string> names;
  for (const rig::ProgramDriver& driver : program_->drivers) names.push_back(program_->map.name(driver.value));
  return names;
}

std::vector<std::string> RigProgram::keyed() const {
  std::vector<std::string> names;
  for (const rig::ProgramCurve& curve : program_->curves) names.push_back(program_->map.name(curve.value));
  for (const rig::MixedNumber& mixed : program_->nla.numbers) names.push_back(program_->map.name(mixed.value));
  return names;
}

Matrix4<float> RigProgram::rest(std::ptrdiff_t bone) const { return rig::eigen_of(program_->bones[bone].rest); }

void RigProgram::convert(const MatrixStack<const float>& poses, std::ptrdiff_t bone, BoneSpace from, BoneSpace to,
                         const MatrixStack<float>& out) const {
  using enum rig::Space;
  constexpr std::array kSpaces = {world, pose, local, local_with_parent};  // as BoneSpace numbers them
  const rig::Space start = kSpaces[static_cast<std::size_t>(from)];
  const rig::Space end = kSpaces[static_cast<std::size_t>(to)];
  if (program_->place >= 0 && (start == world || end == world)) {
    fail("the rig moves as a whole; its matrices cannot be converted from or to world space");
  }
  const Borrowed borrowed(*states_, *program_);
  rig::State& state = *borrowed;
  const auto pose_of = [&](std::ptrdiff_t frame, std::ptrdiff_t which) {
    const Matrix4<float> m = poses.at(frame, which);
    return rig::matrix_of(std::span<const float, 16>(m.data(), 16));
  };
  for (std::ptrdiff_t frame = 0; frame < out.frames; ++frame) {
    ++state.pass;
    if (parents_[bone] >= 0) state.poses[parents_[bone]] = pose_of(frame, parents_[bone]);
    const auto index = static_cast<int>(bone);
    rig::posed_parent(*program_, state, index);
    rig::Mat4 m = pose_of(frame, bone);
    if (start == world) m = rig::to_world(state, m);
    out.at(frame, 0) = rig::eigen_of(rig::converted(*program_, state, {index, -1, rig::kIdentity4}, m, start, end));
  }
}

int RigProgram::value_count() const { return static_cast<int>(program_->map.values().size()); }

float RigProgram::value(int place) const { return program_->map.values()[place].initial; }

std::ptrdiff_t RigProgram::record_size(std::span<const RecordField> fields) const {
  return rig::record_size(*program_, fields);
}

void RigProgram::evaluate(std::span<const float> frames, const GivenInputs& given, const RigOutputs& out) const {
  // Enough frames for each thread that starting it does not count.
  constexpr std::size_t kGrain = 4;
  const bool has_segments = out.segments || out.motions || out.records;
  parallel_for(frames.size(), std::max(kGrain, frames.size() / (8 * static_cast<std::size_t>(thread_count()) + 1)),
               [&](std::size_t begin, std::size_t end) {
                 const Borrowed borrowed(*states_, *program_);
                 rig::State& state = *borrowed;
                 for (std::size_t f = begin; f < end; ++f) {
                   const auto frame = static_cast<std::ptrdiff_t>(f);
                   take_inputs(given, *program_, frame, state);
                   rig::evaluate(*program_, state, frames[f], has_segments);
                   if (state.undefined_driver >= 0) {
                     fail("the driver of ", program_->map.name(program_->drivers[state.undefined_driver].value),
                          " divides by 0 or has no value on frame ", frames[f],
                          "; Blender switches such a driver off. Change its expression");
                   }
                   if (out.poses) write_matrices(state.poses, *out.poses, frame);
                   if (out.segments) write_matrices(state.segments, *out.segments, frame);
                   if (out.motions) rig::write_motions(*program_, state, *out.motions, frame);
                   for (std::size_t i = 0; i < out.values.size(); ++i) {
                     out.numbers[f * out.values.size() + i] = state.values[out.values[i]];
                   }
                   if (out.records) {
                     rig::write_record(*program_, state, out.records->fields,
                                       out.records->bytes + frame * out.records->frame_stride);
                   }
                 }
               });
}

std::array<double, kRigPartCount> RigProgram::profile(std::span<const float> frames, const GivenInputs& given) const {
  const Borrowed borrowed(*states_, *program_);
  rig::State& state = *borrowed;
  rig::PartClock clock;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    take_inputs(given, *program_, static_cast<std::ptrdiff_t>(f), state);
    const Timed timed(state, clock);
    rig::evaluate(*program_, state, frames[f], true);
  }
  return clock.seconds;
}

}  // namespace sinew
