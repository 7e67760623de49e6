/// Heat diffusion on a surface and in a solid.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sinew/lists.h"
#include "sinew/weight_table.h"
#include "weights/bone_distances.h"

namespace sinew {

/// The sources of heat at places, by joint.
struct HeatSources {
  const NearestBones& nearest;
  std::span<const std::int32_t> joints;  ///< of each bone
  std::int32_t joint_count;

  /// Calls visit(joint, share) for the bones that heat a place; several may have the same joint.
  template <class Visit>
  void at(std::size_t place, const Visit& visit) const {
    for (std::uint32_t i = nearest.begin[place]; i < nearest.begin[place + 1]; ++i) {
      visit(joints[nearest.bones[i]], nearest.shares[i]);
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

/// Solves (L + A H) w = A H p on the triangles for the places that have one. Returns the weights of each place.
/// has_heat  of each place, whether it is on such a triangle.
/// progress  advanced by `steps` in total.
Lists<BoneWeight> heat_on_surface(std::span<const Eigen::Vector3d> points, std::span<const Triangle> triangles,
                                  std::span<const std::uint8_t> has_heat, const HeatSources& sources,
                                  const FixedPlaces& fixed, const HeatSettings& settings, Progress* progress,
                                  std::int64_t steps);

/// Solves (L + H) u = H p in the cells of a solid and reads the result at the points that are wanted. Returns the weights
/// of each point.
/// sources  of the cells.
Lists<BoneWeight> heat_in_volume(const VoxelSolid& solid, const HeatSources& sources,
                                 std::span<const Eigen::Vector3d> points, std::span<const std::uint32_t> wanted,
                                 const HeatSettings& settings, Progress* progress, std::int64_t steps);

}  // namespace sinew
