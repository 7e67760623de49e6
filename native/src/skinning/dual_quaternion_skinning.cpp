#include "skinning/dual_quaternion_skinning.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/per_thread.h"
#include "skinning/sum_rotations.h"

namespace sinew {
namespace {

using Rows = Eigen::Matrix<float, 3, 4, Eigen::RowMajor>;
using DualRows = Eigen::Matrix<float, 4, 4, Eigen::RowMajor>;
using Parts = Eigen::Map<const Eigen::Vector4f>;

/// Applies summed dual quaternions to a point as in Kavan 2008, algorithm 1, with parts that are not yet normalised.
Eigen::Vector3f applied(const Eigen::Vector4f& real, const Eigen::Vector4f& dual, const Eigen::Vector3f& point) {
  const float norm2 = real.squaredNorm();
  // Opposite rotations cancel, or weights are nearly 0: no direction is right.
  if (norm2 < std::numeric_limits<float>::min()) return point;
  const Eigen::Vector3f r = real.tail<3>(), d = dual.tail<3>();
  const Eigen::Vector3f rotated = point + 2 / norm2 * r.cross(Eigen::Vector3f(r.cross(point) + real[0] * point));
  return rotated + 2 / norm2 * (real[0] * d - dual[0] * r + r.cross(d));
}

/// Moves a vertex that each joint stretches by itself. Their contributions to the dual part are summed first and
/// applied to the point once.
Eigen::Vector3f blend_each_stretched(const Influences& influences, const Palette& palette,
                                     const Eigen::Vector3f& rest) {
  Eigen::Vector4f rows[4];
  for (auto& row : rows) row.setZero();
  const Eigen::Vector4f real = sum_rotations(influences, palette, [&](std::int32_t j, float, float sign) {
    for (int part = 0; part < 4; ++part) rows[part] += sign * Parts(palette.dual_parts[j].row[part]);
  });
  const Eigen::Vector4f homogeneous = rest.homogeneous();
  Eigen::Vector4f dual;
  for (int part = 0; part < 4; ++part) dual[part] = rows[part].dot(homogeneous);
  return applied(real, dual, rest);
}

/// Moves a vertex that is first stretched by the mean of its joints' stretches.
Eigen::Vector3f blend_stretched(const Influences& influences, const Palette& palette, const Eigen::Vector3f& rest) {
  const Eigen::Vector4f homogeneous = rest.homogeneous();
  Eigen::Vector4f dual = Eigen::Vector4f::Zero();
  Eigen::Vector3f stretched = Eigen::Vector3f::Zero();
  float weight_sum = 0;
  const Eigen::Vector4f real = sum_rotations(influences, palette, [&](std::int32_t j, float weight, float sign) {
    weight_sum += weight;
    dual += sign * Parts(palette.dual_quaternions[j].dual);
    if (palette.is_stretched[j]) stretched += weight * palette.displacement(j, homogeneous);
  });
  const Eigen::Vector3f point = weight_sum != 0 ? Eigen::Vector3f(rest + stretched / weight_sum) : rest;
  return applied(real, dual, point);
}

float dot(const DualQuaternion& a, const DualQuaternion& b) {
  float sum = 0;
  for (int i = 0; i < 4; ++i) sum += a.real[i] * b.real[i];
  return sum;
}

/// Gives each joint the sign that puts it on the same side as its neighbours.
void choose_signs(const BlockedSkin& skin, Palette& palette) {
  auto& joints = palette.dual_quaternions;
  for (const auto& [from, to] : skin.spanning) {
    if (dot(joints[from], joints[to]) >= 0) continue;
    for (float& part : joints[to].real) part = -part;
    for (float& part : joints[to].dual) part = -part;
    palette.own_rotations[to].sign = -palette.own_rotations[to].sign;
  }
}

// Dot products of rotations up to this may be rounding; and of those that a nearly flat stretch leaves uncertain.
constexpr float kRounding = 1e-5f, kUncertain = 1e-3f;

/// Chooses how each set is blended. Where any two joints of a set agree in sign, by more than rounding, and no weight
/// is negative, every partial sum agrees with every joint: these signs are the ones that the stored order would give
/// (or all of them reversed, which is the same motion), and the kernel need not check them.
void choose_ways(const BlockedSkin& skin, Palette& palette) {
  const auto& joints = palette.dual_quaternions;
  const auto agree = [&](const JointPair& pair) { return dot(joints[pair.first], joints[pair.second]) > kRounding; };
  const bool all_agree = std::ranges::all_of(skin.neighbours, agree);
  const auto way_of = [&](std::uint32_t set) {
    const auto own = skin.joints_of(set);
    if (own.empty() || skin.has_negative_weights) return SetWay::one_by_one;
    if (!palette.is_spoilt.empty() && palette.is_spoilt[set]) return SetWay::one_by_one;
    for (std::size_t a = 0; a < own.size() && !all_agree; ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        if (!agree({own[a], own[b]})) return SetWay::one_by_one;
      }
    }
    const bool stretched = std::ranges::any_of(own, [&](std::uint32_t j) { return palette.is_stretched[j]; });
    return stretched ? SetWay::stretched : SetWay::rigid;
  };
  palette.ways.clear();
  for (std::uint32_t set = 0; set < skin.sets.size(); ++set) palette.ways.push_back(way_of(set));
}

/// Returns a joint's dual part, to which half of real * (0, v) is added for a point that its stretch has moved by v.
DualPartRows dual_part_of(const DualQuaternion& joint, const MatrixRows& displacement, bool is_stretched) {
  const float *const q = joint.real, *const d = joint.dual;
  DualPartRows result{};
  Eigen::Map<DualRows> rows(result.row[0]);
  if (is_stretched) {
    Eigen::Matrix<float, 4, 3> times;  // q (0, v) = times * v
    times << -q[1], -q[2], -q[3],      //
        q[0], -q[3], q[2],             //
        q[3], q[0], -q[1],             //
        -q[2], q[1], q[0];
    rows.noalias() = 0.5f * times * Eigen::Map<const Rows>(displacement.row[0]);
  }
  rows.col(3) += Parts(d);
  return result;
}

/// The joints that are not at rest, and their motions.
struct Moving {
  std::vector<std::int32_t> joints;
  std::vector<RigidAndStretch> motions;
};

/// own: before it was carried to the mesh's space.
void set_joint(const RigidAndStretch& motion, const Eigen::Quaternionf& own, std::size_t j, Palette& palette) {
  const Eigen::Quaternionf &r = motion.real, &d = motion.dual;
  palette.dual_quaternions[j] = {{r.w(), r.x(), r.y(), r.z()}, {d.w(), d.x(), d.y(), d.z()}};
  palette.own_rotations[j] = {{own.w(), own.x(), own.y(), own.z()}, 1};
  Eigen::Map<Rows>(palette.displacements[j].row[0]) = motion.displacement;
  palette.is_stretched[j] = !motion.is_rigid;
}

}  // namespace

