/// Weights that are found bone by bone, and wanted point by point.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "base/set_free.h"
#include "sinew/lists.h"
#include "weights/panel_solver.h"
#include "weights/weight_rows.h"

namespace sinew {

/// Several threads may add, each for other bones.
class FoundWeights {
 public:
  explicit FoundWeights(std::size_t bones) : of_bone_(bones) {}

  /// The points of a bone may come in any order, each once.
  void add(std::size_t bone, std::uint32_t point, double weight) {
    of_bone_[bone].emplace_back(point, as_weight(weight));
  }

  /// Returns the weights of each point, bones ascending.
  Lists<BoneWeight> by_point(std::size_t points) && {
    Lists<BoneWeight> rows(points, [&](const auto& add) {
      for (std::size_t bone = 0; bone < of_bone_.size(); ++bone) {
        for (const auto& [point, weight] : of_bone_[bone]) add(point, {static_cast<std::int32_t>(bone), weight});
      }
    });
    set_free(of_bone_);
    return rows;
  }

 private:
  std::vector<std::vector<std::pair<std::uint32_t, float>>> of_bone_;
};

/// A number of a right-hand side.
struct Source {
  std::uint32_t row;
  double value;
};

/// Solves for each bone that has sources; those of the same row are added. Returns what keep(row, weight) keeps. Solver and
/// sources are freed then: with many points, each takes as much memory as what is found.
/// point_of  of each row. negligible  see PanelSolver::solve. The progress is advanced by `steps`.
template <class Keep>
FoundWeights solve_by_bone(PanelSolver solver, Lists<Source> sources, double negligible,
                           std::span<const std::uint32_t> point_of, Progress* progress, std::int64_t steps,
                           const Keep& keep) {
  std::vector<std::size_t> used;
  for (std::size_t bone = 0; bone < sources.size(); ++bone) {
    if (!sources[bone].empty()) used.push_back(bone);
  }
  FoundWeights found(sources.size());
  solve_panels(
      solver, used.size(), negligible, progress, steps,
      [&](std::size_t first, std::size_t lanes, PanelSolver::Scratch& scratch) {
        for (std::size_t lane = 0; lane < lanes; ++lane) {
          for (const auto& [row, value] : sources[used[first + lane]]) {
            scratch.values[solver.position(row)][static_cast<Eigen::Index>(lane)] += value;
          }
        }
      },
      [&](std::size_t first, std::size_t lanes, const PanelSolver::Scratch& scratch) {
        for (std::size_t row = 0; row < point_of.size(); ++row) {
          const Lanes& values = scratch.values[solver.position(row)];
          for (std::size_t lane = 0; lane < lanes; ++lane) {
            const double value = values[static_cast<Eigen::Index>(lane)];
            if (keep(row, value)) found.add(used[first + lane], point_of[row], value);
          }
        }
      });
  return found;
}

}  // namespace sinew
