#include "skinning/rigid_and_stretch.h"

#include <Eigen/SVD>
#include <cmath>

// CMakeLists.txt has this file compiled without fused multiply-adds: splitting along a frame then gives Blender's
// result on every machine.

namespace sinew {
namespace {

// Matrices that went through float32 are orthonormal to about 1e-6. Blender has the same bound, and the same for the
// dot products of two columns.
constexpr float kRigidTolerance = 1e-5f;

float dot(const Eigen::Vector3f& a, const Eigen::Vector3f& b) { return a.x() * b.x() + a.y() * b.y() + a.z() * b.z(); }

bool is_rotation(const Eigen::Matrix3f& linear) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j <= i; ++j) {
      const float error = dot(linear.col(i), linear.col(j)) - static_cast<float>(i == j);
      if (!(std::abs(error) <= kRigidTolerance)) return false;
    }
  }
  return linear.determinant() > 0;
}

/// real: has length 1.
RigidAndStretch motion(const Eigen::Quaterniond& real, const Eigen::Vector3d& translation) {
  const Eigen::Vector3d half = 0.5 * translation;
  RigidAndStretch result;
  result.real = real.cast<float>();
  result.dual = (Eigen::Quaterniond(0, half.x(), half.y(), half.z()) * real).cast<float>();
  return result;
}

/// stretch: the upper rows of its matrix.
RigidAndStretch stretched(RigidAndStretch motion, const Eigen::Matrix<double, 3, 4>& stretch) {
  motion.displacement = (stretch - Eigen::Matrix<double, 3, 4>::Identity()).cast<float>();
  motion.is_rigid = false;
  return motion;
}

/// Returns the rotation nearest to a matrix, by singular values; if it mirrors or is flat, one of the nearest.
Eigen::Matrix3d nearest_rotation_to_any(const Eigen::Matrix3d& linear) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(linear, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) sign.z() = -1;
  return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

/// Likewise, by Newton's iteration if the matrix does neither: a few steps instead of a decomposition. Higham,
/// "Computing the polar decomposition with applications", SIAM J. Sci. Stat. Comput. 7(4), 1986, section 3.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& linear) {
  constexpr double kFlat = 1e-3, kConverged = 1e-8;  // a step of 1e-8 leaves an error of its square
  constexpr int kSteps = 20;
  const double size = linear.norm();
  if (!(linear.determinant() > kFlat * size * size * size)) return nearest_rotation_to_any(linear);
  Eigen::Matrix3d rotation = linear;
  for (int step = 0; step < kSteps; ++step) {
    const Eigen::Matrix3d change = (rotation.inverse().transpose() - rotation) / 2;
    rotation += change;
    if (change.squaredNorm() < kConverged * kConverged) return rotation;
  }
  return nearest_rotation_to_any(linear);
}

RigidAndStretch split_polar(const Matrix4<float>& matrix) {
  const Eigen::Matrix3d linear = matrix.topLeftCorner<3, 3>().cast<double>();
  const Eigen::Vector3d translation = matrix.topRightCorner<3, 1>().cast<double>();
  if (is_rotation(matrix.topLeftCorner<3, 3>())) {
    return motion(Eigen::Quaterniond(linear).normalized(), translation);
  }
  const Eigen::Matrix3d rotation = nearest_rotation(linear);
  Eigen::Matrix<double, 3, 4> stretch;
  stretch << rotation.transpose() * linear, Eigen::Vector3d::Zero();
  return stretched(motion(Eigen::Quaterniond(rotation).normalized(), translation), stretch);
}

// The rotation of a joint that is scaled to 0 along an axis, or mirrored, depends on rounding; and whether a joint is
// rigid, and which rotation to use if its axes are not quite orthogonal, is Blender's choice, too. To get the same
// results, this code takes the same steps in float32, with sums in the same order.

/// Returns the vector with length 1; zeros if it is too short to have a direction.
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

/// Returns the rotation of axes, which are normalised here and may be zero; no rotation if all are. Day,
/// "Converting a rotation matrix to a quaternion", Insomniac Games: of the four possible sums, takes the
/// root of one that cannot be small.
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