void refuse_half_turns(std::span<const JointPair> pairs, const Palette& palette) {
  const auto& joints = palette.dual_quaternions;
  for (const auto& [a, b] : pairs) {
    if (std::abs(dot(joints[a], joints[b])) <= kUncertain) {
      throw HalfTurn("joints " + std::to_string(b) + " and " + std::to_string(a) + " are half a turn apart");
    }
  }
}

void prepare_dual_quaternion(const BlockedSkin& skin, const StretchRule& rule, MatrixStack<const float> matrices,
                             std::ptrdiff_t frame, const Space* space, Palette& palette) {
  palette.stretch_each = rule.stretch == Stretch::frame_each;
  const std::size_t joints = matrices.joints + 1;
  palette.dual_quaternions.resize(joints);
  palette.own_rotations.resize(joints);
  palette.displacements.resize(joints);
  palette.is_stretched.resize(joints);
  palette.dual_parts.clear();
  auto& moving = per_thread<Moving>();
  moving.joints.clear();
  const Matrix4<float> at_rest = Matrix4<float>::Identity();
  const RigidAndStretch no_motion;
  for (std::ptrdiff_t j = 0; j < matrices.joints; ++j) {
    // Most joints of a large rig may be at rest, or move no vertex of this mesh: no need to split them.
    if (matrices.at(frame, j) == at_rest) {
      set_joint(no_motion, no_motion.real, j, palette);
    } else {
      moving.joints.push_back(static_cast<std::int32_t>(j));
    }
  }
  set_joint(no_motion, no_motion.real, matrices.joints, palette);
  moving.motions.resize(moving.joints.size());
  split(matrices, frame, rule, moving.joints, moving.motions);
  for (std::size_t i = 0; i < moving.joints.size(); ++i) {
    const RigidAndStretch& own = moving.motions[i];
    set_joint(space ? carried(own, *space) : own, own.real, moving.joints[i], palette);
  }
  choose_signs(skin, palette);
  if (rule.refuses_half_turns) refuse_half_turns(skin.neighbours, palette);
  choose_ways(skin, palette);
  if (!palette.stretch_each) return;
  for (std::size_t j = 0; j < palette.dual_quaternions.size(); ++j) {
    palette.dual_parts.push_back(
        dual_part_of(palette.dual_quaternions[j], palette.displacements[j], palette.is_stretched[j]));
  }
}

void run_dual_quaternion(const BlockedSkin& skin, const Palette& palette, const Tile& tile) {
  dual_quaternion_blocks(skin, tile, palette.quaternion_joints());
  for (std::size_t b = tile.begin; b < tile.end; ++b) {
    if (palette.ways[skin.blocks[b].joint_set] != SetWay::one_by_one) continue;
    for (std::size_t v = b * kBlock; v < skin.vertex_after(b + 1); ++v) {
      const std::size_t at = 3 * (v - tile.begin * kBlock);
      dual_quaternion_vertex(skin.influences_of(v), palette, tile.rest + at, tile.positions + at);
    }
  }
}

void dual_quaternion_vertex(const Influences& influences, const Palette& palette, const float* rest, float* out) {
  const Eigen::Vector3f point = Eigen::Map<const Eigen::Vector3f>(rest);
  const Eigen::Vector3f moved = palette.stretch_each ? blend_each_stretched(influences, palette, point)
                                                     : blend_stretched(influences, palette, point);
  std::copy_n(moved.data(), 3, out);
}

}  // namespace sinew
