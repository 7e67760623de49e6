#include "decompose/motions.h"

#include <algorithm>

#include "base/cancelled.h"
#include "base/parallel.h"
#include "base/polar.h"

namespace sinew {
namespace {

/// So many numbers of each row are summed by one task.
constexpr std::size_t kColumns = 48;

constexpr std::size_t kPointsBetweenLooks = 4096;  // at whether the work is cancelled

/// A joint follows its points alone by this share, so that its motion is determined where others can stand in for it.
constexpr double kAlone = 1e-4;

/// And keeps its rotation by this share where its points do not determine one: on a line, or a single one.
constexpr double kKept = 1e-9;

/// Returns the rigid M that minimises sum |x - M (u, 1)|^2, from moments = sum of x (u, 1)^T and squares = sum of
/// (u, 1) (u, 1)^T.
Motions::Matrix34 rigid_fit(const Motions::Matrix34& moments, const Eigen::Matrix4d& squares,
                            const Motions::Matrix34& before) {
  const double sum = squares(3, 3);
  const Eigen::Vector3d from = squares.block<3, 1>(0, 3) / sum, to = moments.col(3) / sum;
  const Eigen::Matrix3d turn = moments.leftCols<3>() - sum * to * from.transpose() + kKept * sum * before.leftCols<3>();
  Motions::Matrix34 result;
  result.leftCols<3>() = nearest_rotation_to_any(turn);
  result.col(3) = to - result.leftCols<3>() * from;
  return result;
}

}  // namespace

Motions::Motions(std::ptrdiff_t frames, std::ptrdiff_t joints) : rows_(4 * joints, 3 * frames) {
  for (std::ptrdiff_t j = 0; j < joints; ++j) {
    for (std::ptrdiff_t f = 0; f < frames; ++f) set(f, j, Matrix34::Identity());
  }
}

MotionFit::MotionFit(const Clip& clip, const WeightRows& weights, std::ptrdiff_t joints, const Progress* progress)
    : own_(joints, Eigen::Matrix4d::Zero()),
      alone_(own_),
      shared_(joints),
      moved_(Motions::Rows::Zero(4 * joints, 3 * clip.frames)) {
  const auto points = static_cast<std::size_t>(clip.point_count());
  std::vector<std::vector<std::uint32_t>> places(joints);  // of each joint in the rows
  for (std::size_t i = 0; i < points * weights.width; ++i) {
    if (weights.weights[i] > 0) places[weights.joints[i]].push_back(static_cast<std::uint32_t>(i));
  }
  parallel_for(joints, 1, [&](std::size_t begin, std::size_t end) {
    std::vector<Eigen::Matrix4d> with(joints);
    std::vector<std::uint8_t> is_shared(joints);
    for (std::size_t j = begin; j < end; ++j) {
      stop_if_cancelled(progress);
      std::fill(with.begin(), with.end(), Eigen::Matrix4d::Zero());
      std::fill(is_shared.begin(), is_shared.end(), 0);
      for (const std::uint32_t place : places[j]) {
        const std::size_t point = place / weights.width;
        const double weight = weights.weights[place];
        const Eigen::Matrix4d outer = weight * clip.rest[point] * clip.rest[point].transpose();
        alone_[j] += outer;
        for (std::size_t i = point * weights.width; i < (point + 1) * weights.width; ++i) {
          if (weights.weights[i] == 0) continue;
          with[weights.joints[i]] += weights.weights[i] * outer;
          is_shared[weights.joints[i]] = 1;
        }
      }
      own_[j] = with[j];
      for (std::size_t k = 0; k < with.size(); ++k) {
        if (k != j && is_shared[k]) shared_[j].push_back({static_cast<std::int32_t>(k), with[k]});
      }
    }
  });

  parallel_for(clip.numbers(), kColumns, [&](std::size_t begin, std::size_t end) {
    for (std::size_t first = begin; first < end; first += kColumns) {
      const std::size_t count = std::min(kColumns, end - first);
      double row[kColumns];
      std::vector<double> sums(4 * joints * kColumns);
      for (std::size_t p = 0; p < points; ++p) {
        if (p % kPointsBetweenLooks == 0) stop_if_cancelled(progress);
        std::copy_n(clip.row(p) + first, count, row);
        for (std::size_t i = p * weights.width; i < (p + 1) * weights.width; ++i) {
          if (weights.weights[i] == 0) continue;
          for (int c = 0; c < 4; ++c) {
            const double factor = weights.weights[i] * clip.rest[p][c];
            double* const sum = sums.data() + (4 * weights.joints[i] + c) * kColumns;
            for (std::size_t k = 0; k < count; ++k) sum[k] += factor * row[k];
          }
        }
      }
      for (std::ptrdiff_t r = 0; r < 4 * joints; ++r) std::copy_n(sums.data() + r * kColumns, count, &moved_(r, first));
    }
  });
}

void MotionFit::improve_frame(Motions& motions, std::ptrdiff_t frame, int sweeps) const {
  const auto moved = [&](std::size_t j) -> Motions::Matrix34 {
    return moved_.block<4, 3>(4 * static_cast<Eigen::Index>(j), 3 * frame).transpose();
  };
  std::vector<Motions::Matrix34> own(own_.size());
  for (std::size_t j = 0; j < own.size(); ++j) own[j] = motions.at(frame, static_cast<std::ptrdiff_t>(j));
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    for (std::size_t j = 0; j < own.size(); ++j) {
      if (!(own_[j](3, 3) > 0)) continue;
      Motions::Matrix34 rest = (1 + kAlone) * moved(j);
      for (const Shared& other : shared_[j]) rest.noalias() -= own[other.joint] * other.moment;
      own[j] = rigid_fit(rest, own_[j] + kAlone * alone_[j], own[j]);
    }
  }
  for (std::size_t j = 0; j < own.size(); ++j) motions.set(frame, static_cast<std::ptrdiff_t>(j), own[j]);
}

void MotionFit::improve(Motions& motions, int sweeps, const Progress* progress) const {
  parallel_for(motions.frames(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) {
      stop_if_cancelled(progress);
      improve_frame(motions, static_cast<std::ptrdiff_t>(f), sweeps);
    }
  });
}

void MotionFit::fit_alone(Motions& motions, const Progress* progress) const {
  parallel_for(motions.frames(), 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) {
      stop_if_cancelled(progress);
      const auto frame = static_cast<std::ptrdiff_t>(f);
      for (std::ptrdiff_t j = 0; j < motions.joints(); ++j) {
        if (!(alone_[j](3, 3) > 0)) continue;
        const Motions::Matrix34 moved = moved_.block<4, 3>(4 * j, 3 * frame).transpose();
        motions.set(frame, j, rigid_fit(moved, alone_[j], motions.at(frame, j)));
      }
    }
  });
}

}  // namespace sinew
