#include <algorithm>
#include <cassert>
#include <numeric>

#include "base/set_free.h"
#include "mesh/adjacency.h"
#include "sinew/weight_tools.h"
#include "weight_tools/check_tables.h"
#include "weights/found_weights.h"

namespace sinew {
namespace {

constexpr std::size_t kSmoothedPoints = 512;  // in a task

/// Weights below this share of their vertex's sum are left out; after a solve, which reaches everywhere, more of them.
constexpr double kLeastSmoothed = 1e-6, kLeastSolved = 1e-5;

/// Steps of the progress: of a solve, and of what follows it or the steps.
constexpr std::int64_t kSolveSteps = 100, kFinishSteps = 20;

/// Adds what has been summed, without what is too little; the others get its share.
void add_row(RowSum& sum, double total, WeightTable& rows) {
  const auto row = sum.take();
  const double least = kLeastSmoothed * total;
  double kept = 0;
  for (const BoneWeight& own : row) kept += own.weight >= least ? own.weight : 0.0;
  for (const BoneWeight& own : row) {
    if (own.weight >= least) sum.add(own.bone, own.weight);
  }
  rows.add_row(sum.take(kept > 0 ? total / kept : 1));
}

class Smoothing {
 public:
  Smoothing(const WeightTable& weights, const Faces& faces, const SmoothWeightsSettings& settings, Progress* progress)
      : weights_(weights),
        settings_(settings),
        progress_(progress),
        is_locked_(checked_locked(settings.locked, bones())) {
    std::vector<std::uint32_t> first(static_cast<std::size_t>(weights.vertices()));
    std::iota(first.begin(), first.end(), 0u);
    for_coincident(settings.positions, [&](std::span<const std::uint32_t> vertices) {
      for (const std::uint32_t v : vertices) first[v] = vertices.front();
    });
    std::size_t points = 0;
    std::tie(point_of_, points) = points_of(first);
    neighbours_ = neighbours_by_sides(faces, point_of_, points);
    rate_.assign(points, 1);
    for (std::size_t v = 0; v < settings.mask.size(); ++v) {
      rate_[point_of_[v]] = std::min(rate_[point_of_[v]], settings.mask[v]);
    }
    rows_ = points < point_of_.size() ? means_of_coincident() : weights;
  }

  WeightTable run() {
    if (progress_) progress_->start((settings_.strength > 0 ? kSolveSteps : settings_.steps) + kFinishSteps);
    if (settings_.strength > 0) {
      solve();
    } else {
      for (int step = 0; step < settings_.steps; ++step) take_step();
    }
    return of_vertices();
  }

 private:
  std::size_t bones() const { return static_cast<std::size_t>(weights_.bones()); }
  std::size_t points() const { return neighbours_.size(); }

  /// The mean weights of vertices that coincide.
  WeightTable means_of_coincident() const {
    const Lists<std::uint32_t> vertices(points(), [&](const auto& add) {
      for (std::uint32_t v = 0; v < point_of_.size(); ++v) add(point_of_[v], v);
    });
    RowSum sum(bones());
    WeightTable rows(weights_.bones());
    for (std::size_t p = 0; p < points(); ++p) {
      for (const std::uint32_t v : vertices[p]) sum.add(weights_.row(v), 1.0 / static_cast<double>(vertices[p].size()));
      rows.add_row(sum.take());
    }
    return rows;
  }

  void take_step() {
    const auto make = [&](std::size_t begin, std::size_t end, WeightTable& rows) {
      RowSum sum(bones());
      for (std::size_t p = begin; p < end; ++p) {
        const double share = settings_.factor * rate_[p];
        if (neighbours_[p].empty() || share == 0) {
          rows.add_row(rows_.row(p));
          continue;
        }
        sum.add(rows_.row(p), 1 - share);
        const double of_each = share / static_cast<double>(neighbours_[p].size());
        for (const std::uint32_t other : neighbours_[p]) sum.add(rows_.row(other), of_each);
        add_row(sum, sum.total(), rows);
      }
    };
    rows_ = table_of_rows(points(), weights_.bones(), kSmoothedPoints, progress_, 1, make);
  }

