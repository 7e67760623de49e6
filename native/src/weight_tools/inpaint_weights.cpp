#include "weight_tools/inpaint_weights.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "base/set_free.h"
#include "weights/cotangents.h"
#include "weights/found_weights.h"

namespace sinew {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

/// Solved weights below are left out; those that are nearer to 0 do not even count.
constexpr double kLeast = 1e-4, kNothing = 1e-6;

/// Cotangents are clamped to this at least, so that everything is connected.
constexpr double kLeastCotangent = 0.01;

/// The matrix of the square has so many entries at most, times points, and more.
constexpr double kMostEntries = 100, kMoreEntries = 2e6;

constexpr std::size_t kPoints = 128;  // in a task

Sparse lower_of(const Sparse& matrix) { return matrix.triangularView<Eigen::Lower>(); }

/// The Laplacian of cotangents and the areas of points. Sides without a triangle connect, too.
Sparse laplacian(const WeldedMesh& mesh, const Faces& faces, Eigen::VectorXd& areas) {
  const auto count = std::ssize(mesh.points);
  std::vector<Eigen::Triplet<double>> entries;  // of the lower triangle
  entries.reserve(3 * mesh.triangles.size() + mesh.points.size());
  Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(count);
  const auto join = [&](std::uint32_t a, std::uint32_t b, double value) {
    entries.emplace_back(std::max(a, b), std::min(a, b), -value);
    diagonal[a] += value;
    diagonal[b] += value;
  };
  const std::vector<double> own_areas = join_by_cotangents(mesh.points, mesh.triangles, kLeastCotangent, join);
  areas = Eigen::VectorXd::Map(own_areas.data(), count);
  std::vector<std::uint8_t> has_triangle(mesh.points.size());
  for (const Triangle& own : mesh.triangles) {
    for (const std::uint32_t p : own) has_triangle[p] = 1;
  }
  for_sides(faces, [&](std::size_t, std::int32_t from, std::int32_t to) {
    const std::uint32_t a = mesh.point_of[from], b = mesh.point_of[to];
    if (a != b && !(has_triangle[a] && has_triangle[b])) join(a, b, 0.5 * kLeastCotangent);
  });
  areas = areas.array().max(1e-3 * areas.mean() + std::numeric_limits<double>::min());
  for (Eigen::Index p = 0; p < count; ++p) entries.emplace_back(p, p, diagonal[p]);
  Sparse lower(count, count);
  lower.setFromTriplets(entries.begin(), entries.end());
  set_free(entries);
  return lower.selfadjointView<Eigen::Lower>();
}

/// A system whose solutions are the weights of the open points.
struct System {
  std::optional<PanelSolver> solver;
  Sparse right;  // of the open points, by bone
};

/// pick  those of all points that are open. known  the rows of the others, by bone, negated.
System system_of(const WeldedMesh& mesh, const Faces& faces, const Sparse& pick, const Sparse& known,
                 Progress* progress) {
  Eigen::VectorXd areas;
  const Sparse all = laplacian(mesh, faces, areas);
  stop_if_cancelled(progress);
  double entries = 0;
  for (Eigen::Index p = 0; p < all.cols(); ++p) {
    const double own = all.outerIndexPtr()[p + 1] - all.outerIndexPtr()[p];
    entries += own * own;
  }
  System system;
  if (entries <= kMostEntries * static_cast<double>(all.cols()) + kMoreEntries) {
    Sparse lower;
    {
      const Sparse of_open = all * pick;
      stop_if_cancelled(progress);
      Sparse weighted = of_open.transpose();
      for (Eigen::Index p = 0; p < weighted.cols(); ++p) {  // Eigen's product moves all entries for each
        for (Sparse::InnerIterator it(weighted, p); it; ++it) it.valueRef() *= 1 / areas[p];
      }
      system.right = weighted * (all * known);
      stop_if_cancelled(progress);
      lower = lower_of(weighted * of_open);
    }
    system.solver.emplace(lower, progress);
  }
  if (!system.solver || !system.solver->is_positive()) {  // without the square, which is always positive
    const Sparse of_open = pick.transpose() * all;
    system.right = of_open * known;
    system.solver.emplace(lower_of(of_open * pick), progress);
  }
  return system;
}

}  // namespace

