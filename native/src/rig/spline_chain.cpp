#include "rig/spline_chain.h"

#include <algorithm>
#include <cfloat>
#include <cmath>

#include "rig/channels.h"
#include "rig/constraints/bulge.h"
#include "rig/constraints/spline_ik.h"
#include "rig/kept_path.h"
#include "rig/rotation.h"
#include "rig/spaces.h"

namespace sinew::rig {
namespace {

/// The places of the axes if they are sorted by their numbers.
std::array<int, 3> sorted_axes(Vec3 numbers) {
  std::array<int, 3> axes = {0, 1, 2};
  const auto order = [&](int a, int b) {
    if (!(numbers[b] < numbers[a])) return;
    std::swap(numbers[a], numbers[b]);
    std::swap(axes[a], axes[b]);
  };
  if (numbers[0] < numbers[1]) {
    if (numbers[2] < numbers[0]) order(0, 2);
  } else {
    order(0, numbers[1] < numbers[2] ? 1 : 2);
  }
  if (numbers[2] < numbers[1]) order(1, 2);
  return axes;
}

/// Walks along the path, from the chain's root to its tip.
class Follower {
 public:
  Follower(const Program& program, State& state, const Chain& chain, const SplinePath& path)
      : program_(program),
        state_(state),
        chain_(chain),
        acting_(program, state, program.constraints[chain.constraint]),
        path_(path),
        influence_(acting_.number(kInfluence)),
        length_mode_(static_cast<LengthMode>(acting_.choice(kSplineLengthMode, 3))),
        width_mode_(static_cast<WidthMode>(acting_.choice(kSplineWidthMode, 4))),
        keeps_place_(acting_.flag(kSplineChainOffset)) {
    if (length_mode_ != LengthMode::fit_curve && chain.length != 0) curve_scale_ = chain.length / path_.length();
  }

  void pose(int number);

 private:
  /// Where a bone begins and ends on the path.
  struct Ends {
    Vec3 head;
    Vec3 tail;
    float radius = 1;
    float share = 0;  ///< of the influence: less if the bone reaches over the end of the path
  };

  Vec3 in_armature(const PathPlace& place, float& radius) const {
    Vec3 point = place.point;
    if (!keeps_place_) point = transformed_point(state_.outside[program_.splines[chain_.spline].matrix], point);
    radius = (place.radius + radius) / 2;
    return transformed_point(state_.inverse_world, point);
  }

  Ends ends_of(const Bone& bone, const Vec3& head, const Vec3& tail, int number, float pose_length);
  Mat3 turn_to(const Vec3& direction, const Vec3& axis, float share) const;
  void scale(Mat3& axes, const Mat4& before, float stretch, float pose_scale, float radius) const;

  const Program& program_;
  State& state_;
  const Chain& chain_;
  const Acting acting_;
  const SplinePath& path_;
  float influence_;
  LengthMode length_mode_;
  WidthMode width_mode_;
  bool keeps_place_;
  float curve_scale_ = 1;

