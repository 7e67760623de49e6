#include "skinning/rigid_and_stretch.h"

#include <algorithm>
#include <cmath>

#include "base/polar.h"
#include "skinning/split_kernel.h"

namespace sinew {
namespace {

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

/// Copies one number of each joint; the last joint fills the places that are left over.
template <class T, class Read>
void gather(std::span<const std::int32_t> joints, const Read& read, OfEach<T> (&rows)[3][4]) {
  for (std::size_t i = 0; i < kSplitTogether; ++i) {
    const auto& matrix = read(joints[std::min(i, joints.size() - 1)]);
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) rows[row][column].joint[i] = matrix(row, column);
    }
  }
}

RigidAndStretch motion_of(const SplitMotions& split, std::size_t i) {
  const auto quaternion = [i](const OfEach<float>(&parts)[4]) {
    return Eigen::Quaternionf(parts[0].joint[i], parts[1].joint[i], parts[2].joint[i], parts[3].joint[i]);
  };
  RigidAndStretch motion{.real = quaternion(split.real), .dual = quaternion(split.dual)};
  motion.is_rigid = split.is_rigid.joint[i] != 0;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      motion.displacement(row, column) = split.displacement[row][column].joint[i];
  }
  return motion;
}

void split_in_frames(MatrixStack<const float> matrices, std::ptrdiff_t frame,
                     std::span<const Matrix4<double>> rest_frames, std::span<const std::int32_t> joints,
                     std::span<RigidAndStretch> motions) {
  MotionsToSplit given;
  SplitMotions split;
  for (std::size_t first = 0; first < joints.size(); first += kSplitTogether) {
    const auto some = joints.subspan(first, std::min(kSplitTogether, joints.size() - first));
    gather(
        some, [&](std::int32_t j) { return matrices.at(frame, j); }, given.matrix);
    gather(
        some, [&](std::int32_t j) -> const Matrix4<double>& { return rest_frames[j]; }, given.rest);
    const auto from_rest = [&](std::int32_t j) -> Matrix4<float> { return rest_frames[j].cast<float>().inverse(); };
    gather(some, from_rest, given.from_rest);
    split_motions(given, split);
    for (std::size_t i = 0; i < some.size(); ++i) motions[first + i] = motion_of(split, i);
  }
}

}  // namespace

void split(MatrixStack<const float> matrices, std::ptrdiff_t frame, const StretchRule& rule,
           std::span<const std::int32_t> joints, std::span<RigidAndStretch> motions) {
  if (rule.stretch != Stretch::polar) return split_in_frames(matrices, frame, rule.rest_frames, joints, motions);
  for (std::size_t i = 0; i < joints.size(); ++i) motions[i] = split_polar(matrices.at(frame, joints[i]));
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
