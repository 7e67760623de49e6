/// Fits rigid motions of joints to a clip, with weights fixed.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "decompose/clip.h"
#include "sinew/progress.h"

namespace sinew {

/// The influences of points, as many places for each.
struct WeightRows {
  std::size_t width = 0;
  std::vector<std::int32_t> joints;  ///< P x width
  std::vector<double> weights;       ///< P x width; 0: the place is free
};

/// Matrices of J joints in F frames, as rows for sums over frames: row 4 j + c is column c of joint j's, frame after frame.
class Motions {
 public:
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  using Matrix34 = Eigen::Matrix<double, 3, 4>;

  Motions() = default;
  Motions(std::ptrdiff_t frames, std::ptrdiff_t joints);  ///< at rest

  std::ptrdiff_t frames() const { return rows_.cols() / 3; }
  std::ptrdiff_t joints() const { return rows_.rows() / 4; }
  Matrix34 at(std::ptrdiff_t frame, std::ptrdiff_t joint) const {
    return rows_.block<4, 3>(4 * joint, 3 * frame).transpose();
  }
  void set(std::ptrdiff_t frame, std::ptrdiff_t joint, const Matrix34& matrix) {
    rows_.block<4, 3>(4 * joint, 3 * frame) = matrix.transpose();
  }
  const Rows& rows() const { return rows_; }

 private:
  Rows rows_;
};

/// Moments of points and weights, of which the fits need nothing else. Immutable.
class MotionFit {
 public:
  MotionFit(const Clip& clip, const WeightRows& weights, std::ptrdiff_t joints, const Progress* progress = nullptr);

  /// Improves all motions, joint after joint, `sweeps` times. The motions of joints without weight stay.
  void improve(Motions& motions, int sweeps, const Progress* progress) const;

  /// Sets each joint to the motion of its points alone, as if no other moved them.
  void fit_alone(Motions& motions, const Progress* progress = nullptr) const;

  /// The sum of squared weights of a joint.
  double mass(std::ptrdiff_t joint) const { return own_[joint](3, 3); }
  /// The mean rest position of its points by squared weights.
  Eigen::Vector3d centre(std::ptrdiff_t joint) const { return own_[joint].block<3, 1>(0, 3) / mass(joint); }

 private:
  struct Shared {
    std::int32_t joint;
    Eigen::Matrix4d moment;  // sum of w_j w_k (u, 1) (u, 1)^T over points of both
  };
  void improve_frame(Motions& motions, std::ptrdiff_t frame, int sweeps) const;

  std::vector<Eigen::Matrix4d> own_, alone_;  // J: sums of w^2 and of w (u, 1) (u, 1)^T
  std::vector<std::vector<Shared>> shared_;   // J: with other joints
  Motions::Rows moved_;                       // as Motions: sums of w x (u, 1)^T
};

}  // namespace sinew
