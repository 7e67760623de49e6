#include "rig/bend.h"

#include <algorithm>
#include <cmath>

#include "rig/spaces.h"
#include "rig/spline.h"

namespace sinew::rig {
namespace {

/// Where bones are, at rest or in the pose.
class Stance {
 public:
  Stance(const Program& program, State& state, bool is_rest) : program_(program), state_(state), is_rest_(is_rest) {}

  bool is_rest() const { return is_rest_; }
  const Mat4& matrix(int bone) const { return is_rest_ ? program_.bones[bone].rest : state_.poses[bone]; }
  Vec3 head(int bone) const { return is_rest_ ? program_.bones[bone].head : state_.poses[bone].location(); }
  Vec3 tail(int bone) const { return is_rest_ ? program_.bones[bone].tail : state_.tails[bone]; }

  /// How far the bone has moved from its rest position.
  Vec3 movement(int bone) const { return state_.poses[bone].location() - program_.bones[bone].head; }
  Vec3 local_sizes(int bone) const { return local_sizes_of(program_, state_, bone); }

  /// A number of the B-bone's shape: the armature's, plus the pose's.
  float sum(const Bone& bone, int value) const {
    const float rest = state_.values[bone.values + kRestBend + value];
    return is_rest_ ? rest : rest + state_.values[bone.values + kPoseBend + value];
  }
  Vec3 scale(const Bone& bone, int value) const {
    Vec3 scale;
    for (int k = 0; k < 3; ++k) {
      scale[k] = state_.values[bone.values + kRestBend + value + k];
      if (!is_rest_) scale[k] *= state_.values[bone.values + kPoseBend + value + k];
    }
    return scale;
  }

