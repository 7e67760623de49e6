#include <algorithm>
#include <cmath>
#include <memory>

#include "base/kept.h"
#include "base/parallel.h"
#include "sinew/lists.h"
#include "weights/found_weights.h"
#include "weights/heat.h"

namespace sinew {
namespace {

constexpr int kMostIterations = 1000;
constexpr double kTolerance = 1e-6;  // of the right-hand side
// Cells are left out beyond those where all weights are below this share of the least that is kept. At first those farther
// than so many steps from where the joints heat.
constexpr double kCut = 0.1;
constexpr int kFirstSteps = 8;

/// L + H of the cells.
class VolumeMatrix {
 public:
  VolumeMatrix(const VoxelSolid& solid, const NearestBones& nearest, double stiffness)
      : neighbours_(solid.size()), heat_(solid.size()), diagonal_(solid.size()) {
    const auto& strides = solid.grid().strides();
    const double voxel = solid.grid().voxel();
    for (std::size_t i = 0; i < solid.size(); ++i) {
      const double distance = nearest.distances[i] / voxel;
      heat_[i] = stiffness / (distance * distance);
      diagonal_[i] = heat_[i];
      for (int side = 0; side < 6; ++side) {
        const std::int32_t offset = side % 2 ? strides[side / 2] : -strides[side / 2];
        neighbours_[i][side] = solid.index_of(solid.cells()[i] + offset);
        diagonal_[i] += neighbours_[i][side] >= 0;
      }
    }
  }
  std::size_t size() const { return heat_.size(); }
  double heat(std::size_t i) const { return heat_[i]; }
  double diagonal(std::size_t i) const { return diagonal_[i]; }
  const std::array<std::int32_t, 6>& neighbours(std::size_t i) const { return neighbours_[i]; }

 private:
  std::vector<std::array<std::int32_t, 6>> neighbours_;
  std::vector<double> heat_, diagonal_;
};

/// Some of the cells, and the values there; elsewhere they are 0. One object for each thread.
class Region {
 public:
  explicit Region(const VolumeMatrix& matrix) : matrix_(matrix), place_of_(matrix.size(), -1) {}

  void clear() {
    for (const std::int32_t cell : cells_) place_of_[cell] = -1;
    cells_.clear();
    grown_ = 0;
  }
  void add(std::size_t cell) {
    if (place_of_[cell] >= 0) return;
    place_of_[cell] = static_cast<std::int32_t>(cells_.size());
    cells_.push_back(static_cast<std::int32_t>(cell));
  }
  /// Adds what is no farther than so many steps from what was there before the last growth; all, if it is much.
  void grow(int steps) {
    for (; steps > 0 && grown_ < cells_.size(); --steps) {
      const std::size_t end = cells_.size();
      for (; grown_ < end; ++grown_) {
        for (const std::int32_t other : matrix_.neighbours(cells_[grown_])) {
          if (other >= 0) add(other);
        }
      }
    }
    for (std::size_t cell = 0; cells_.size() > matrix_.size() / 3 && cell < matrix_.size(); ++cell) add(cell);
  }
  std::span<const std::int32_t> cells() const { return cells_; }
  /// Returns the place of a cell in cells(), or -1.
  std::int32_t place_of(std::size_t cell) const { return place_of_[cell]; }

  /// Whether a value beside what is left out is above `most`.
  bool is_cut(std::span<const Lanes> values, double most) const {
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      if ((values[i] <= most).all()) continue;
      for (const std::int32_t other : matrix_.neighbours(cells_[i])) {
        if (other >= 0 && place_of_[other] < 0) return true;
      }
    }
    return false;
  }

