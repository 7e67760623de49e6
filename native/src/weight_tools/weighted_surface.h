/// A surface whose weights are read at its points.
#pragma once

#include <cstdint>
#include <vector>

#include "mesh/triangles.h"
#include "weights/triangle_tree.h"
#include "weights/weight_rows.h"

namespace sinew {

class WeightedSurface {
 public:
  /// points  of all vertices, in any space.
  /// triangles  with three different vertices, at least one. weights  kept as a reference.
  WeightedSurface(std::vector<Eigen::Vector3d> points, std::vector<Triangle> triangles, const WeightTable& weights,
                  const Progress* progress)
      : points_(std::move(points)),
        triangles_(std::move(triangles)),
        weights_(weights),
        tree_(points_, triangles_, progress, false) {}
  WeightedSurface(const WeightedSurface&) = delete;
  WeightedSurface& operator=(const WeightedSurface&) = delete;

  const TriangleTree& tree() const { return tree_; }
  const std::vector<Eigen::Vector3d>& points() const { return points_; }
  const std::vector<Triangle>& triangles() const { return triangles_; }
  const Triangle& triangle(const SurfacePoint& at) const { return triangles_[at.triangle]; }

  /// Adds the weights there.
  void read(const SurfacePoint& at, RowSum& sum) const {
    for (int i = 0; i < 3; ++i) {
      if (at.shares[i] > 0) sum.add(weights_.row(triangle(at)[i]), at.shares[i]);
    }
  }

 private:
  std::vector<Eigen::Vector3d> points_;
  std::vector<Triangle> triangles_;
  const WeightTable& weights_;
  TriangleTree tree_;
};

}  // namespace sinew
