/// Leaves one vertex fewer weights.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "decompose/simplex_least_squares.h"
#include "sinew/types.h"
#include "sinew/weight_table.h"

namespace sinew {

/// How far a vertex moves over the poses.
struct Move {
  float largest, mean;
};

/// One vertex: where its bones take it in the poses. One object for each thread.
class VertexReduction {
 public:
  VertexReduction(std::span<const float> positions, MatrixStack<const double> matrices,
                  std::span<const std::uint8_t> is_locked, int most)
      : positions_(positions), matrices_(matrices), is_locked_(is_locked), most_(most) {}

  /// Adds the vertex's new row, and returns how far it moves by it.
  Move run(std::size_t v, std::span<const BoneWeight> row, WeightTable& rows);
  /// Measures how far the vertex moves by weights that have become others.
  Move measure(std::size_t v, std::span<const BoneWeight> before, std::span<const BoneWeight> after);

 private:
  Move moved(const Eigen::VectorXd& own) const;
  /// Reads the bones that are not locked.
  void read(std::size_t v, std::span<const BoneWeight> row);
  double largest(const Eigen::VectorXd& shares) const;
  Eigen::VectorXd normalized(const std::vector<int>& kept) const;
  /// The largest squared move with a sum of places and shares, or any number above `most` if it is above that.
  double largest_within(const Eigen::VectorXd& sum, double share, double most);
  /// The kept weights for which the largest move is smallest; among equals, those that keep more weight.
  std::vector<int> choose(int most);
  Eigen::VectorXd fit(const std::vector<int>& kept, const Eigen::VectorXd& near);

  std::span<const float> positions_;
  MatrixStack<const double> matrices_;
  std::span<const std::uint8_t> is_locked_;
  std::ptrdiff_t most_;
  std::vector<std::int32_t> bones_;  // of the vertex that are not locked
  Eigen::VectorXd shares_;           // of these bones
  Eigen::MatrixXd places_;           // where each bone takes it, less where all do
  double sum_ = 0, free_share_ = 1;  // of their weights; that in all weights
  Eigen::Index worst_ = 0;
  Eigen::VectorXd sum_of_places_, without_;
  std::vector<BoneWeight> row_;
  SimplexLeastSquares solver_;
};

}  // namespace sinew