  /// (D + t (D - A)) w' = D w, with the neighbours A and how many they are, D: symmetric.
  void solve() {
    std::vector<std::int32_t> number(points(), -1);
    std::vector<std::uint32_t> free;
    for (std::uint32_t p = 0; p < points(); ++p) {
      if (rate_[p] < 0.5f || neighbours_[p].empty()) continue;
      number[p] = static_cast<std::int32_t>(free.size());
      free.push_back(p);
    }
    if (free.empty()) {
      if (progress_) progress_->advance(kSolveSteps);
      return;
    }
    const double t = settings_.strength;
    std::vector<Eigen::Triplet<double>> entries;
    for (const std::uint32_t p : free) {
      entries.emplace_back(number[p], number[p], (1 + t) * static_cast<double>(neighbours_[p].size()));
      for (const std::uint32_t other : neighbours_[p]) {
        if (number[other] >= 0 && number[other] < number[p]) entries.emplace_back(number[p], number[other], -t);
      }
    }
    Eigen::SparseMatrix<double> lower(std::ssize(free), std::ssize(free));
    lower.setFromTriplets(entries.begin(), entries.end());
    set_free(entries);
    PanelSolver solver(lower, progress_);
    lower = {};
    assert(solver.is_positive());

    std::vector<double> sums(free.size());  // of the right-hand sides over all bones
    Lists<Source> sources(bones(), [&](const auto& add) {
      for (std::uint32_t row = 0; row < free.size(); ++row) {
        const std::uint32_t p = free[row];
        sums[row] = 0;
        const auto add_all = [&](std::uint32_t from, double factor) {
          for (const BoneWeight& own : rows_.row(from)) {
            add(own.bone, {row, factor * own.weight});
            sums[row] += factor * own.weight;
          }
        };
        add_all(p, static_cast<double>(neighbours_[p].size()));
        for (const std::uint32_t other : neighbours_[p]) {
          if (number[other] < 0) add_all(other, t);
        }
      }
    });
    const std::vector<double> totals = solver.solved(sums);
    double least_total = std::numeric_limits<double>::infinity();
    for (const double total : totals) least_total = total > 0 ? std::min(least_total, total) : least_total;
    const auto keep = [&](std::size_t row, double weight) {
      return weight >= kLeastSolved * totals[row] && weight > 0;
    };
    FoundWeights found = solve_by_bone(std::move(solver), std::move(sources), kLeastSolved / 10 * least_total, free,
                                       progress_, kSolveSteps, keep);
    const Lists<BoneWeight> solved = std::move(found).by_point(points());
    const auto make = [&](std::size_t begin, std::size_t end, WeightTable& rows) {
      RowSum sum(bones());
      for (std::size_t p = begin; p < end; ++p) {
        if (number[p] < 0) {
          rows.add_row(rows_.row(p));
        } else {
          sum.add(solved[p], 1);
          add_row(sum, totals[number[p]], rows);
        }
      }
    };
    rows_ = table_of_rows(points(), weights_.bones(), kSmoothedPoints, progress_, 0, make);
  }

  WeightTable of_vertices() {
    if (settings_.locked.empty() && points() == point_of_.size()) {
      if (progress_) progress_->advance(kFinishSteps);
      return std::move(rows_);
    }
    const auto make = [&](std::size_t begin, std::size_t end, WeightTable& rows) {
      RowSum sum(bones());
      for (std::size_t v = begin; v < end; ++v) {
        const std::size_t point = point_of_[v];
        const auto own = weights_.row(v), smooth = rows_.row(point);
        if (rate_[point] == 0 || neighbours_[point].empty()) {
          rows.add_row(own);
          continue;
        }
        double before = 0, after = 0;
        for (const BoneWeight& one : own) before += is_locked_[one.bone] ? 0.0 : one.weight;
        for (const BoneWeight& one : smooth) after += is_locked_[one.bone] ? 0.0 : one.weight;
        if (!settings_.locked.empty() && !(after > 0)) {
          rows.add_row(own);
          continue;
        }
        const double scale = settings_.locked.empty() ? 1 : before / after;
        for (const BoneWeight& one : own) sum.add(one.bone, is_locked_[one.bone] ? one.weight : 0.0);
        for (const BoneWeight& one : smooth) sum.add(one.bone, is_locked_[one.bone] ? 0.0 : scale * one.weight);
        rows.add_row(sum.take());
      }
    };
    return table_of_rows(point_of_.size(), weights_.bones(), kSmoothedPoints, progress_, kFinishSteps, make);
  }

  const WeightTable& weights_;
  const SmoothWeightsSettings& settings_;
  Progress* const progress_;
  std::vector<std::uint8_t> is_locked_;
  std::vector<std::uint32_t> point_of_;  // V: one for all vertices that coincide
  Lists<std::uint32_t> neighbours_;      // of each point
  std::vector<float> rate_;              // of each point
  WeightTable rows_;                     // of each point
};

}  // namespace

std::optional<WeightTable> smooth_weights(const WeightTable& weights, const Faces& faces,
                                          const SmoothWeightsSettings& settings, Progress* progress) {
  check_faces(faces, weights.vertices());
  check_mask(settings.mask, weights.vertices());
  if (!settings.positions.empty()) check_positions("positions", settings.positions, weights.vertices());
  check_range("strength", settings.strength, 0, 1e6);
  check_range("steps", settings.steps, 0, 10000);
  check_range("factor", settings.factor, 0, 1);
  try {
    return Smoothing(weights, faces, settings, progress).run();
  } catch (const Cancelled&) {
    return std::nullopt;
  }
}

}  // namespace sinew
