#include "decompose/motions.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

namespace sinew {
namespace {

TEST(MotionFit, NeverReflects) {
  // A body that is its mirror image in the second frame: the nearest motion is a rotation all the same.
  std::mt19937 random(7);
  std::normal_distribution<float> draw;
  constexpr std::size_t kPoints = 40;
  std::vector<float> rest(3 * kPoints);
  for (float& number : rest) number = draw(random);
  std::vector<float> frames(rest);
  frames.insert(frames.end(), rest.begin(), rest.end());
  for (std::size_t p = 0; p < kPoints; ++p) frames[3 * (kPoints + p)] = -frames[3 * (kPoints + p)];
  const Clip clip(rest, frames, false, nullptr);
  const WeightRows weights{1, std::vector<std::int32_t>(kPoints), std::vector<double>(kPoints, 1)};
  Motions motions(2, 1);
  const MotionFit fit(clip, weights, 1);
  fit.fit_alone(motions);
  for (int sweeps = 0; sweeps < 2; ++sweeps) {
    for (std::ptrdiff_t f = 0; f < 2; ++f) {
      const Eigen::Matrix3d turn = motions.at(f, 0).leftCols<3>();
      EXPECT_NEAR(turn.determinant(), 1, 1e-9);
      EXPECT_LT((turn * turn.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-9);
    }
    EXPECT_LT((motions.at(0, 0).leftCols<3>() - Eigen::Matrix3d::Identity()).norm(), 1e-6);
    fit.improve(motions, 3, nullptr);
  }
}

}  // namespace
}  // namespace sinew