  float position_ = 0;  // along the path
  PathPlace last_{{0, 0, 0}, 1};
  int last_piece_ = 0;
  Mat4 offset_ = kIdentity4;  // what the bones until now have been turned and moved by
};

Follower::Ends Follower::ends_of(const Bone& bone, const Vec3& head, const Vec3& tail, int number, float pose_length) {
  Ends ends{head, tail};
  const float share = chain_.joints[number] - chain_.joints[number + 1];
  const float start = position_;
  const float scale = length_mode_ == LengthMode::pose ? pose_length / bone.length : 1.0F;
  float end = start + share * scale * curve_scale_;
  position_ = end;
  if (!(start < 1.0F)) return ends;
  if (start == 0.0F) last_ = path_.at(start);
  ends.radius = last_.radius;
  ends.head = in_armature(last_, ends.radius);
  if (length_mode_ == LengthMode::fit_curve) {
    last_ = path_.at(end);
  } else {
    const float size = length_mode_ == LengthMode::pose ? pose_length : bone.length;
    last_piece_ = path_.leave_ball(PathPlace(last_).point, size, last_piece_, end, last_);
    position_ = end;
  }
  ends.tail = in_armature(last_, ends.radius);
  ends.share = end >= 1.0F ? (1.0F - start) / (end - start) : 1.0F;
  return ends;
}

/// The shortest rotation from a bone's unit axis to a unit direction.
Mat3 Follower::turn_to(const Vec3& direction, const Vec3& axis, float share) const {
  Direction turn = normalized(cross(axis, direction));
  if (turn.length < FLT_EPSILON) {
    Vec3 other = {0, 0, 0};
    other[sorted_axes(direction)[1]] = 1;
    turn.unit = cross(other, direction);
  }
  float angle = std::acos(clamped(dot(axis, direction), -1, 1));
  angle *= influence_ * share;
  const Direction about = normalized(turn.unit);
  return about.length == 0 ? kIdentity3 : axis_rotation(about.unit, angle);
}

void Follower::scale(Mat3& axes, const Mat4& before, float stretch, float pose_scale, float radius) const {
  const auto widen = [&](float x, float z) {
    axes[0] = axes[0] * x;
    axes[2] = axes[2] * z;
  };
  if (width_mode_ == WidthMode::pose || (width_mode_ != WidthMode::none && acting_.flag(kSplineOriginalScale))) {
    widen(length(before.axis(0)), length(before.axis(2)));
    stretch /= pose_scale;
  }
  const float size = std::fabs(stretch);
  if (width_mode_ == WidthMode::inverse) {
    const float width = size != 0 ? clamped(1.0F / size, 0.0001F, 100000.0F) : 1.0F;
    widen(width, width);
  } else if (width_mode_ == WidthMode::volume && size != 0) {
    const float bulge = std::pow(1.0F / size, acting_.number(kSplineBulge));
    const float width = std::sqrt(limited_bulge(acting_, kSplineBulgeLimits, bulge));
    widen(width, width);
  }
  if (acting_.flag(kSplineCurveRadius)) widen(radius, radius);
}

void Follower::pose(int number) {
  const int index = chain_.bones[number];
  const Bone& bone = program_.bones[index];
  Mat4& pose = state_.poses[index];
  if (bone.length < FLT_EPSILON) {
    float radius = 0;
    pose.set_location(in_armature(path_.at(position_), radius));
    state_.tails[index] = pose.location();
    return;
  }
  const Vec3 head = transformed_point(offset_, pose.location());
  const Vec3 tail = transformed_point(offset_, state_.tails[index]);
  const Vec3 unmoved_tail = state_.tails[index];
  const float pose_length = length(head - tail);
  Ends ends = ends_of(bone, head, tail, number, pose_length);

  const Vec3 way = ends.tail - ends.head;
  Mat3 base = upper(offset_) * upper(pose);
  const Mat3 unit = unit_columns(base);
  const Mat3 turn = turn_to(normalized(way).unit, unit[1], ends.share);
  Mat3 axes = unit_columns(turn * unit);
  base = turn * base;
  offset_ = rotated(turn, offset_);

  const float stretch = length(way) / bone.length;
  axes[1] = axes[1] * stretch;
  scale(axes, pose, stretch, pose_length / bone.length, ends.radius);
  for (int i = 0; i < 3; ++i) axes[i] = base[i] + (axes[i] - base[i]) * (influence_ * ends.share);

  if (keeps_place_ || (influence_ < 1 && number + 1 < static_cast<int>(chain_.bones.size()))) {
    ends.head = head;
  } else if (influence_ < 1) {
    ends.head = lerp(head, ends.head, influence_);
  }
  pose = widened(axes, ends.head);
  update_tail(program_, state_, index);
  offset_.set_location(state_.tails[index] - transformed_direction(offset_, unmoved_tail));
}

}  // namespace

void follow_spline(const Program& program, State& state, const Chain& chain) {
  const int count = static_cast<int>(chain.bones.size());
  for (int i = count - 1; i >= 0; --i) pose_bone(program, state, chain.bones[i]);
  const Acting acting(program, state, program.constraints[chain.constraint]);
  if (!acting.is_on() || !acting.flag(kValid) || acting.number(kInfluence) == 0) return;
  const SplinePath& path = path_of(program, state, chain.spline);
  if (!path.is_there()) return;
  Follower follower(program, state, chain, path);
  for (int i = count - 1; i >= 0; --i) follower.pose(i);
  // What it was before does not count any more.
  for (const int bone : chain.bones) {
    posed_parent(program, state, bone);
    state.lazy[bone] = {};
  }
}

}  // namespace sinew::rig
