#include "sinew/lattice.h"

#include <Eigen/LU>
#include <cmath>

#include "base/parallel.h"
#include "base/vertex_numbers.h"
#include "cages/lattice_kernel.h"

// CMakeLists.txt has this file compiled without fused multiply-adds: Blender rounds in between.

namespace sinew {
namespace {

// The approximate cost of a vertex on one thread.
constexpr double kMicroseconds = 3e-2;

constexpr std::size_t kPiece = 1024;

using Four = Eigen::Array4f;

/// Returns the polynomials of t, by the powers of t, that weigh the four points around a place between the second and
/// the third, at t of the way.
std::array<Four, 4> weights_of(Spline spline) {
  switch (spline) {
    case Spline::linear:
      return {Four(0, 1, 0, 0), Four(0, -1, 1, 0), Four::Zero(), Four::Zero()};
    case Spline::b_spline: {
      constexpr float kSixth = 0.16666666f;
      return {Four(kSixth, 0.66666666f, kSixth, 0), Four(-0.5f, 0, 0.5f, 0), Four(0.5f, -1, 0.5f, 0),
              Four(-kSixth, 0.5f, -0.5f, kSixth)};
    }
    default: {
      const float c = spline == Spline::cardinal ? 0.71f : 0.5f;
      return {Four(0, 1, 0, 0), Four(-c, 0, c, 0), Four(2 * c, c - 3, 3 - 2 * c, -c), Four(-c, 2 - c, c - 2, c)};
    }
  }
}

}  // namespace

/// The points along one axis that have an effect on a vertex: neighbours.
struct LatticePoints::Taps {
  std::int32_t first, count;
  std::array<float, LatticeBlock::kMost> weights;
};

LatticePoints::LatticePoints(const Grid& grid, std::span<const float> points, const Matrix4<float>& lattice_from_mesh,
                             std::span<const float> weights)
    : grid_(grid), lattice_from_mesh_(lattice_from_mesh), has_weights_(!weights.empty()) {
  std::ptrdiff_t count = 1;
  for (const std::int32_t own : grid.counts) {
    if (own < 1) fail("a lattice has ", own, " points along an axis; expected 1 or more");
    count *= own;
  }
  check_position_count("points", points, count);
  if (!lattice_from_mesh.allFinite()) fail("the matrix is not finite");
  for (int axis = 0; axis < 3; ++axis) {
    check_setting("first", grid.first[axis]);
    check_setting("step", grid.step[axis]);
    if (grid.counts[axis] > 1 && grid.step[axis] == 0) fail("step is 0 along an axis with more than one point");
    weights_[axis] = weights_of(grid.interpolation[axis]);
  }
  if (has_weights_) check_vertex_numbers("weights", weights, count, "the lattice");
  const Eigen::Matrix3f mesh_from_lattice =
      lattice_from_mesh.cast<double>().inverse().topLeftCorner<3, 3>().cast<float>();
  if (!mesh_from_lattice.allFinite()) fail("the matrix has no inverse");
  differences_.reserve(4 * (static_cast<std::size_t>(count) + LatticeBlock::kMost));
  std::size_t p = 0;
  Eigen::Vector3f rest;
  // Added up point by point, as in Blender.
  rest[2] = grid.first[2];
  for (std::int32_t w = 0; w < grid.counts[2]; ++w, rest[2] += grid.step[2]) {
    rest[1] = grid.first[1];
    for (std::int32_t v = 0; v < grid.counts[1]; ++v, rest[1] += grid.step[1]) {
      rest[0] = grid.first[0];
      for (std::int32_t u = 0; u < grid.counts[0]; ++u, rest[0] += grid.step[0], ++p) {
        const Eigen::Vector3f moved = mesh_from_lattice * (Eigen::Vector3f(points.data() + 3 * p) - rest);
        if (!moved.allFinite()) fail("points is not finite at point ", p);
        differences_.insert(differences_.end(), {moved.x(), moved.y(), moved.z(), has_weights_ ? weights[p] : 0});
      }
    }
  }
  differences_.resize(differences_.size() + LatticeBlock::kMost * LatticeBlock::kNumbers);  // for the last block
}

LatticePoints::Taps LatticePoints::taps_of(int axis, float place) const {
  const std::int32_t last = grid_.counts[axis] - 1;
  if (last == 0) return {0, 1, {1}};
  // Farther away all four points are the same one. What is not a number is there, too.
  const float along = std::max(-3.0f, std::min((place - grid_.first[axis]) / grid_.step[axis], last + 2.0f));
  auto cell = static_cast<std::int32_t>(along);
  if (static_cast<float>(cell) > along) --cell;
  const float t = along - static_cast<float>(cell);
  const auto& c = weights_[axis];
  const Four weights = c[0] + t * (c[1] + t * (c[2] + t * c[3]));
  const bool is_linear = grid_.interpolation[axis] == Spline::linear;
  const int begin = is_linear ? 1 : 0, end = is_linear ? 3 : 4;
  // Beyond an end of the lattice, its last point stands for the missing ones.
  const auto point = [&](int i) { return std::clamp(cell - 1 + i, 0, last); };
  Taps taps{point(begin), point(end - 1) - point(begin) + 1, {}};
  for (int i = begin; i < end; ++i) taps.weights[point(i) - taps.first] += weights[i];
  return taps;
}

void LatticePoints::move(float share, float* point) const {
  const auto& m = lattice_from_mesh_;
  std::array<Taps, 3> taps;
  for (int axis = 0; axis < 3; ++axis) {
    taps[axis] = taps_of(axis, point[0] * m(axis, 0) + point[1] * m(axis, 1) + m(axis, 2) * point[2] + m(axis, 3));
  }
  LatticeBlock block;
  block.row_size = LatticeBlock::kNumbers * grid_.counts[0];
  block.layer_size = block.row_size * grid_.counts[1];
  block.first = differences_.data() + LatticeBlock::kNumbers * taps[0].first + block.row_size * taps[1].first +
                block.layer_size * taps[2].first;
  for (int axis = 0; axis < 3; ++axis) block.counts[axis] = taps[axis].count;
  for (std::size_t i = 0; i < LatticeBlock::kMost; ++i) {
    Four::Map(block.along_u + LatticeBlock::kNumbers * i).setConstant(taps[0].weights[i]);
    block.along_v[i] = taps[1].weights[i];
    block.along_w[i] = taps[2].weights[i];
  }
  Four sum;
  sum_block(block, sum.data());
  sum *= share;
  if (!has_weights_) {
    for (int axis = 0; axis < 3; ++axis) point[axis] += sum[axis];
    return;
  }
  const float kept = sum[3];
  for (int axis = 0; axis < 3; ++axis) point[axis] = (1 - kept) * point[axis] + kept * (point[axis] + sum[axis]);
}

Lattice::Lattice(std::ptrdiff_t vertex_count, const VertexGroup& group) : vertex_count_(vertex_count) {
  if (vertex_count < 0) fail("the vertex count is ", vertex_count, "; expected 0 or more");
  const std::vector<float> weights = weights_of(group, vertex_count);
  for (std::size_t v = 0; v < weights.size(); ++v) {
    if (weights[v] <= 0) continue;
    vertices_.push_back(static_cast<std::uint32_t>(v));
    weights_.push_back(weights[v]);
  }
}

void Lattice::check(const Settings& settings) const {
  check_setting("strength", settings.strength);
  if (!settings.points) fail("a lattice has no points");
}

void Lattice::apply(const Settings& settings, std::span<float> positions) const {
  check_position_count("positions", positions, vertex_count());
  check(settings);
  const bool threads = threads_pay(kMicroseconds * static_cast<double>(vertices_.size()));
  parallel_for(vertices_.size(), threads ? kPiece : vertices_.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      settings.points->move(weights_[i] * settings.strength, positions.data() + 3 * std::size_t{vertices_[i]});
    }
  });
}

}  // namespace sinew
