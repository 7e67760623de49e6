#include "reference.h"

namespace sinew::reference {

Matrix4<double> world_of(std::span<const std::int32_t> parents, const Matrices& rest, const Matrices& local,
                         std::int32_t j) {
  const Matrix4<double> own = rest[j] * local[j];
  if (parents[j] < 0) return own;
  return world_of(parents, rest, local, parents[j]) * own;
}

Matrices forward_kinematics(std::span<const std::int32_t> parents, const Matrices& rest, const Matrices& local) {
  Matrices world;
  for (std::size_t j = 0; j < parents.size(); ++j) {
    world.push_back(world_of(parents, rest, local, static_cast<std::int32_t>(j)));
  }
  return world;
}

Eigen::MatrixXd dense_weights(const Skin& skin) {
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(skin.vertex_count(), skin.joint_count());
  for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
    for (auto i = skin.offsets()[v]; i < skin.offsets()[v + 1]; ++i) {
      dense(v, skin.joints()[i]) += skin.weights()[i];
    }
  }
  return dense;
}

Eigen::Vector3d rest_position(const Skin& skin, std::ptrdiff_t v) {
  return Eigen::Map<const Eigen::Vector3f>(skin.rest_positions().data() + 3 * v).cast<double>();
}

bool is_moved(const Skin& skin, std::ptrdiff_t v) { return skin.offsets()[v] != skin.offsets()[v + 1]; }

Eigen::MatrixX3d skin_linear(const Skin& skin, const Matrices& matrices) {
  const Eigen::MatrixXd weights = dense_weights(skin);
  Eigen::MatrixX3d positions(skin.vertex_count(), 3);
  for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
    const Eigen::Vector3d point = rest_position(skin, v);
    Eigen::Vector3d moved = is_moved(skin, v) ? Eigen::Vector3d::Zero() : point;
    for (std::ptrdiff_t j = 0; j < skin.joint_count(); ++j) {
      moved += weights(v, j) * (matrices[j] * point.homogeneous()).head<3>();
    }
    positions.row(v) = moved;
  }
  return positions;
}

DualQuaternion dual_quaternion(const Matrix4<double>& matrix) {
  const Eigen::Matrix3d linear = matrix.topLeftCorner<3, 3>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(linear.transpose() * linear);
  Eigen::Vector3d lengths = eigen.eigenvalues().cwiseSqrt();  // ascending
  if (linear.determinant() < 0) lengths[0] = -lengths[0];
  const Eigen::Matrix3d& axes = eigen.eigenvectors();
  DualQuaternion result;
  result.stretch = axes * lengths.asDiagonal() * axes.transpose();
  result.real = Eigen::Quaterniond(Eigen::Matrix3d(linear * result.stretch.inverse()));
  const Eigen::Vector3d t = matrix.topRightCorner<3, 1>();
  result.dual = Eigen::Quaterniond(0, t.x(), t.y(), t.z()) * result.real;
  result.dual.coeffs() *= 0.5;
  return result;
}

std::vector<DualQuaternion> dual_quaternions(const Matrices& matrices) {
  std::vector<DualQuaternion> joints;
  for (const auto& matrix : matrices) joints.push_back(dual_quaternion(matrix));
  return joints;
}

Eigen::MatrixX3d skin_dual_quaternion(const Skin& skin, const Matrices& matrices) {
  const std::vector<DualQuaternion> joints = dual_quaternions(matrices);
  Eigen::MatrixX3d positions(skin.vertex_count(), 3);
  for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
    const Eigen::Vector3d point = rest_position(skin, v);
    positions.row(v) = point;
    if (!is_moved(skin, v)) continue;
    DualQuaternion sum;
    sum.stretch.setZero();
    double weights = 0;
    for (auto i = skin.offsets()[v]; i < skin.offsets()[v + 1]; ++i) {
      const DualQuaternion& joint = joints[skin.joints()[i]];
      const double weight = skin.weights()[i];
      const double sign = sum.real.dot(joint.real) < 0 ? -1 : 1;
      sum.real.coeffs() += sign * weight * joint.real.coeffs();
      sum.dual.coeffs() += sign * weight * joint.dual.coeffs();
      sum.stretch += weight * joint.stretch;
      weights += weight;
    }
    const double norm = sum.real.norm();
    sum.real.coeffs() /= norm;
    sum.dual.coeffs() /= norm;
    const Eigen::Vector3d translation = 2 * (sum.dual * sum.real.conjugate()).vec();
    positions.row(v) = sum.real.toRotationMatrix() * (sum.stretch * point / weights) + translation;
  }
  return positions;
}

FrameMotion frame_motion(const Matrix4<double>& matrix, const Matrix4<double>& rest) {
  const Matrix4<double> posed = matrix * rest;
  Matrix4<double> rigid = posed;
  const Eigen::Vector3d y = posed.col(1).head<3>().normalized();
  const Eigen::Vector3d z = Eigen::Vector3d(posed.col(0).head<3>()).cross(y).normalized();
  rigid.topLeftCorner<3, 3>() << y.cross(z), y, z;
  const Matrix4<double> motion = rigid * rest.inverse();
  return {Eigen::Quaterniond(Eigen::Matrix3d(motion.topLeftCorner<3, 3>())), motion.topRightCorner<3, 1>(),
          motion.inverse() * matrix};
}