Eigen::Vector3f lengths_of_columns(const Eigen::Matrix3f& linear) {
  Eigen::Vector3f lengths;
  for (int i = 0; i < 3; ++i) lengths[i] = std::sqrt(dot(linear.col(i), linear.col(i)));
  return lengths;
}

/// Returns orthogonal axes as long as the given ones; Y keeps its direction. The two comparisons use
/// numbers that are not normalised; they are Blender's, and so is the choice that follows.
Eigen::Matrix3f axes_along_y(const Eigen::Matrix3f& linear) {
  const Eigen::Vector3f given_x = linear.col(0), given_z = linear.col(2);
  const Eigen::Vector3f y = direction(linear.col(1));
  Eigen::Vector3f x, z;
  if (dot(y, given_x) < 1) {
    z = direction(given_x.cross(y));
    x = y.cross(z);
  } else {
    const bool z_serves = dot(given_x, given_z) < 1;
    x = direction(y.cross(z_serves ? given_z : Eigen::Vector3f(y.y(), y.z(), y.x())));
    z = x.cross(y);
  }
  Eigen::Matrix3f axes;
  axes << x, y, z;
  return axes * lengths_of_columns(linear).asDiagonal();
}

/// Returns the motion of a matrix whose columns have length 1, or nearly.
RigidAndStretch motion_of(const Matrix4<float>& matrix) {
  return motion(quaternion_of(matrix.topLeftCorner<3, 3>()).cast<double>(),
                matrix.topRightCorner<3, 1>().cast<double>());
}

/// For a matrix whose last row is 0 0 0 1.
Matrix4<double> inverse_of_affine(const Matrix4<double>& matrix) {
  return Eigen::Affine3d(matrix).inverse(Eigen::Affine).matrix();
}

/// matrix = rigid motion * stretch, the stretch along the axes of the rest frame: what is left of
/// (matrix * rest) when its axes are made orthonormal.
RigidAndStretch split_in_frame(const Matrix4<float>& matrix, const Matrix4<double>& rest) {
  const Matrix4<float> base = rest.cast<float>();
  const Matrix4<float> posed = product(matrix, base);
  const Eigen::Vector3f excess = lengths_of_columns(posed.topLeftCorner<3, 3>()) - Eigen::Vector3f::Ones();
  if (is_rotation(matrix.topLeftCorner<3, 3>()) && dot(excess, excess) <= 1e-8f) return motion_of(matrix);
  Matrix4<float> rigid = Matrix4<float>::Identity();
  rigid.topLeftCorner<3, 3>() =
      quaternion_of(axes_along_y(posed.topLeftCorner<3, 3>())).cast<double>().toRotationMatrix().cast<float>();
  rigid.topRightCorner<3, 1>() = posed.topRightCorner<3, 1>();
  const Matrix4<double> left = inverse_of_affine(rigid.cast<double>()) * posed.cast<double>();
  const Matrix4<double> stretch = rest * left * inverse_of_affine(rest);
  return stretched(motion_of(product(rigid, base.inverse())), stretch.topRows<3>());
}

}  // namespace

RigidAndStretch taken_apart(const Matrix4<float>& matrix, const StretchRule& rule, std::ptrdiff_t j) {
  if (rule.stretch == Stretch::polar) return split_polar(matrix);
  return split_in_frame(matrix, rule.rest_frames[j]);
}

RigidAndStretch carried(const RigidAndStretch& own, const Space& space) {
  const Eigen::Quaterniond turn = Eigen::Quaterniond(space.axes()).normalized();
  const Eigen::Quaterniond real = own.real.cast<double>();
  Matrix4<double> rigid = Matrix4<double>::Identity();
  rigid.topLeftCorner<3, 3>() = real.toRotationMatrix();
  rigid.topRightCorner<3, 1>() = 2 * (own.dual.cast<double>() * real.conjugate()).vec();
  const Matrix4<double> moved = space.forth * rigid * space.back;
  const RigidAndStretch result = motion((turn * real * turn.conjugate()).normalized(), moved.topRightCorner<3, 1>());
  if (own.is_rigid) return result;
  Matrix4<double> stretch = Matrix4<double>::Identity();
  stretch.topRows<3>() += own.displacement.cast<double>();
  return stretched(result, (space.forth * stretch * space.back).topRows<3>());
}

}  // namespace sinew
