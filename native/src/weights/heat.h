/// Heat diffusion on a surface and in a solid.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/set_free.h"
#include "sinew/weight_table.h"
#include "weights/bone_distances.h"

namespace sinew {

/// Weights that are large enough to keep.
struct WeightEntry {
  std::uint32_t place;
  std::int32_t joint;
  float weight;
};

/// Weights as they are found, joint by joint: several threads may add, each for other joints.
class FoundWeights {
 public:
  explicit FoundWeights(std::int32_t joint_count) : of_joint_(joint_count) {}

  void add(std::int32_t joint, std::uint32_t place, double weight) {
    of_joint_[joint].push_back({place, static_cast<float>(weight)});
  }

  /// Moves them to the end of a list, in the order of the joints.
  void move_to(std::vector<WeightEntry>& entries) {
    std::size_t total = entries.size();
    for (const auto& found : of_joint_) total += found.size();
    entries.reserve(total);
    for (std::size_t joint = 0; joint < of_joint_.size(); ++joint) {
      for (const Found& own : of_joint_[joint]) {
        entries.push_back({own.place, static_cast<std::int32_t>(joint), own.weight});
      }
      set_free(of_joint_[joint]);
    }
  }

 private:
  struct Found {
    std::uint32_t place;
    float weight;
  };
  std::vector<std::vector<Found>> of_joint_;
};

/// The sources of heat at places, by joint.
struct HeatSources {
  const NearestBones& nearest;
  std::span<const std::int32_t> joints;  ///< of each bone
  std::int32_t joint_count;

  /// Adds the shares of the joints from `first` on to `shares`, which has `count` numbers.
  void add_shares(std::size_t place, std::int32_t first, std::int32_t count, double* shares) const {
    for (std::uint32_t i = nearest.begin[place]; i < nearest.begin[place + 1]; ++i) {
      const std::int32_t joint = joints[nearest.bones[i]] - first;
      if (joint >= 0 && joint < count) shares[joint] += nearest.shares[i];
    }
  }
};

struct HeatSettings {
  double stiffness;
  double least;  ///< weights below are not returned
};

/// Places whose weights are given.
struct FixedPlaces {
  std::vector<std::int32_t> row_of;  ///< of each place in rows, or -1
  WeightTable rows;
};

/// Solves (L + A H) w = A H p on the triangles for the places that have one.
/// has_heat  of each place, whether it is on such a triangle.
/// progress  advanced by `steps` in total.
/// entries   gets the weights, in the order of the joints.
void heat_on_surface(std::span<const Eigen::Vector3d> points, std::span<const Triangle> triangles,
                     std::span<const std::uint8_t> has_heat, const HeatSources& sources, const FixedPlaces& fixed,
                     const HeatSettings& settings, Progress* progress, std::int64_t steps,
                     std::vector<WeightEntry>& entries);

/// Solves (L + H) u = H p in the cells of a solid and reads the result at points.
/// sources  of the cells.
/// entries  gets the weights, in the order of the joints.
void heat_in_volume(const VoxelSolid& solid, const HeatSources& sources, std::span<const Eigen::Vector3d> points,
                    std::span<const std::uint32_t> wanted, const HeatSettings& settings, Progress* progress,
                    std::int64_t steps, std::vector<WeightEntry>& entries);

}  // namespace sinew
