#include "sinew/pose_clip.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/check.h"

namespace sinew {
namespace {

Eigen::Quaterniond from_euler_degrees(double x, double y, double z) {
  constexpr double kRadians = std::numbers::pi / 180;
  return Eigen::AngleAxisd(z * kRadians, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(y * kRadians, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(x * kRadians, Eigen::Vector3d::UnitX());
}

}  // namespace

PoseClip::PoseClip(std::ptrdiff_t joint_count, std::vector<Eigen::Quaterniond> rotations)
    : joint_count_(joint_count), rotations_(std::move(rotations)) {
  const auto total = static_cast<std::ptrdiff_t>(rotations_.size());
  if (joint_count <= 0 || total == 0 || total % joint_count != 0) {
    fail("there are ", plural(total, "rotation"), " for ", plural(joint_count, "joint"),
         "; expected one per joint for each of at least one pose");
  }
  pose_count_ = total / joint_count;
  for (std::ptrdiff_t i = 0; i < total; ++i) {
    const double length = rotations_[i].norm();
    if (!std::isfinite(length) || length < 1e-9) {
      fail("the quaternion of joint ", i % joint_count, " in pose ", i / joint_count, " has length ", length,
           "; expected 1");
    }
    rotations_[i].coeffs() /= length;
  }
}

PoseClip PoseClip::from_table(const Eigen::MatrixXd& table, std::ptrdiff_t joint_count, QuaternionOrder order) {
  const bool euler = table.rows() == 3 * joint_count;
  if (!euler && table.rows() != 4 * joint_count) {
    fail("there are ", plural(table.rows(), "number"), " per pose; expected ", 3 * joint_count, " (Euler angles) or ",
         4 * joint_count, " (quaternions) for ", plural(joint_count, "joint"));
  }
  std::vector<Eigen::Quaterniond> rotations;
  rotations.reserve(table.cols() * joint_count);
  for (Eigen::Index pose = 0; pose < table.cols(); ++pose) {
    for (std::ptrdiff_t j = 0; j < joint_count; ++j) {
      if (euler) {
        const auto angles = table.col(pose).segment<3>(3 * j);
        rotations.push_back(from_euler_degrees(angles[0], angles[1], angles[2]));
      } else {
        const auto q = table.col(pose).segment<4>(4 * j);
        rotations.push_back(order == QuaternionOrder::wxyz ? Eigen::Quaterniond(q[0], q[1], q[2], q[3])
                                                           : Eigen::Quaterniond(q[3], q[0], q[1], q[2]));
      }
    }
  }
  return PoseClip(joint_count, std::move(rotations));
}

Eigen::MatrixXd PoseClip::to_table() const {
  Eigen::MatrixXd table(4 * joint_count_, pose_count_);
  for (std::ptrdiff_t pose = 0; pose < pose_count_; ++pose) {
    for (std::ptrdiff_t j = 0; j < joint_count_; ++j) {
      const Eigen::Quaterniond& q = rotations_[pose * joint_count_ + j];
      table.col(pose).segment<4>(4 * j) << q.w(), q.x(), q.y(), q.z();
    }
  }
  return table;
}

void PoseClip::sample(double time, bool loop, std::span<Eigen::Quaterniond> rotations) const {
  if (!std::isfinite(time)) fail("the time of a pose is ", time, "; expected a finite number");
  if (static_cast<std::ptrdiff_t>(rotations.size()) != joint_count_) {
    fail("the result holds ", plural(rotations.size(), "rotation"), "; the clip has ", plural(joint_count_, "joint"));
  }
  const auto poses = static_cast<double>(pose_count_);
  double wrapped = loop ? std::fmod(time, poses) : std::clamp(time, 0.0, poses - 1);
  if (wrapped < 0) wrapped += poses;
  // Rounding may carry a tiny negative time to `poses` itself.
  const auto before = std::min(static_cast<std::ptrdiff_t>(wrapped), pose_count_ - 1);
  const auto after = loop ? (before + 1) % pose_count_ : std::min(before + 1, pose_count_ - 1);
  const double blend = wrapped - static_cast<double>(before);
  for (std::ptrdiff_t j = 0; j < joint_count_; ++j) {
    rotations[j] = rotations_[before * joint_count_ + j].slerp(blend, rotations_[after * joint_count_ + j]);
  }
}

template <class T>
void rotation_transforms(std::span<const Eigen::Quaterniond> rotations, MatrixStack<T> local) {
  const auto count = static_cast<std::ptrdiff_t>(rotations.size());
  if (local.frames != 1 || local.joints != count) {
    fail("the result holds ", local.frames, " x ", local.joints, " matrices; expected 1 x ", count);
  }
  for (std::ptrdiff_t j = 0; j < count; ++j) {
    Matrix4<double> transform = Matrix4<double>::Identity();
    transform.topLeftCorner<3, 3>() = rotations[j].toRotationMatrix();
    local.at(0, j) = transform.cast<T>();
  }
}

template void rotation_transforms(std::span<const Eigen::Quaterniond>, MatrixStack<float>);
template void rotation_transforms(std::span<const Eigen::Quaterniond>, MatrixStack<double>);

}  // namespace sinew
