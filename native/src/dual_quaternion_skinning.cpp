#include "dual_quaternion_skinning.h"

#include <Eigen/SVD>
#include <algorithm>
#include <limits>

namespace sinew {
namespace {

// Matrices that went through float32 are orthonormal to about 1e-6.
constexpr double kRigidTolerance = 1e-5;

bool is_rotation(const Eigen::Matrix3d& linear) {
  return (linear.transpose() * linear).isIdentity(kRigidTolerance) && linear.determinant() > 0;
}

RigidAndStretch motion(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                       const Eigen::Matrix<double, 3, 4>& stretch, bool is_rigid) {
  const Eigen::Quaterniond real = Eigen::Quaterniond(rotation).normalized();
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
  return motion(rotation, matrix.topRightCorner<3, 1>(), stretch, is_rigid);
}

/// A rotation near axes of which some have no length, as joints scaled to zero have them: by way of
/// a quaternion, as in Blender, which then takes no rotation at all where nothing is left. Day,
/// "Converting a rotation matrix to a quaternion", Insomniac Games: of the four sums under the root
/// one that cannot be small.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m) {
  const double xx = m(0, 0), yy = m(1, 1), zz = m(2, 2);
  const double yz = m(2, 1) - m(1, 2), zx = m(0, 2) - m(2, 0), xy = m(1, 0) - m(0, 1);
  const double xy2 = m(1, 0) + m(0, 1), yz2 = m(2, 1) + m(1, 2), zx2 = m(0, 2) + m(2, 0);
  Eigen::Quaterniond q;  // w x y z, of any length
  if (zz < 0) {
    q = xx > yy ? Eigen::Quaterniond(yz, 1 + xx - yy - zz, xy2, zx2)
                : Eigen::Quaterniond(zx, xy2, 1 - xx + yy - zz, yz2);
  } else {
    q = xx < -yy ? Eigen::Quaterniond(xy, zx2, yz2, 1 - xx - yy + zz)
                 : Eigen::Quaterniond(1 + xx + yy + zz, yz, zx, xy);
  }
  return q.normalized().toRotationMatrix();
}

/// Orthonormal axes of which Y has the direction of the given one. The two comparisons look at
/// numbers that are not normalised; they are Blender's, and so is the choice that follows.
Eigen::Matrix3d axes_along_y(const Eigen::Matrix3d& linear) {
  const Eigen::Vector3d given_x = linear.col(0), given_z = linear.col(2);
  const Eigen::Vector3d y = linear.col(1).normalized();
  Eigen::Vector3d x, z;
  if (y.dot(given_x) < 1) {
    z = given_x.cross(y).normalized();
    x = y.cross(z);
  } else {
    const bool z_serves = given_x.dot(given_z) < 1;
    x = y.cross(z_serves ? given_z : Eigen::Vector3d(y.y(), y.z(), y.x())).normalized();
    z = x.cross(y);
  }
  Eigen::Matrix3d axes;
  axes << x, y, z;
  const bool orthonormal = !x.isZero() && !y.isZero() && !z.isZero();
  return orthonormal ? axes : nearest_rotation(axes);
}

/// matrix = rigid motion * stretch, the stretch along the axes of the rest frame: what is left of
/// (matrix * rest) when its axes are made orthonormal.
RigidAndStretch split_in_frame(const Matrix4<double>& matrix, const Matrix4<double>& rest) {
  const Matrix4<double> posed = matrix * rest;
  const Eigen::Vector3d excess =
      posed.topLeftCorner<3, 3>().colwise().norm().transpose() - Eigen::Vector3d::Ones();
  if (is_rotation(matrix.topLeftCorner<3, 3>()) && excess.squaredNorm() <= 1e-8) {
    return motion(matrix.topLeftCorner<3, 3>(), matrix.topRightCorner<3, 1>(),
                  Eigen::Matrix<double, 3, 4>::Identity(), true);
  }
  Matrix4<double> rigid = Matrix4<double>::Identity();
  rigid.topLeftCorner<3, 3>() = axes_along_y(posed.topLeftCorner<3, 3>());
  rigid.topRightCorner<3, 1>() = posed.topRightCorner<3, 1>();
  const Matrix4<double> inverse_rest = rest.inverse();
  const Matrix4<double> moved = rigid * inverse_rest;
  const Matrix4<double> stretch = rest * (rigid.inverse() * posed) * inverse_rest;
  return motion(moved.topLeftCorner<3, 3>(), moved.topRightCorner<3, 1>(), stretch.topRows<3>(),
                false);
}

/// real * (0, by): half of it is what a point moved by `by` before the motion adds to the dual
/// part.
Eigen::Vector4f times_vector(const Eigen::Quaternionf& real, const Eigen::Vector3f& by) {
  return (real * Eigen::Quaternionf(0, by.x(), by.y(), by.z())).coeffs();
}

/// A vertex at `rest`: each sign against the sum so far, in stored order.
Eigen::Vector3f blend_vertex(const Influences& influences, const Palette& palette,
                             const Eigen::Vector3f& rest) {
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
    const Eigen::Vector3f by = joint.is_rigid
                                   ? Eigen::Vector3f::Zero()
                                   : Eigen::Vector3f(joint.stretch * rest.homogeneous() - rest);
    if (palette.stretch_each) {
      dual += 0.5f * sign * times_vector(joint.real, by);
    } else {
      stretched += weight * by;
    }
  }
  const float norm2 = real.squaredNorm();
  // Opposite rotations that cancel, or weights of nearly nothing: no direction is right.
  if (norm2 < std::numeric_limits<float>::min()) return rest;
  const Eigen::Vector3f point =
      weight_sum != 0 ? Eigen::Vector3f(rest + stretched / weight_sum) : rest;
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

void prepare_dual_quaternion(const BlockedSkin& skin, const StretchRule& rule,
                             MatrixStack<const float> matrices, std::ptrdiff_t frame,
                             Palette& palette) {
  const bool polar = rule.stretch == Stretch::polar;
  palette.stretch_each = rule.stretch == Stretch::frame_each;
  palette.motions.clear();
  palette.dual_quaternions.clear();
  for (std::ptrdiff_t j = 0; j < matrices.joints; ++j) {
    const Matrix4<double> matrix = matrices.at(frame, j).cast<double>();
    palette.motions.push_back(polar ? split_polar(matrix)
                                    : split_in_frame(matrix, rule.rest_frames[j]));
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

void dual_quaternion_vertex(const Influences& influences, const Palette& palette, const float* rest,
                            float* out) {
  const Eigen::Vector3f moved =
      blend_vertex(influences, palette, Eigen::Map<const Eigen::Vector3f>(rest));
  std::copy_n(moved.data(), 3, out);
}

}  // namespace sinew
