#include "sinew/dual_quaternion_skinning.h"

#include <Eigen/SVD>
#include <limits>

#include "palette.h"
#include "sinew/skinning.h"

namespace sinew {
namespace {

// Matrices that went through float32 are orthonormal to about 1e-6.
constexpr double kRigidTolerance = 1e-5;

RigidAndStretch split(const Matrix4<double>& matrix) {
  const Eigen::Matrix3d linear = matrix.topLeftCorner<3, 3>();
  Eigen::Matrix3d rotation = linear;
  const bool is_rigid =
      (linear.transpose() * linear).isIdentity(kRigidTolerance) && linear.determinant() > 0;
  if (!is_rigid) {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(linear, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Vector3d sign = Eigen::Vector3d::Ones();
    if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) sign.z() = -1;
    rotation = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  }
  const Eigen::Quaterniond real = Eigen::Quaterniond(rotation).normalized();
  const Eigen::Vector3d half = 0.5 * matrix.topRightCorner<3, 1>();
  const Eigen::Quaterniond dual = Eigen::Quaterniond(0, half.x(), half.y(), half.z()) * real;
  return {real.cast<float>(), dual.cast<float>(), (rotation.transpose() * linear).cast<float>(),
          is_rigid};
}

/// One vertex, exactly as the header says: each sign against the sum so far, in stored order.
Eigen::Vector3f blend_vertex(const BlockedSkin& skin, const RigidAndStretch* palette,
                             std::size_t v) {
  const Eigen::Vector3f rest = Eigen::Map<const Eigen::Vector3f>(skin.rest.data() + 3 * v);
  Eigen::Vector4f real = Eigen::Vector4f::Zero();
  Eigen::Vector4f dual = Eigen::Vector4f::Zero();
  Eigen::Matrix3f stretch = Eigen::Matrix3f::Zero();
  float weight_sum = 0;
  bool is_rigid = true;
  for (auto i = skin.offsets[v]; i < skin.offsets[v + 1]; ++i) {
    const RigidAndStretch& joint = palette[skin.influence_joints[i]];
    const float weight = skin.weights[i];
    const float sign = joint.real.coeffs().dot(real) < 0 ? -weight : weight;
    real += sign * joint.real.coeffs();
    dual += sign * joint.dual.coeffs();
    stretch += weight * joint.stretch;
    weight_sum += weight;
    is_rigid &= joint.is_rigid;
  }
  const float norm2 = real.squaredNorm();
  // Opposite rotations that cancel, or weights of nearly nothing: no direction is right.
  if (norm2 < std::numeric_limits<float>::min()) return rest;
  const bool stretched = !is_rigid && weight_sum != 0;
  const Eigen::Vector3f point = stretched ? Eigen::Vector3f(stretch * rest / weight_sum) : rest;
  // Kavan 2008, algorithm 1, on coefficients (x y z w) that are not yet normalised.
  const Eigen::Vector3f r = real.head<3>(), d = dual.head<3>();
  const Eigen::Vector3f rotated =
      point + 2 / norm2 * r.cross(Eigen::Vector3f(r.cross(point) + real.w() * point));
  return rotated + 2 / norm2 * (real.w() * d - dual.w() * r + r.cross(d));
}

DualQuaternion with_sign(const RigidAndStretch& joint, float sign) {
  const Eigen::Quaternionf &r = joint.real, &d = joint.dual;
  return {{sign * r.w(), sign * r.x(), sign * r.y(), sign * r.z()},
          {sign * d.w(), sign * d.x(), sign * d.y(), sign * d.z()}};
}

float dot(const DualQuaternion& a, const DualQuaternion& b) {
  float sum = 0;
  for (int i = 0; i < 4; ++i) sum += a.real[i] * b.real[i];
  return sum;
}

/// Gives each joint the sign that puts it on the side of its neighbours. Where any two joints of a
/// set then agree, and no weight is negative, every sum so far agrees with every joint: the signs
/// that the stored order asks for are these (or all of them turned, which is the same motion), and
/// a block need not look. Sets in which two joints do not agree, or one is not rigid, are skipped.
void choose_signs(const BlockedSkin& skin, Palette& palette) {
  auto& joints = palette.dual_quaternions;
  for (const auto& [from, to] : skin.spanning) {
    if (dot(joints[from], joints[to]) >= 0) continue;
    for (float& part : joints[to].real) part = -part;
    for (float& part : joints[to].dual) part = -part;
  }
  const bool all_agree = std::ranges::all_of(skin.neighbours, [&](const JointPair& pair) {
    return dot(joints[pair.first], joints[pair.second]) >= 0;
  });
  const bool all_rigid = std::ranges::all_of(palette.motions, &RigidAndStretch::is_rigid);
  palette.skip.assign(skin.sets.size(), skin.has_negative_weights);
  if (all_agree && all_rigid) return;
  for (std::uint32_t s = 0; s < skin.sets.size(); ++s) {
    const auto own = skin.joints_of(s);
    for (std::size_t a = 0; a < own.size(); ++a) {
      if (own[a] < palette.motions.size() && !palette.motions[own[a]].is_rigid) palette.skip[s] = 1;
      for (std::size_t b = 0; b < a; ++b) {
        if (dot(joints[own[a]], joints[own[b]]) < 0) palette.skip[s] = 1;
      }
    }
  }
}

}  // namespace

void prepare_dual_quaternion(const BlockedSkin& skin, MatrixStack<const float> matrices,
                             std::ptrdiff_t frame, Palette& palette) {
  palette.motions.clear();
  palette.dual_quaternions.clear();
  for (std::ptrdiff_t j = 0; j < matrices.joints; ++j) {
    palette.motions.push_back(split(matrices.at(frame, j).cast<double>()));
    palette.dual_quaternions.push_back(with_sign(palette.motions.back(), 1));
  }
  palette.dual_quaternions.push_back({{1, 0, 0, 0}, {0, 0, 0, 0}});
  choose_signs(skin, palette);
}

void run_dual_quaternion(const BlockedSkin& skin, const Palette& palette, std::size_t begin,
                         std::size_t end, float* positions) {
  dual_quaternion_blocks(skin, begin, end, palette.dual_quaternions.data(), palette.skip.data(),
                         positions);
  const std::size_t vertices = skin.offsets.size() - 1;
  for (std::size_t b = begin; b < end; ++b) {
    const Block& block = skin.blocks[b];
    if (skin.sets[block.joint_set].count > 0 && !palette.skip[block.joint_set]) continue;
    const std::size_t last = std::min(vertices, std::size_t{block.first_vertex} + kBlock);
    for (std::size_t v = block.first_vertex; v < last; ++v) {
      Eigen::Map<Eigen::Vector3f>(positions + 3 * v) =
          blend_vertex(skin, palette.motions.data(), v);
    }
  }
}

void skin_dual_quaternion(const Skin& skin, MatrixStack<const float> matrices,
                          std::span<float> positions) {
  const SkinningJob job{&skin, matrices, positions, SkinningMethod::dual_quaternion};
  skin_all({&job, 1});
}

}  // namespace sinew