  /// Conjugate gradients for each lane alone, preconditioned by the diagonal. values  the right-hand sides, then the
  /// solution.
  void solve(std::vector<Lanes>& values, const Progress* progress) {
    const std::size_t count = cells_.size();
    residual_ = values;
    direction_.resize(count);
    product_.resize(count);
    neighbours_.resize(count);
    diagonal_.resize(count);
    const Lanes zero = Lanes::Zero();
    Lanes rho = zero, start = zero;
    for (std::size_t i = 0; i < count; ++i) {
      for (int side = 0; side < 6; ++side) {
        const std::int32_t other = matrix_.neighbours(cells_[i])[side];
        neighbours_[i][side] = other < 0 ? -1 : place_of_[other];
      }
      diagonal_[i] = matrix_.diagonal(cells_[i]);
      direction_[i] = residual_[i] / diagonal_[i];
      rho += residual_[i] * direction_[i];
      values[i].setZero();
    }
    start = rho;
    for (int iteration = 0; iteration < kMostIterations; ++iteration) {
      const auto is_active = (rho > kTolerance * kTolerance * start).eval();  // lanes that are done keep their values
      if (!is_active.any()) return;
      stop_if_cancelled(progress);
      Lanes curvature = zero;
      for (std::size_t i = 0; i < count; ++i) {
        Lanes product = diagonal_[i] * direction_[i];
        for (const std::int32_t other : neighbours_[i]) {
          if (other >= 0) product -= direction_[other];
        }
        product_[i] = product;
        curvature += direction_[i] * product;
      }
      const Lanes step = (is_active && curvature > 0).select(rho / curvature, zero);
      Lanes next = zero;
      for (std::size_t i = 0; i < count; ++i) {
        values[i] += step * direction_[i];
        residual_[i] -= step * product_[i];
        next += residual_[i] * residual_[i] / diagonal_[i];
      }
      const Lanes factor = is_active.select(next / rho, zero);
      for (std::size_t i = 0; i < count; ++i) direction_[i] = residual_[i] / diagonal_[i] + factor * direction_[i];
      rho = is_active.select(next, rho);
    }
  }

 private:
  const VolumeMatrix& matrix_;
  std::vector<std::int32_t> place_of_, cells_;
  std::size_t grown_ = 0;
  std::vector<std::array<std::int32_t, 6>> neighbours_;
  std::vector<double> diagonal_;
  std::vector<Lanes> residual_, direction_, product_;
};

/// Interpolates between the centres of the cells around a point.
Lanes value_at(const VoxelSolid& solid, const Region& region, const Eigen::Vector3d& point,
               std::span<const Lanes> values) {
  Lanes sum = Lanes::Zero();
  double weights = 0;
  solid.around(point, [&](std::int32_t index, double weight) {
    if (const std::int32_t place = region.place_of(index); place >= 0) sum += weight * values[place];
    weights += weight;
  });
  if (weights > 0) sum /= weights;
  return sum;
}

}  // namespace

Lists<BoneWeight> heat_in_volume(const VoxelSolid& solid, const HeatSources& sources,
                                 std::span<const Eigen::Vector3d> points, std::span<const std::uint32_t> wanted,
                                 const HeatSettings& settings, Progress* progress, std::int64_t steps) {
  const VolumeMatrix matrix(solid, sources.nearest, settings.stiffness);
  const std::int32_t joints = sources.joint_count;
  const std::size_t blocks = (static_cast<std::size_t>(joints) + kLanes - 1) / kLanes;
  const Lists<std::uint32_t> cells_of(blocks, [&](const auto& add) {  // that the joints of each block heat
    for (std::uint32_t cell = 0; cell < matrix.size(); ++cell) {
      sources.at(cell, [&](std::int32_t joint, double) { add(static_cast<std::size_t>(joint / kLanes), cell); });
    }
  });
  FoundWeights found(static_cast<std::size_t>(joints));
  Kept<Region> regions;
  parallel_for(blocks, 1, [&](std::size_t begin, std::size_t end) {
    const auto region = regions.borrow([&] { return std::make_unique<Region>(matrix); });
    std::vector<Lanes> values;
    for (std::size_t block = begin; block < end; ++block) {
      const auto first = static_cast<std::int32_t>(block) * kLanes, lanes = std::min(kLanes, joints - first);
      region->clear();
      for (const std::uint32_t cell : cells_of[block]) region->add(cell);
      for (int growth = kFirstSteps;; growth *= 2) {
        region->grow(growth);
        values.assign(region->cells().size(), Lanes::Zero());
        for (std::size_t i = 0; i < values.size(); ++i) {
          const std::int32_t cell = region->cells()[i];
          sources.at(cell, [&](std::int32_t joint, double share) {
            if (joint >= first && joint < first + lanes) values[i][joint - first] += share;
          });
          values[i] *= matrix.heat(cell);
        }
        region->solve(values, progress);
        if (!region->is_cut(values, kCut * settings.least)) break;
      }
      for (const std::uint32_t place : wanted) {
        const Lanes weights = value_at(solid, *region, points[place], values);
        for (int lane = 0; lane < lanes; ++lane) {
          const double weight = weights[lane];
          if (!(weight >= settings.least) || !(as_weight(weight) > 0)) continue;
          found.add(static_cast<std::size_t>(first + lane), place, weight);
        }
      }
      advance_share(progress, steps, block, blocks);
    }
  });
  return std::move(found).by_point(points.size());
}

}  // namespace sinew
