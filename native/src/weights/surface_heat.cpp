#include <algorithm>

#include "weights/cotangents.h"
#include "weights/found_weights.h"
#include "weights/heat.h"

namespace sinew {
namespace {

// Of the mesh's size squared: points of triangles without extent have an area, too.
constexpr double kLeastArea = 1e-10;
// Smaller weights need not be exact, if they are not kept anyway.
constexpr double kNegligible = 1e-6;

}  // namespace

Lists<BoneWeight> heat_on_surface(std::span<const Eigen::Vector3d> points, std::span<const Triangle> triangles,
                                  std::span<const std::uint8_t> has_heat, const HeatSources& sources,
                                  const FixedPlaces& fixed, const HeatSettings& settings, Progress* progress,
                                  std::int64_t steps) {
  using SurfaceMatrix = Eigen::SparseMatrix<double>;
  std::vector<std::int32_t> unknown_of(points.size(), -1);
  std::vector<std::uint32_t> unknowns;
  for (std::uint32_t p = 0; p < points.size(); ++p) {
    if (!has_heat[p] || fixed.row_of[p] >= 0) continue;
    unknown_of[p] = static_cast<std::int32_t>(unknowns.size());
    unknowns.push_back(p);
  }
  if (unknowns.empty()) return FoundWeights(0).by_point(points.size());
  std::vector<double> diagonal(points.size());
  struct Known {
    std::uint32_t unknown, place;
    double value;
  };
  std::vector<Known> knowns;  // sides from an unknown to a given place
  std::vector<Eigen::Triplet<double>> numbers;
  const auto join = [&](std::uint32_t from, std::uint32_t to, double value) {
    diagonal[from] += value;
    diagonal[to] += value;
    const std::int32_t row = unknown_of[from], column = unknown_of[to];
    if (row >= 0 && column >= 0) numbers.emplace_back(std::max(row, column), std::min(row, column), -value);
    if (row >= 0 && column < 0) knowns.push_back({static_cast<std::uint32_t>(row), to, value});
    if (row < 0 && column >= 0) knowns.push_back({static_cast<std::uint32_t>(column), from, value});
  };
  const std::vector<double> areas = join_by_cotangents(points, triangles, 0, join);
  const auto count = static_cast<Eigen::Index>(unknowns.size());
  std::vector<double> heat(unknowns.size());
  for (std::size_t u = 0; u < unknowns.size(); ++u) {
    const std::uint32_t p = unknowns[u];
    const double distance = sources.nearest.distances[p];
    heat[u] = std::max(areas[p], kLeastArea) * settings.stiffness / (distance * distance);
    numbers.emplace_back(u, u, diagonal[p] + heat[u]);
  }
  SurfaceMatrix matrix(count, count);
  matrix.setFromTriplets(numbers.begin(), numbers.end());
  set_free(numbers);
  stop_if_cancelled(progress);
  PanelSolver solver(matrix, progress);
  matrix = {};
  if (progress) progress->advance(steps / 2);

  Lists<Source> of_joint(static_cast<std::size_t>(sources.joint_count), [&](const auto& add) {
    for (std::uint32_t u = 0; u < unknowns.size(); ++u) {
      sources.at(unknowns[u], [&](std::int32_t joint, double share) { add(joint, {u, heat[u] * share}); });
    }
    for (const Known& known : knowns) {
      for (const auto& [joint, weight] : fixed.rows.row(fixed.row_of[known.place])) {
        add(joint, {known.unknown, known.value * weight});
      }
    }
  });
  const double negligible = std::min(kNegligible, settings.least / 10);
  FoundWeights found =
      solve_by_bone(std::move(solver), std::move(of_joint), negligible, unknowns, progress, steps - steps / 2,
                    [&](std::size_t, double weight) { return weight >= settings.least && as_weight(weight) > 0; });
  return std::move(found).by_point(points.size());
}

}  // namespace sinew
