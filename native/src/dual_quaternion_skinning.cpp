#include "dual_quaternion_skinning.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

namespace sinew {
namespace {

// Matrices that went through float32 are orthonormal to about 1e-6.
constexpr double kRigidTolerance = 1e-5;

bool is_rotation(const Eigen::Matrix3d& linear) {
  return (linear.transpose() * linear).isIdentity(kRigidTolerance) && linear.determinant() > 0;
}

RigidAndStretch motion(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation,
                       const Eigen::Matrix<double, 3, 4>& stretch, bool is_rigid) {
  const Eigen::Quaterniond real = rotation.normalized();
  const Eigen::Vector3d half = 0.5 * translation;
  const Eigen::Quaterniond dual = Eigen::Quaterniond(0, half.x(), half.y(), half.z()) * real;
  return {real.cast<float>(), dual.cast<float>(), stretch.cast<float>(), is_rigid};
}

RigidAndStretch split_polar(const Matrix4<double>& matrix) {
  const Eigen::Matrix3d linear = matrix.topLeftCorner<3, 3>();
  Eigen::Matrix3d rotation = linear;
  const bool is_rigid = is_rotation(linear);
  if (!is_rigid) {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(linear, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Vector3d sign = Eigen::Vector3d::Ones();
    if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) sign.z() = -1;
    rotation = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  }
  Eigen::Matrix<double, 3, 4> stretch;
  stretch << rotation.transpose() * linear, Eigen::Vector3d::Zero();
  return motion(Eigen::Quaterniond(rotation), matrix.topRightCorner<3, 1>(), stretch, is_rigid);
}

// A joint that is scaled to nothing along an axis, or mirrored, turns as rounding decides. To turn
// as Blender's does, it takes the same steps in float32, sums in the same order.

float dot(const Eigen::Vector3f& a, const Eigen::Vector3f& b) { return a.x() * b.x() + a.y() * b.y() + a.z() * b.z(); }

/// Of length 1; zeros if it is too short to tell.
Eigen::Vector3f direction(const Eigen::Vector3f& vector) {
  const float square = dot(vector, vector);
  if (!(square > 1e-35f)) return Eigen::Vector3f::Zero();
  return vector * (1 / std::sqrt(square));
}

Matrix4<float> product(const Matrix4<float>& a, const Matrix4<float>& b) {
  Matrix4<float> result;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector4f first = a.col(0) * b(0, i) + a.col(1) * b(1, i);
    const Eigen::Vector4f last = a.col(2) * b(2, i) + a.col(3) * b(3, i);
    result.col(i) = first + last;
  }
  return result;
}

/// Of axes that are normalised here and may be zero: no rotation where nothing is left. Day,
/// "Converting a rotation matrix to a quaternion", Insomniac Games: of the four sums under the root
/// one that cannot be small.
Eigen::Quaternionf quaternion_of(const Eigen::Matrix3f& axes) {
  Eigen::Matrix3f m;
  m << direction(axes.col(0)), direction(axes.col(1)), direction(axes.col(2));
  const float xx = m(0, 0), yy = m(1, 1), zz = m(2, 2);
  const float yz = m(2, 1) - m(1, 2), zx = m(0, 2) - m(2, 0), xy = m(1, 0) - m(0, 1);
  const float xy2 = m(1, 0) + m(0, 1), yz2 = m(2, 1) + m(1, 2), zx2 = m(0, 2) + m(2, 0);
  const auto root = [](float sum, float w) { return w < 0 ? -2 * std::sqrt(sum) : 2 * std::sqrt(sum); };
  Eigen::Quaternionf q;  // w x y z
  if (zz < 0 && xx > yy) {
    const float s = root(1 + xx - yy - zz, yz), t = 1 / s;
    q = {yz * t, 0.25f * s, xy2 * t, zx2 * t};
  } else if (zz < 0) {
    const float s = root(1 - xx + yy - zz, zx), t = 1 / s;
    q = {zx * t, xy2 * t, 0.25f * s, yz2 * t};
  } else if (xx < -yy) {
    const float s = root(1 - xx - yy + zz, xy), t = 1 / s;
    q = {xy * t, zx2 * t, yz2 * t, 0.25f * s};
  } else {
    const float s = root(1 + xx + yy + zz, 1), t = 1 / s;
    q = {0.25f * s, yz * t, zx * t, xy * t};
  }
  return q.normalized();
}

/// Orthogonal axes as long as the given ones, of which Y has the direction of the given one. The
/// two comparisons look at numbers that are not normalised; they are Blender's, and so is the
/// choice that follows; in the armature's axes, where it comes to the last one.
Eigen::Matrix3f axes_along_y(const Eigen::Matrix3f& linear, const Eigen::Matrix3f& armature_axes) {
  const Eigen::Vector3f given_x = linear.col(0), given_z = linear.col(2);
  const Eigen::Vector3f y = direction(linear.col(1));
  Eigen::Vector3f x, z;
  if (dot(y, given_x) < 1) {
    z = direction(given_x.cross(y));
    x = y.cross(z);
  } else {
    const bool z_serves = dot(given_x, given_z) < 1;
    const Eigen::Vector3f own = armature_axes.transpose() * y;
    x = direction(y.cross(z_serves ? given_z : armature_axes * Eigen::Vector3f(own.y(), own.z(), own.x())));
    z = x.cross(y);
  }
  Eigen::Matrix3f axes;
  axes << x, y, z;
  for (int i = 0; i < 3; ++i) axes.col(i) *= std::sqrt(dot(linear.col(i), linear.col(i)));
  return axes;
}

/// matrix = rigid motion * stretch, the stretch along the axes of the rest frame: what is left of
/// (matrix * rest) when its axes are made orthonormal.
RigidAndStretch split_in_frame(const Matrix4<double>& matrix, const Matrix4<double>& rest,
                               const Eigen::Matrix3f& armature_axes) {
  const Matrix4<float> base = rest.cast<float>();
  const Matrix4<float> posed = product(matrix.cast<float>(), base);
  const Eigen::Vector3f excess = posed.topLeftCorner<3, 3>().colwise().norm().transpose() - Eigen::Vector3f::Ones();
  if (is_rotation(matrix.topLeftCorner<3, 3>()) && excess.squaredNorm() <= 1e-8f) {
    return motion(Eigen::Quaterniond(matrix.topLeftCorner<3, 3>()), matrix.topRightCorner<3, 1>(),
                  Eigen::Matrix<double, 3, 4>::Identity(), true);
  }
  Matrix4<float> rigid = Matrix4<float>::Identity();
  rigid.topLeftCorner<3, 3>() = quaternion_of(axes_along_y(posed.topLeftCorner<3, 3>(), armature_axes))
                                    .cast<double>()
                                    .toRotationMatrix()
                                    .cast<float>();
  rigid.topRightCorner<3, 1>() = posed.topRightCorner<3, 1>();
  const Matrix4<float> moved = product(rigid, base.inverse());
  const Matrix4<double> inverse_rest = rest.inverse();
  const Matrix4<double> stretch = rest * (rigid.cast<double>().inverse() * posed.cast<double>()) * inverse_rest;
  return motion(quaternion_of(moved.topLeftCorner<3, 3>()).cast<double>(), moved.topRightCorner<3, 1>().cast<double>(),
                stretch.topRows<3>(), false);
}

/// real * (0, by): half of it is what a point moved by `by` before the motion adds to the dual
/// part.
Eigen::Vector4f times_vector(const Eigen::Quaternionf& real, const Eigen::Vector3f& by) {
  return (real * Eigen::Quaternionf(0, by.x(), by.y(), by.z())).coeffs();
}

/// A vertex at `rest`: each sign against the sum so far, in stored order.
Eigen::Vector3f blend_vertex(const Influences& influences, const Palette& palette, const Eigen::Vector3f& rest) {
  Eigen::Vector4f real = Eigen::Vector4f::Zero();
  Eigen::Vector4f dual = Eigen::Vector4f::Zero();
  Eigen::Vector3f stretched = Eigen::Vector3f::Zero();
  float weight_sum = 0;
  for (std::size_t i = 0; i < influences.joints.size(); ++i) {
    const RigidAndStretch& joint = palette.motions[influences.joints[i]];
    const float weight = influences.weights[i];
    const float sign = joint.real.coeffs().dot(real) < 0 ? -weight : weight;
    real += sign * joint.real.coeffs();
    dual += sign * joint.dual.coeffs();
    weight_sum += weight;
    const Eigen::Vector3f by =
        joint.is_rigid ? Eigen::Vector3f::Zero() : Eigen::Vector3f(joint.stretch * rest.homogeneous() - rest);
    if (palette.stretch_each) {
      dual += 0.5f * sign * times_vector(joint.real, by);
    } else {
      stretched += weight * by;
    }
  }
  const float norm2 = real.squaredNorm();
  // Opposite rotations that cancel, or weights of nearly nothing: no direction is right.
  if (norm2 < std::numeric_limits<float>::min()) return rest;
  const Eigen::Vector3f point = weight_sum != 0 ? Eigen::Vector3f(rest + stretched / weight_sum) : rest;
  // Kavan 2008, algorithm 1, on coefficients (x y z w) that are not yet normalised.
  const Eigen::Vector3f r = real.head<3>(), d = dual.head<3>();
  const Eigen::Vector3f rotated = point + 2 / norm2 * r.cross(Eigen::Vector3f(r.cross(point) + real.w() * point));
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
  const bool all_agree = std::ranges::all_of(
      skin.neighbours, [&](const JointPair& pair) { return dot(joints[pair.first], joints[pair.second]) >= 0; });
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

void prepare_dual_quaternion(const BlockedSkin& skin, const StretchRule& rule, MatrixStack<const float> matrices,
                             std::ptrdiff_t frame, Palette& palette) {
  const bool polar = rule.stretch == Stretch::polar;
  const Eigen::Matrix3f axes = rule.armature_axes.cast<float>();
  palette.stretch_each = rule.stretch == Stretch::frame_each;
  palette.motions.clear();
  palette.dual_quaternions.clear();
  for (std::ptrdiff_t j = 0; j < matrices.joints; ++j) {
    const Matrix4<double> matrix = matrices.at(frame, j).cast<double>();
    palette.motions.push_back(polar ? split_polar(matrix) : split_in_frame(matrix, rule.rest_frames[j], axes));
    palette.dual_quaternions.push_back(with_sign(palette.motions.back(), 1));
  }
  palette.dual_quaternions.push_back({{1, 0, 0, 0}, {0, 0, 0, 0}});
  choose_signs(skin, palette);
}

void run_dual_quaternion(const BlockedSkin& skin, const Palette& palette, const Tile& tile) {
  dual_quaternion_blocks(skin, tile, palette.dual_quaternions.data(), palette.skip.data());
  for (std::size_t b = tile.begin; b < tile.end; ++b) {
    const std::uint32_t joint_set = skin.blocks[b].joint_set;
    if (skin.sets[joint_set].count > 0 && !palette.skip[joint_set]) continue;
    for (std::size_t v = b * kBlock; v < skin.vertex_after(b + 1); ++v) {
      const std::size_t at = 3 * (v - tile.begin * kBlock);
      dual_quaternion_vertex(skin.influences_of(v), palette, tile.rest + at, tile.positions + at);
    }
  }
}

void dual_quaternion_vertex(const Influences& influences, const Palette& palette, const float* rest, float* out) {
  const Eigen::Vector3f moved = blend_vertex(influences, palette, Eigen::Map<const Eigen::Vector3f>(rest));
  std::copy_n(moved.data(), 3, out);
}

}  // namespace sinew
