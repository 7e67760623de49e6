#include <algorithm>
#include <cmath>
#include <optional>

#include "base/parallel.h"
#include "weights/heat.h"
#include "weights/panel_solver.h"

namespace sinew {
namespace {

constexpr double kMostCotangent = 20;
// Of the mesh's size squared: points of triangles without extent have an area, too.
constexpr double kLeastArea = 1e-10;
// Smaller weights need not be exact, if they are not kept anyway.
constexpr double kNegligible = 1e-6;

/// cot / 2 at the corner between two sides, not negative and bounded.
double half_cotangent(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double along = a.dot(b), across = a.cross(b).norm();
  if (along <= 0) return 0;
  if (along >= kMostCotangent * across) return kMostCotangent / 2;
  return along / across / 2;
}

}  // namespace

void heat_on_surface(std::span<const Eigen::Vector3d> points, std::span<const Triangle> triangles,
                     std::span<const std::uint8_t> has_heat, const HeatSources& sources, const FixedPlaces& fixed,
                     const HeatSettings& settings, Progress* progress, std::int64_t steps,
                     std::vector<WeightEntry>& entries) {
  using Matrix = Eigen::SparseMatrix<double>;
  std::vector<std::int32_t> unknown_of(points.size(), -1);
  std::vector<std::uint32_t> unknowns;
  for (std::uint32_t p = 0; p < points.size(); ++p) {
    if (!has_heat[p] || fixed.row_of[p] >= 0) continue;
    unknown_of[p] = static_cast<std::int32_t>(unknowns.size());
    unknowns.push_back(p);
  }
  if (unknowns.empty()) return;
  std::vector<double> areas(points.size()), diagonal(points.size());
  struct Known {
    std::uint32_t unknown, place;
    double value;
  };
  std::vector<Known> knowns;  // sides from an unknown to a given place
  std::vector<Eigen::Triplet<double>> numbers;
  for (const Triangle& triangle : triangles) {
    if (!has_heat[triangle[0]]) continue;
    const Eigen::Vector3d &a = points[triangle[0]], &b = points[triangle[1]], &c = points[triangle[2]];
    const double area = (b - a).cross(c - a).norm() / 6;
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t at = triangle[i], from = triangle[(i + 1) % 3], to = triangle[(i + 2) % 3];
      areas[at] += area;
      const double value = half_cotangent(points[from] - points[at], points[to] - points[at]);
      diagonal[from] += value;
      diagonal[to] += value;
      const std::int32_t row = unknown_of[from], column = unknown_of[to];
      if (row >= 0 && column >= 0) numbers.emplace_back(std::max(row, column), std::min(row, column), -value);
      if (row >= 0 && column < 0) knowns.push_back({static_cast<std::uint32_t>(row), to, value});
      if (row < 0 && column >= 0) knowns.push_back({static_cast<std::uint32_t>(column), from, value});
    }
  }
  const auto count = static_cast<Eigen::Index>(unknowns.size());
  std::vector<double> heat(unknowns.size());
  for (std::size_t u = 0; u < unknowns.size(); ++u) {
    const std::uint32_t p = unknowns[u];
    const double distance = sources.nearest.distances[p];
    heat[u] = std::max(areas[p], kLeastArea) * settings.stiffness / (distance * distance);
    numbers.emplace_back(u, u, diagonal[p] + heat[u]);
  }
  Matrix matrix(count, count);
  matrix.setFromTriplets(numbers.begin(), numbers.end());
  set_free(numbers);
  stop_if_cancelled(progress);
  std::optional<PanelSolver> factor(std::in_place, matrix, progress);
  const PanelSolver& solver = *factor;
  matrix = {};
  if (progress) progress->advance(steps / 2);

  const double negligible = std::min(kNegligible, settings.least / 10);
  const std::int32_t joints = sources.joint_count;
  FoundWeights found(joints);
  const auto fill = [&](std::size_t first_joint, std::size_t lanes, PanelSolver::Scratch& scratch) {
    const auto first = static_cast<std::int32_t>(first_joint), end = first + static_cast<std::int32_t>(lanes);
    for (std::size_t u = 0; u < unknowns.size(); ++u) {
      Lanes& values = scratch.values[solver.position(u)];
      sources.add_shares(unknowns[u], first, end - first, values.data());
      values *= heat[u];
    }
    for (const Known& known : knowns) {
      Lanes& values = scratch.values[solver.position(known.unknown)];
      for (const auto& [joint, weight] : fixed.rows.row(fixed.row_of[known.place])) {
        if (joint >= first && joint < end) values[joint - first] += known.value * weight;
      }
    }
  };
  const auto read = [&](std::size_t first, std::size_t lanes, const PanelSolver::Scratch& scratch) {
    for (std::size_t u = 0; u < unknowns.size(); ++u) {
      const Lanes& values = scratch.values[solver.position(u)];
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        if (!(values[lane] >= settings.least) || values[lane] == 0) continue;
        found.add(static_cast<std::int32_t>(first + lane), unknowns[u], values[lane]);
      }
    }
  };
  solve_panels(solver, static_cast<std::size_t>(joints), negligible, progress, steps - steps / 2, fill, read);
  factor.reset();
  found.move_to(entries);
}

}  // namespace sinew
