/// Skeletons, poses and skins to try things on, and matrices in every layout.
#pragma once

#include <algorithm>
#include <numbers>
#include <numeric>
#include <random>
#include <vector>

#include "reference.h"
#include "sinew/skeleton.h"
#include "sinew/skin.h"

namespace sinew::rigs {

using Random = std::mt19937;
using reference::Matrices;

inline constexpr double kDiagonal = 2 * std::numbers::sqrt3;  // of the box that skins fill

double uniform(Random& random, double low, double high);

Eigen::Vector3d vector(Random& random, double size);

Matrix4<double> rigid(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation);

Matrix4<double> turn(double degrees, const Eigen::Vector3d& axis,
                     const Eigen::Vector3d& translation = Eigen::Vector3d::Zero());

/// Turns, moves and scales alike.
Matrix4<double> similarity();

/// A similarity with one axis stretched and sheared.
Matrix4<double> sheared();

Matrix4<double> random_rigid(Random& random, double size = 1);

Matrices random_pose(Random& random, std::ptrdiff_t count, double size = 1);

Matrices identities(std::ptrdiff_t count);

/// 0 <- 1 <- 2 ...
std::vector<std::int32_t> chain(std::int32_t count);

/// Every joint has `children` children: few levels, wide ones.
std::vector<std::int32_t> bushy_tree(std::int32_t count, std::int32_t children);

/// Several roots, and numbers that say nothing about the order: parents come after their children.
std::vector<std::int32_t> random_forest(Random& random, std::int32_t count);

/// Puts a skin together, vertex by vertex: positions in a box of 2 x 2 x 2, weights that sum to 1.
class SkinMaker {
 public:
  void add_vertex(Random& random) {
    for (int axis = 0; axis < 3; ++axis) {
      positions_.push_back(static_cast<float>(uniform(random, -1, 1)));
    }
    offsets_.push_back(offsets_.back());
  }
  /// Of the vertex added last, once.
  void set_influences(const std::vector<std::int32_t>& joints, const std::vector<double>& weights) {
    const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
    joints_.insert(joints_.end(), joints.begin(), joints.end());
    for (const double weight : weights) weights_.push_back(static_cast<float>(weight / sum));
    offsets_.back() = static_cast<std::int64_t>(joints_.size());
  }
  Skin skin(std::int32_t joint_count) const { return Skin(positions_, offsets_, joints_, weights_, joint_count); }

 private:
  std::vector<float> positions_, weights_;
  std::vector<std::int64_t> offsets_{0};
  std::vector<std::int32_t> joints_;
};

/// Vertex v has v % 16 influences, so vertex 0 has none. Joints may repeat.
Skin random_skin(Random& random, std::ptrdiff_t vertices, std::int32_t joints);

/// A skin like a real one: neighbouring vertices share joints. Vertex v has `influences` of them,
/// beginning at v / 48, in random order; every 37th vertex has none, which leaves it at rest.
Skin coherent_skin(Random& random, std::ptrdiff_t vertices, std::int32_t joints, std::int32_t influences);

enum class Layout { column_major, row_major, padded, backwards };
constexpr Layout kLayouts[] = {Layout::column_major, Layout::row_major, Layout::padded, Layout::backwards};

/// Owns the memory of F x J matrices in one of the layouts.
template <class T>
class Stack {
 public:
  Stack(std::ptrdiff_t frames, std::ptrdiff_t joints, Layout layout = Layout::column_major)
      : view_{nullptr, frames, joints, 16 * joints, 16, 1, 4} {
    if (layout == Layout::row_major) std::swap(view_.row_stride, view_.column_stride);
    if (layout == Layout::padded) view_ = {nullptr, frames, joints, 45 * joints + 7, 45, 11, 3};
    memory_.assign(std::max<std::ptrdiff_t>(1, frames * view_.frame_stride), T{-77});
    view_.data = memory_.data();
    if (layout == Layout::backwards && frames * joints > 0) {
      view_.data += (frames - 1) * view_.frame_stride + (joints - 1) * view_.joint_stride;
      view_.frame_stride = -view_.frame_stride;
      view_.joint_stride = -view_.joint_stride;
    }
  }
  /// `matrices` frame after frame.
  Stack(const Matrices& matrices, std::ptrdiff_t frames, Layout layout = Layout::column_major)
      : Stack(frames, static_cast<std::ptrdiff_t>(matrices.size()) / frames, layout) {
    for (std::ptrdiff_t i = 0; i < static_cast<std::ptrdiff_t>(matrices.size()); ++i) {
      view_.at(i / view_.joints, i % view_.joints) = matrices[i].cast<T>();
    }
  }
  Stack(const Stack&) = delete;

  MatrixStack<T> view() { return view_; }
  MatrixStack<const T> read() { return view_; }

  /// Frame after frame, whatever the layout.
  std::vector<Matrix4<T>> matrices() const {
    std::vector<Matrix4<T>> result;
    for (std::ptrdiff_t frame = 0; frame < view_.frames; ++frame) {
      for (std::ptrdiff_t j = 0; j < view_.joints; ++j) result.push_back(view_.at(frame, j));
    }
    return result;
  }

 private:
  std::vector<T> memory_;
  MatrixStack<T> view_;
};

/// What float32 made of them: the matrices that a frame function really sees.
Matrices through_float(const Matrices& matrices);

/// The largest coordinate of a - b, where a is V x 3 row by row; NaN if there is one in either.
double distance(const std::vector<float>& a, const Eigen::MatrixX3d& b);

}  // namespace sinew::rigs