 private:
  const Program& program_;
  State& state_;
  bool is_rest_;
};

/// The bone at one end, relative to the B-bone.
struct Handle {
  bool exists = false;
  bool is_bendy = false;  ///< then only its direction counts
  Vec3 point = {0, 0, 0};
  Mat4 matrix = kIdentity4;
  Vec3 sizes = {1, 1, 1};
};

Handle handle_at(const Program& program, const Stance& stance, int index, int end, const Mat4& into_bone) {
  const Bone& bone = program.bones[index];
  const Bend& bend = bone.bend;
  const int other = bend.handles[end];
  Handle handle;
  if (other < 0) return handle;
  handle.exists = true;
  const auto edge = [&](int of) { return end == 0 ? stance.head(of) : stance.tail(of); };
  switch (bend.types[end]) {
    case HandleType::relative:
      if (stance.is_rest()) {
        handle.point = {0, end == 0 ? 0 : bone.length, 0};
      } else {
        const Vec3 movement = stance.movement(other);
        const Vec3 own = edge(index);
        handle.point = transformed_point(into_bone, end == 0 ? own - movement : own + movement);
      }
      break;
    case HandleType::tangent: {
      const Vec3 along = stance.tail(other) - stance.head(other);
      const Vec3 own = edge(index);
      handle.point = transformed_point(into_bone, end == 0 ? own - along : own + along);
      break;
    }
    default:
      handle.is_bendy = program.bones[other].is_bendy();
      handle.point = transformed_point(into_bone, edge(other));
      break;
  }
  if (end == 0 && handle.is_bendy) return handle;
  handle.matrix = into_bone * stance.matrix(other);
  const auto& scales = bend.handles_scale[end];
  const bool takes_scale = scales[0] || scales[1] || scales[2] || bend.handles_ease[end];
  if (!stance.is_rest() && takes_scale) handle.sizes = stance.local_sizes(other);
  return handle;
}

/// The settings of one end, with what it takes from its handle.
struct EndSettings {
  float curve_x, curve_z, roll, ease;
  Vec3 scale;
};

EndSettings settings_of(const Stance& stance, const Bone& bone, int end, const Handle& handle) {
  const int out = end;  // the numbers of the end follow those of the start
  EndSettings settings{stance.sum(bone, kBendCurveInX + 2 * out), stance.sum(bone, kBendCurveInZ + 2 * out),
                       stance.sum(bone, kBendRollIn + out), stance.sum(bone, kBendEaseIn + out),
                       stance.scale(bone, out == 0 ? kBendScaleIn : kBendScaleOut)};
  const auto scale_ease = [&](float factor) {
    settings.ease *= factor;
    settings.curve_x *= factor;
    settings.curve_z *= factor;
  };
  if (bone.bend.scales_ease) scale_ease(settings.scale[1]);
  for (int k = 0; k < 3; ++k) {
    if (bone.bend.handles_scale[end][k]) settings.scale[k] *= handle.sizes[k];
  }
  if (bone.bend.handles_ease[end]) scale_ease(handle.sizes[1]);
  return settings;
}

/// A handle's direction, of unit length: of the start backwards, of the end forwards.
Vec3 handle_direction(const Handle& handle, int end, float length, float shortest) {
  const Vec3 straight = {0, end == 0 ? -1.0F : 1.0F, 0};
  if (!handle.exists) return straight;
  Vec3 vector = handle.point;
  if ((end == 0) == handle.is_bendy) vector[1] -= length;
  const Direction direction = normalized(vector);
  return direction.length < shortest ? straight : direction.unit;
}

void bend(const Program& program, State& state, int index, bool is_rest, std::span<Mat4> segments) {
  const Bone& bone = program.bones[index];
  const Stance stance(program, state, is_rest);
  float length = bone.length;

  UnevenScale uneven;
  Vec3 scale = {1, 1, 1};
  Mat4 own = stance.matrix(index);
  if (!is_rest) {
    const Vec3 sizes = sizes_of(own);
    uneven.is_uneven = std::fabs(sizes[0] - sizes[1]) > 1e-6F || std::fabs(sizes[1] - sizes[2]) > 1e-6F;
    if (uneven.is_uneven) {
      scale = sizes;
      normalize_columns(own);
      uneven.to_uneven = diagonal(scale);
      uneven.to_even = inverse(uneven.to_uneven);
    }
  }
  const Mat4 into_bone = inverse(own);
  const Handle start = handle_at(program, stance, index, 0, into_bone);
  const Handle end = handle_at(program, stance, index, 1, into_bone);

  const float shortest = static_cast<float>(1e-5 * length);
  if (uneven.is_uneven) length *= scale[1];
  // The start's direction is looked at from behind, which decides its roll.
  const Vec3 in = -handle_direction(start, 0, length, shortest);
  const Vec3 out = handle_direction(end, 1, length, shortest);
  const float arc = length * (handle_share(in, out) / 0.75F);

  EndSettings first = settings_of(stance, bone, 0, start);
  const EndSettings last = settings_of(stance, bone, 1, end);
  if (bone.bend.uses_end_roll && start.exists) {
    const int other = program.bones[bone.bend.handles[0]].values;
    first.roll += state.values[other + kRestBend + kBendRollOut];
    if (!is_rest) first.roll += state.values[other + kPoseBend + kBendRollOut];
  }

  SplineEnds ends{};
  ends.handles[0] = in * (first.ease * arc);
  ends.handles[1] = out * -(last.ease * arc);
  ends.handles[0][0] += first.curve_x * scale[0];
  ends.handles[0][2] += first.curve_z * scale[2];
  ends.handles[1][0] += last.curve_x * scale[0];
  ends.handles[1][2] += last.curve_z * scale[2];
  ends.rolls[0] = (start.exists && !start.is_bendy ? roll_about(upper(start.matrix), in) : 0) + first.roll;
  ends.rolls[1] = (end.exists ? roll_about(upper(end.matrix), out) : 0) + last.roll;
  ends.scales[0] = first.scale;
  ends.scales[1] = last.scale;
  bend_along(ends, length, uneven, segments);
}

/// The boundary planes of the curved mapping.
void find_planes(const Bone& bone, RestShape& shape) {
  const int pieces = bone.bend.segments;
  std::vector<Vec3> points(shape.segments.size());
  for (int i = 0; i <= pieces; ++i) {
    points[i] = transformed_point(bone.rest, shape.segments[i].location());
    shape.normals[i] = normalized(transformed_direction(bone.rest, shape.segments[i].axis(1))).unit;
    shape.offsets[i] = dot(points[i], shape.normals[i]);
  }
  float arc = 0;
  for (int i = 0; i < pieces; ++i) arc += length(points[i + 1] - points[i]);
  shape.inverse_length = 1.0F / arc;
  const int depth = static_cast<int>(std::ceil(std::log2(static_cast<float>(pieces + 2))));
  const float straight = length(points[0] - points[pieces]);
  const float share = static_cast<float>(pieces) * (straight / arc) * 0.222F;
  const float factor = std::pow(std::max(share, 1.0F), 1.0F / static_cast<float>(depth - 1));
  shape.slopes[0] = static_cast<float>(pieces) / share;
  for (std::size_t i = 1; i < shape.slopes.size(); ++i) shape.slopes[i] = shape.slopes[i - 1] * factor;
}

/// Computes the rest shape again if what it follows from has changed.
void update_rest_shape(const Program& program, State& state, int index) {
  const Bone& bone = program.bones[index];
  RestShape& shape = state.rest_shapes[bone.bend.number];
  std::array<float, kBendValueCount + 1> values;
  std::copy_n(state.values.data() + bone.values + kRestBend, kBendValueCount, values.data());
  const bool takes_roll = bone.bend.uses_end_roll && bone.bend.handles[0] >= 0;
  values.back() = takes_roll ? state.values[program.bones[bone.bend.handles[0]].values + kRestBend + kBendRollOut] : 0;
  if (shape.edition != 0 && shape.values == values) return;
  shape.values = values;
  ++shape.edition;
  bend(program, state, index, true, shape.segments);
  for (std::size_t i = 0; i < shape.segments.size(); ++i) {
    shape.inverses[i] = inverse(shape.segments[i]);
    shape.in_armature[i] = bone.rest * shape.segments[i];
  }
  if (bone.bend.maps_curved) find_planes(bone, shape);
}

/// How far along a bent rest shape a point is, 0 to 1. First the planes between which it lies are searched; then, from
/// the last plane looked at to the first, the share is bent near each of them, so that it is smooth across planes.
float curved_share(const RestShape& shape, int pieces, const Vec3& point) {
  std::array<float, 34> distances;
  std::array<int, 34> visited;
  int count = 0;
  int low = -1;
  int high = pieces + 1;
  int bias = 0;
  while (high - low > 1) {
    const int middle = (low + high + bias) / 2;
    distances[middle] = dot(shape.normals[middle], point) - shape.offsets[middle];
    visited[count++] = middle;
    const bool is_before = distances[middle] < 0;
    (is_before ? high : low) = middle;
    bias = is_before ? 1 : 0;
  }
  const float piece = 1.0F / static_cast<float>(pieces);
  float share = 0;
  if (high <= 0) {
    share = 0;
  } else if (low >= pieces) {
    share = 1;
  } else {
    const float to_low = std::fabs(distances[low]);
    const float to_high = std::fabs(distances[high]);
    share = piece * (static_cast<float>(low) + to_low / (to_low + to_high));
  }
  for (int i = count - 1; i >= 0; --i) {
    const float position = static_cast<float>(visited[i]) * piece;
    const float distance = distances[visited[i]] * shape.inverse_length;
    const float gap = std::fabs(share - position) - std::fabs(distance);
    if (gap <= 0) continue;
    const float closeness = 1.0F - std::fabs(distance) * shape.slopes[i];
    if (closeness <= 0) continue;
    const float wide = gap * 3.0F;
    const float far = wide / (wide + std::fabs(distance));
    const float near = closeness * closeness * (7.0F + 1.0F) / (7.0F * closeness + 1.0F);
    share = lerp(share, position + distance, far * near);
  }
  return share;
}

}  // namespace

Place place_along(int segments, float along) {
  const float scaled = (along > 0 ? std::min(along, 1.0F) : 0) * static_cast<float>(segments);  // 0 for NaN
  const int segment = std::clamp(static_cast<int>(std::floor(scaled)), 0, segments - 1);
  return {segment, clamped(scaled - static_cast<float>(segment), 0, 1)};
}

Place place_of_point(const Bone& bone, const RestShape& shape, const Vec3& point) {
  if (bone.bend.maps_curved) return place_along(bone.bend.segments, curved_share(shape, bone.bend.segments, point));
  return place_along(bone.bend.segments, transformed_point(bone.inverse_rest, point)[1] / bone.length);
}

void bend_bone(const Program& program, State& state, int index) {
  const Bend& shape = program.bones[index].bend;
  update_rest_shape(program, state, index);
  bend(program, state, index, false,
       {state.segments.data() + shape.first, static_cast<std::size_t>(shape.segments + 1)});
}

}  // namespace sinew::rig
