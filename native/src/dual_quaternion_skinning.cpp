#include "sinew/dual_quaternion_skinning.h"

#include <Eigen/SVD>
#include <limits>

#include "frame_loop.h"

namespace sinew {
namespace {

/// One joint: first the stretch, then the rigid motion that `real` and `dual` stand for.
struct RigidAndStretch {
  Eigen::Quaternionf real;
  Eigen::Quaternionf dual;
  Eigen::Matrix3f stretch;
  bool is_rigid;
};

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

}  // namespace

void skin_dual_quaternion(const Skin& skin, MatrixStack<const float> matrices,
                          std::span<float> positions) {
  const float* rest = skin.rest_positions().data();
  const std::int64_t* offsets = skin.offsets().data();
  const std::int32_t* joints = skin.joints().data();
  const float* weights = skin.weights().data();

  skin_frames<RigidAndStretch>(
      skin, matrices, positions,
      [](const auto& matrix) { return split(matrix.template cast<double>()); },
      [=](const RigidAndStretch* palette, std::ptrdiff_t v) -> Eigen::Vector3f {
        Eigen::Vector4f real = Eigen::Vector4f::Zero();
        Eigen::Vector4f dual = Eigen::Vector4f::Zero();
        float weight_sum = 0;
        bool is_rigid = true;
        for (std::int64_t i = offsets[v]; i < offsets[v + 1]; ++i) {
          const RigidAndStretch& joint = palette[joints[i]];
          const float weight = weights[i];
          const float sign = joint.real.coeffs().dot(real) < 0 ? -weight : weight;
          real += sign * joint.real.coeffs();
          dual += sign * joint.dual.coeffs();
          weight_sum += weight;
          is_rigid &= joint.is_rigid;
        }
        Eigen::Vector3f point = Eigen::Map<const Eigen::Vector3f>(rest + 3 * v);
        const float norm2 = real.squaredNorm();
        // Opposite rotations that cancel, or weights of nearly nothing: no direction is right.
        if (norm2 < std::numeric_limits<float>::min()) return point;
        if (!is_rigid && weight_sum != 0) {
          Eigen::Matrix3f stretch = Eigen::Matrix3f::Zero();
          for (std::int64_t i = offsets[v]; i < offsets[v + 1]; ++i) {
            stretch += weights[i] * palette[joints[i]].stretch;
          }
          point = stretch * point / weight_sum;
        }
        // Kavan 2008, algorithm 1, on coefficients (x y z w) that are not yet normalised.
        const Eigen::Vector3f r = real.head<3>(), d = dual.head<3>();
        const Eigen::Vector3f rotated =
            point + 2 / norm2 * r.cross(Eigen::Vector3f(r.cross(point) + real.w() * point));
        return rotated + 2 / norm2 * (real.w() * d - dual.w() * r + r.cross(d));
      });
}

}  // namespace sinew
