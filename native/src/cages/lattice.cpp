#include "sinew/lattice.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>

#include "base/parallel.h"
#include "base/vertex_numbers.h"
#include "cages/lattice_kernel.h"

// CMakeLists.txt has this file compiled without fused multiply-adds: Blender rounds in between.

namespace sinew {
namespace {

// The approximate cost of a vertex on one thread.
constexpr double kMicrosecondsInLattice = 1.2e-2;

constexpr std::size_t kVerticesPerTask = 1024;

using FourWeights = std::array<float, LatticeField::kMost>;

/// Returns the polynomials of t, by the powers of t, that weigh the four points around a place between the second and
/// the third, at t of the way; of a linear spline those of these two, then zeros.
std::array<FourWeights, 4> weights_of(Spline spline) {
  switch (spline) {
    case Spline::linear:
      return {FourWeights{1}, FourWeights{-1, 1}, FourWeights{}, FourWeights{}};
    case Spline::b_spline: {
      constexpr float kSixth = 0.16666666f;
      return {FourWeights{kSixth, 0.66666666f, kSixth}, FourWeights{-0.5f, 0, 0.5f}, FourWeights{0.5f, -1, 0.5f},
              FourWeights{-kSixth, 0.5f, -0.5f, kSixth}};
    }
    default: {
      const float c = spline == Spline::cardinal ? 0.71f : 0.5f;
      return {FourWeights{0, 1}, FourWeights{-c, 0, c}, FourWeights{2 * c, c - 3, 3 - 2 * c, -c},
              FourWeights{-c, 2 - c, c - 2, c}};
    }
  }
}

/// How often the last point stands for those that are missing beyond an end of an axis.
std::int32_t repeats_of(const LatticeField::Axis& axis) { return static_cast<std::int32_t>(axis.taps) - 1; }

LatticeField::Axis axis_of(const LatticePoints::Grid& grid, int axis, const Matrix4<float>& lattice_from_mesh) {
  LatticeField::Axis made{};
  for (int i = 0; i < 4; ++i) made.from_mesh[i] = lattice_from_mesh(axis, i);
  made.first = grid.first[axis];
  if (grid.counts[axis] == 1) {
    made.step = 1;
    made.taps = 1;
    made.weights[0][0] = 1;
    return made;
  }
  made.step = grid.step[axis];
  made.taps = grid.interpolation[axis] == Spline::linear ? 2 : 4;
  const auto half = static_cast<std::int32_t>(made.taps / 2);
  made.lowest = static_cast<float>(-half);
  made.highest = static_cast<float>(grid.counts[axis] - 2 + half);
  made.before = half - 1 - repeats_of(made);
  const std::array<FourWeights, 4> weights = weights_of(grid.interpolation[axis]);
  for (std::size_t power = 0; power < 4; ++power) std::ranges::copy(weights[power], made.weights[power]);
  return made;
}

/// Returns the field's points. own  P x kNumbers, those of the lattice.
std::vector<float> with_repeated_ends(const LatticeField& field, const std::array<std::int32_t, 3>& counts,
                                      const std::vector<float>& own) {
  constexpr std::ptrdiff_t kNumbers = LatticeField::kNumbers;
  const auto& [u, v, w] = field.axes;
  std::vector<float> points;
  points.reserve(w.stride * static_cast<std::size_t>(counts[2] + 2 * repeats_of(w)) + LatticeField::kMost * kNumbers);
  for (std::int32_t k = -repeats_of(w); k < counts[2] + repeats_of(w); ++k) {
    for (std::int32_t j = -repeats_of(v); j < counts[1] + repeats_of(v); ++j) {
      const auto begin = own.begin() + kNumbers * counts[0] *
                                           (std::ptrdiff_t{counts[1]} * std::clamp(k, 0, counts[2] - 1) +
                                            std::clamp(j, 0, counts[1] - 1));
      const auto end = begin + kNumbers * counts[0];
      for (int i = 0; i < repeats_of(u); ++i) points.insert(points.end(), begin, begin + kNumbers);
      points.insert(points.end(), begin, end);
      for (int i = 0; i < repeats_of(u); ++i) points.insert(points.end(), end - kNumbers, end);
    }
  }
  points.resize(points.size() + LatticeField::kMost * LatticeField::kNumbers);  // the last are read as one of kMost
  return points;
}

}  // namespace

LatticePoints::LatticePoints(const Grid& grid, std::span<const float> points, const Matrix4<float>& lattice_from_mesh,
                             std::span<const float> weights) {
  std::ptrdiff_t count = 1;
  for (const std::int32_t own : grid.counts) {
    if (own < 1) fail("counts has ", own, " points along an axis; expected 1 or more");
    if (count <= kMostVertices) count *= own;  // so that it cannot overflow
  }
  if (count > kMostVertices) fail("counts makes more than ", plural(kMostVertices, "point"), "; expected fewer");
  check_position_count("points", points, count);
  if (!lattice_from_mesh.allFinite()) fail("the matrix is not finite");
  for (int axis = 0; axis < 3; ++axis) {
    check_setting("first", grid.first[axis]);
    check_setting("step", grid.step[axis]);
    if (grid.counts[axis] > 1 && grid.step[axis] == 0) fail("step is 0 along an axis with more than one point");
  }
  if (!weights.empty()) check_vertex_numbers("weights", weights, count, "the lattice");
  const Eigen::Matrix3f mesh_from_lattice =
      lattice_from_mesh.cast<double>().inverse().topLeftCorner<3, 3>().cast<float>();
  if (!mesh_from_lattice.allFinite()) fail("the matrix has no inverse");

  auto field = std::make_shared<LatticeField>();
  field->has_weights = !weights.empty();
  std::size_t size = LatticeField::kNumbers;
  for (int axis = 0; axis < 3; ++axis) {
    LatticeField::Axis& own = field->axes[axis] = axis_of(grid, axis, lattice_from_mesh);
    own.stride = size;
    size *= static_cast<std::size_t>(grid.counts[axis] + 2 * repeats_of(own));
  }
  std::vector<float> differences;
  differences.reserve(LatticeField::kNumbers * static_cast<std::size_t>(count));
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
        differences.insert(differences.end(), {moved.x(), moved.y(), moved.z(), field->has_weights ? weights[p] : 0});
      }
    }
  }
  field->points = with_repeated_ends(*field, grid.counts, differences);
  field_ = std::move(field);
}

Lattice::Lattice(std::ptrdiff_t vertex_count, const VertexGroup& group) : vertex_count_(vertex_count) {
  check_vertex_count(vertex_count);
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

double Lattice::microseconds(const Settings&) const {
  return kMicrosecondsInLattice * static_cast<double>(vertices_.size());
}

void Lattice::apply(const Settings& settings, std::span<float> positions) const {
  check_position_count("positions", positions, vertex_count());
  check(settings);
  const bool threads = threads_pay(microseconds(settings));
  parallel_for(vertices_.size(), threads ? kVerticesPerTask : vertices_.size(),
               [&](std::size_t begin, std::size_t end) {
                 move_vertices(settings.points->field(), std::span(vertices_).subspan(begin, end - begin),
                               weights_.data() + begin, settings.strength, positions.data());
               });
}

}  // namespace sinew