Eigen::MatrixX3d skin_dual_quaternion_in_frames(const Skin& skin, const Matrices& matrices, const Matrices& rest_frames,
                                                bool each) {
  Eigen::MatrixX3d positions(skin.vertex_count(), 3);
  for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
    const Eigen::Vector3d point = rest_position(skin, v);
    positions.row(v) = point;
    if (!is_moved(skin, v)) continue;
    Eigen::Quaterniond real(0, 0, 0, 0), dual(0, 0, 0, 0);
    Eigen::Vector3d stretched = Eigen::Vector3d::Zero();
    double weights = 0;
    for (auto i = skin.offsets()[v]; i < skin.offsets()[v + 1]; ++i) {
      const FrameMotion joint = frame_motion(matrices[skin.joints()[i]], rest_frames[skin.joints()[i]]);
      const double weight = skin.weights()[i];
      const Eigen::Vector3d own = (joint.stretch * point.homogeneous()).head<3>();
      // Where it is the joint's own matter, the point has gone to its stretched place before it is turned.
      const Eigen::Vector3d t = each ? joint.translation + joint.rotation * (own - point) : joint.translation;
      const Eigen::Quaterniond half = Eigen::Quaterniond(0, t.x() / 2, t.y() / 2, t.z() / 2) * joint.rotation;
      const double sign = real.dot(joint.rotation) < 0 ? -weight : weight;
      real.coeffs() += sign * joint.rotation.coeffs();
      dual.coeffs() += sign * half.coeffs();
      stretched += weight * own;
      weights += weight;
    }
    dual.coeffs() /= real.norm();
    real.normalize();
    positions.row(v) =
        real.toRotationMatrix() * (each ? point : stretched / weights) + 2 * (dual * real.conjugate()).vec();
  }
  return positions;
}

Eigen::MatrixX3d skin_rotation_centers(const Skin& skin, const Matrices& matrices, const Eigen::MatrixX3d& centers) {
  const std::vector<DualQuaternion> joints = dual_quaternions(matrices);
  const Eigen::MatrixXd dense = dense_weights(skin);
  Eigen::MatrixX3d positions = skin_linear(skin, matrices);
  for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
    if (!is_moved(skin, v) || std::isnan(centers(v, 0))) continue;
    const Eigen::Vector3d center = centers.row(v);
    Eigen::Vector3d moved = Eigen::Vector3d::Zero();
    for (std::ptrdiff_t j = 0; j < skin.joint_count(); ++j) {
      moved += dense(v, j) * (matrices[j] * center.homogeneous()).head<3>();
    }
    Eigen::Quaterniond sum(0, 0, 0, 0);
    Eigen::Matrix3d stretch = Eigen::Matrix3d::Zero();
    for (auto i = skin.offsets()[v]; i < skin.offsets()[v + 1]; ++i) {
      const DualQuaternion& joint = joints[skin.joints()[i]];
      sum.coeffs() += (sum.dot(joint.real) < 0 ? -1 : 1) * skin.weights()[i] * joint.real.coeffs();
      stretch += skin.weights()[i] * joint.stretch;
    }
    stretch /= dense.row(v).sum();
    positions.row(v) = moved + sum.normalized().toRotationMatrix() * stretch * (rest_position(skin, v) - center);
  }
  return positions;
}

Eigen::MatrixX3d rotation_centers(const Skin& skin, const std::vector<std::vector<std::int32_t>>& faces, double sigma) {
  const Eigen::MatrixXd weights = dense_weights(skin).cwiseMax(0);
  struct Triangle {
    double area;
    Eigen::Vector3d center;
    Eigen::RowVectorXd weights;
  };
  std::vector<Triangle> triangles;
  for (const auto& face : faces) {
    for (std::size_t i = 1; i + 1 < face.size(); ++i) {
      const std::int32_t a = face[0], b = face[i], c = face[i + 1];
      const Eigen::Vector3d p = rest_position(skin, a), q = rest_position(skin, b), r = rest_position(skin, c);
      triangles.push_back(
          {(q - p).cross(r - p).norm() / 2, (p + q + r) / 3, (weights.row(a) + weights.row(b) + weights.row(c)) / 3});
    }
  }
  Eigen::MatrixX3d centers(skin.vertex_count(), 3);
  for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    double total = 0;
    for (const Triangle& t : triangles) {
      double similarity = 0;
      for (std::ptrdiff_t j = 0; j < skin.joint_count(); ++j) {
        for (std::ptrdiff_t k = 0; k < skin.joint_count(); ++k) {
          const double product = weights(v, j) * weights(v, k) * t.weights(j) * t.weights(k);
          if (j == k || product == 0) continue;
          const double apart = weights(v, j) * t.weights(k) - weights(v, k) * t.weights(j);
          similarity += product * std::exp(-apart * apart / (sigma * sigma));
        }
      }
      sum += similarity * t.area * t.center;
      total += similarity * t.area;
    }
    centers.row(v) = sum / total;
  }
  return centers;
}

}  // namespace sinew::reference
