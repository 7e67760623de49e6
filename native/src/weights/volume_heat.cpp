#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "weights/heat.h"
#include "weights/panel_solver.h"

namespace sinew {
namespace {

constexpr int kMostIterations = 1000;
constexpr double kTolerance = 1e-6;  // of the right-hand side

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
  Lanes row_times(std::size_t i, std::span<const Lanes> values) const {
    Lanes sum = diagonal_[i] * values[i];
    for (const std::int32_t neighbour : neighbours_[i]) {
      if (neighbour >= 0) sum -= values[neighbour];
    }
    return sum;
  }

 private:
  std::vector<std::array<std::int32_t, 6>> neighbours_;
  std::vector<double> heat_, diagonal_;
};

/// Conjugate gradients for each lane alone, preconditioned by the diagonal. values  the right-hand sides, then the
/// solution.
void solve(const VolumeMatrix& matrix, std::vector<Lanes>& values, const Progress* progress) {
  const std::size_t count = matrix.size();
  std::vector<Lanes> residual(values), direction(count), product(count);
  const Lanes zero = Lanes::Zero();
  Lanes rho = zero, start = zero;
  for (std::size_t i = 0; i < count; ++i) {
    direction[i] = residual[i] / matrix.diagonal(i);
    rho += residual[i] * direction[i];
    values[i].setZero();
  }
  start = rho;
  for (int iteration = 0; iteration < kMostIterations; ++iteration) {
    const auto is_active = (rho > kTolerance * kTolerance * start).eval();  // lanes that are done keep their values
    if (!is_active.any()) return;
    stop_if_cancelled(progress);
    Lanes curvature = zero;
    for (std::size_t i = 0; i < count; ++i) {
      product[i] = matrix.row_times(i, direction);
      curvature += direction[i] * product[i];
    }
    const Lanes step = (is_active && curvature > 0).select(rho / curvature, zero);
    Lanes next = zero;
    for (std::size_t i = 0; i < count; ++i) {
      values[i] += step * direction[i];
      residual[i] -= step * product[i];
      next += residual[i] * residual[i] / matrix.diagonal(i);
    }
    const Lanes factor = is_active.select(next / rho, zero);
    for (std::size_t i = 0; i < count; ++i) direction[i] = residual[i] / matrix.diagonal(i) + factor * direction[i];
    rho = is_active.select(next, rho);
  }
}

/// Interpolates between the centres of the cells around a point.
Lanes value_at(const VoxelSolid& solid, const Eigen::Vector3d& point, std::span<const Lanes> values) {
  Lanes sum = Lanes::Zero();
  double weights = 0;
  solid.around(point, [&](std::int32_t index, double weight) {
    sum += weight * values[index];
    weights += weight;
  });
  if (weights > 0) sum /= weights;
  return sum;
}

}  // namespace

std::vector<WeightEntry> heat_in_volume(const VoxelSolid& solid, const HeatSources& sources,
                                        std::span<const Eigen::Vector3d> points, std::span<const std::uint32_t> wanted,
                                        const HeatSettings& settings, Progress* progress, std::int64_t steps) {
  const VolumeMatrix matrix(solid, sources.nearest, settings.stiffness);
  const std::int32_t joints = sources.joint_count;
  const std::size_t blocks = (static_cast<std::size_t>(joints) + kLanes - 1) / kLanes;
  std::vector<std::vector<WeightEntry>> found(joints);
  parallel_for(blocks, 1, [&](std::size_t begin, std::size_t end) {
    std::vector<Lanes> values;
    for (std::size_t block = begin; block < end; ++block) {
      const auto first = static_cast<std::int32_t>(block) * kLanes, lanes = std::min(kLanes, joints - first);
      values.assign(matrix.size(), Lanes::Zero());
      for (std::size_t i = 0; i < values.size(); ++i) {
        sources.add_shares(i, first, lanes, values[i].data());
        values[i] *= matrix.heat(i);
      }
      solve(matrix, values, progress);
      for (const std::uint32_t place : wanted) {
        const Lanes weights = value_at(solid, points[place], values);
        for (int lane = 0; lane < lanes; ++lane) {
          if (!(weights[lane] >= settings.least)) continue;
          found[first + lane].push_back({place, first + lane, static_cast<float>(weights[lane])});
        }
      }
      const auto own = static_cast<std::int64_t>(block), all = static_cast<std::int64_t>(blocks);
      if (progress) progress->advance(steps * (own + 1) / all - steps * own / all);
    }
  });
  std::vector<WeightEntry> result;
  for (auto& of_joint : found) {
    result.insert(result.end(), of_joint.begin(), of_joint.end());
    of_joint = {};
  }
  return result;
}

}  // namespace sinew
