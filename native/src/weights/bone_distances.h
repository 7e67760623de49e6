/// How far bones are from the places where weights are wanted, through the solid.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/cancelled.h"
#include "weights/solid_graph.h"

namespace sinew {

struct Segment {
  Eigen::Vector3d head, tail;

  Eigen::Vector3d closest(const Eigen::Vector3d& point) const;
};

/// A place where weights are wanted.
struct Place {
  Eigen::Vector3d point;
  Eigen::Vector3d normal;  ///< outward and of length 1, or zero: all directions are alike
  bool is_two_sided;       ///< outward is not known
};

/// The nearest bones of places: the sources of heat.
struct NearestBones {
  std::vector<std::uint32_t>
      begin;  ///< places + 1: where the bones of each begin; each has one at least if it is in the solid
  std::vector<std::uint32_t> bones;  ///< ascending at each place
  std::vector<double> shares;        ///< above 0, with sum 1 at each place
  std::vector<double> distances;     ///< of the nearest, above 0, of each place
};

/// The surface of a solid.
struct SolidSurface {
  std::span<const Eigen::Vector3d> points;
  std::span<const Triangle> triangles;
  const TriangleTree& tree;
};

/// Distances through a solid, each with all cells connected. Around short bones, such as those of fingers and lips, the
/// cells that the surface meets are divided, so that parts closer than a voxel stay apart.
class BoneDistances {
 public:
  /// Connects the solid with the bones. A bone outside it begins at the closest solid cells. joints  of the bones: those
  /// of one joint count as one when it is asked which are short.
  BoneDistances(VoxelSolid& solid, const SolidSurface& surface, std::span<const Segment> bones,
                std::span<const std::int32_t> joints, const Progress* progress);

  /// Bones of which nothing is in a solid cell.
  std::span<const std::uint8_t> is_outside() const { return is_outside_; }

  /// least  no distance counts as shorter, in voxels.
  NearestBones nearest(std::span<const Place> places, double least, Progress* progress, std::int64_t steps) const;

 private:
  struct Search;
  struct Found {
    std::uint32_t place;
    float distance;
  };
  void begin(const Progress* progress);
  void begin_at(std::size_t bone);
  /// What everything is connected with: the nodes of bones inside the solid, or of all if none is. A part that only
  /// bones beside it have found is not theirs alone.
  std::vector<std::uint32_t> origins() const;
  std::vector<std::uint8_t> near_short_bones(std::span<const std::int32_t> joints) const;
  void measure_nearest();
  void spread(std::size_t bone, Search& search) const;
  double detour_at(const Eigen::Vector3d& point, const Search& search) const;

  const VoxelSolid& solid_;
  std::span<const Segment> bones_;
  const Progress* progress_;
  SolidGraph graph_;
  std::vector<std::vector<BucketQueue::Seed>> seeds_;
  std::vector<std::uint8_t> is_outside_;
  std::vector<std::uint32_t> nearest_;  ///< of each node, from any bone, in units of voxel / kStepsPerVoxel
};

/// Distances through the air, for what has no solid.
NearestBones nearest_in_air(std::span<const Place> places, std::span<const Segment> bones);

}  // namespace sinew