void inpaint_weights(const WeldedMesh& mesh, const Faces& faces, WeightTable& rows, Progress* progress,
                     std::int64_t steps) {
  const std::size_t points = mesh.points.size();
  std::vector<std::uint8_t> is_known(static_cast<std::size_t>(mesh.part_count));
  for (std::size_t p = 0; p < points; ++p) is_known[mesh.part_of[p]] |= !rows.row(p).empty();
  std::vector<std::uint32_t> open;
  std::vector<Eigen::Triplet<double>> picks, knowns;
  for (std::uint32_t p = 0; p < points; ++p) {
    for (const BoneWeight& own : rows.row(p)) knowns.emplace_back(p, own.bone, -own.weight);
    if (!rows.row(p).empty() || !is_known[mesh.part_of[p]]) continue;
    picks.emplace_back(p, static_cast<int>(open.size()), 1.0);
    open.push_back(p);
  }
  if (open.empty()) return;
  Sparse pick(std::ssize(mesh.points), std::ssize(open)), known(std::ssize(mesh.points), rows.bones());
  pick.setFromTriplets(picks.begin(), picks.end());
  known.setFromTriplets(knowns.begin(), knowns.end());
  set_free(picks);
  set_free(knowns);
  System system = system_of(mesh, faces, pick, known, progress);
  const std::int64_t factor_steps = steps / 5;
  if (progress) progress->advance(factor_steps);
  if (!system.solver->is_positive()) return;
  const auto bones = static_cast<std::size_t>(rows.bones());
  Lists<Source> sources(bones, [&](const auto& add) {
    for (std::size_t bone = 0; bone < bones; ++bone) {
      for (Sparse::InnerIterator it(system.right, static_cast<Eigen::Index>(bone)); it; ++it) {
        add(bone, {static_cast<std::uint32_t>(it.row()), it.value()});
      }
    }
  });
  system.right = {};
  const auto keep = [](std::size_t, double weight) { return std::abs(weight) >= kNothing; };
  FoundWeights found =
      solve_by_bone(std::move(*system.solver), std::move(sources), 0, open, progress, steps - factor_steps, keep);
  const Lists<BoneWeight> solved = std::move(found).by_point(points);
  rows = table_of_rows(points, rows.bones(), kPoints, progress, 0, [&](auto begin, auto end, auto& made) {
    RowSum sum(bones);
    Eigen::VectorXd own;
    for (std::size_t p = begin; p < end; ++p) {
      if (solved[p].empty()) {
        made.add_row(rows.row(p));
        continue;
      }
      own.resize(std::ssize(solved[p]));
      std::ranges::transform(solved[p], own.begin(), &BoneWeight::weight);
      project_on_simplex(own);
      for (Eigen::Index i = 0; i < own.size(); ++i) {
        if (own[i] >= kLeast) sum.add(solved[p][static_cast<std::size_t>(i)].bone, own[i]);
      }
      const double total = sum.total();
      made.add_row(sum.take(total > 0 ? 1 / total : 0));
    }
  });
}

void project_on_simplex(Eigen::Ref<Eigen::VectorXd> numbers) {
  std::vector<double> sorted(numbers.begin(), numbers.end());
  std::sort(sorted.begin(), sorted.end(), std::greater<>());
  double sum = 0, shift = 0;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    sum += sorted[i];
    const double own = (sum - 1) / static_cast<double>(i + 1);
    if (sorted[i] > own) shift = own;
  }
  numbers = (numbers.array() - shift).max(0.0);
}

}  // namespace sinew
