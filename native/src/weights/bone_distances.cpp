#include "weights/bone_distances.h"

#include <cmath>
#include <limits>
#include <memory>
#include <numeric>

#include "base/kept.h"
#include "base/parallel.h"
#include "sinew/lists.h"

namespace sinew {
namespace {

constexpr std::uint32_t kFar = std::numeric_limits<std::uint32_t>::max();
// A bone is followed no farther than where another is this many times nearer, plus three voxels.
constexpr std::uint32_t kTimes = 4, kSlack = 3 * kStepsPerVoxel;
// Bones that are no farther than the nearest by more than this share of its distance have a part, too, so that a weight
// does not depend on rounding.
constexpr double kBlend = 0.05;
// Distances are measured to bones that are shorter by this share of their length at both ends. Where the closest point of
// two bones is their common end, they would be equally near; so the one that points there is nearer.
constexpr double kShorter = 0.05;
// Bones shorter than this many voxels have divided cells around them, up to this many voxels away. No distance between
// centres of cells is equal to that, so that mirrored bones have mirrored cells.
constexpr double kShort = 5, kAround = 3.1;
// Of the mesh's size; the distances of places on a bone must not be 0.
constexpr double kShortest = 1e-6;

/// The length of the shortest way in steps from cell to cell where nothing is in between.
double octile(const Eigen::Vector3d& way) {
  double a = std::abs(way.x()), b = std::abs(way.y()), c = std::abs(way.z());
  if (a < b) std::swap(a, b);
  if (b < c) std::swap(b, c);
  if (a < b) std::swap(a, b);
  return kStepsPerVoxel * (a - b) + kDiagonalStep * (b - c) + kLongestStep * c;
}

Segment shorter(const Segment& bone) {
  const Eigen::Vector3d less = kShorter * (bone.tail - bone.head);
  return {bone.head + less, bone.tail - less};
}

double share_of(double distance, double nearest) { return 1 - (distance - nearest) / (kBlend * nearest); }

/// d_ij. detour  by how much the way is longer than the straight one.
double distance_from(const Segment& bone, const Place& place, double detour, double shortest) {
  const Eigen::Vector3d way = place.point - bone.closest(place.point);
  const double straight = way.norm();
  double cosine = 1;
  if (straight > 0 && !place.normal.isZero()) cosine = way.dot(place.normal) / straight;
  if (place.is_two_sided) cosine = std::abs(cosine);
  const double facing = 0.5 * (cosine + 1.001);
  return std::max(straight * detour, shortest) / (facing * std::sqrt(facing));
}

void normalise_shares(NearestBones& nearest) {
  for (std::size_t place = 0; place + 1 < nearest.begin.size(); ++place) {
    const std::span own =
        std::span(nearest.shares).subspan(nearest.begin[place], nearest.begin[place + 1] - nearest.begin[place]);
    const double sum = std::accumulate(own.begin(), own.end(), 0.0);
    for (double& share : own) share /= sum;
  }
}

}  // namespace

Eigen::Vector3d Segment::closest(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d along = tail - head;
  const double squared = along.squaredNorm();
  const double t = squared > 0 ? std::clamp((point - head).dot(along) / squared, 0.0, 1.0) : 0.0;
  return head + t * along;
}

struct BoneDistances::Search {
  explicit Search(std::size_t nodes) : distances(nodes, kFar), detours(nodes) {}
  std::vector<std::uint32_t> distances;  ///< of each node, kFar between searches
  /// By how much the way through the solid is longer than the straight one, 1 or more; 0: the node was not reached.
  std::vector<float> detours;
  std::vector<std::uint32_t> reached, touched;
  BucketQueue queue;
};

BoneDistances::BoneDistances(VoxelSolid& solid, const SolidSurface& surface, std::span<const Segment> bones,
                             std::span<const std::int32_t> joints, const Progress* progress)
    : solid_(solid),
      bones_(bones),
      progress_(progress),
      graph_(solid),
      seeds_(bones.size()),
      is_outside_(bones.size()) {
  begin(progress);
  const std::vector<std::int32_t> cells(solid.cells().begin(), solid.cells().end());
  solid.connect(origins());
  for (auto& seeds : seeds_) {  // the same cells, which have other numbers now
    for (auto& seed : seeds) seed.item = static_cast<std::uint32_t>(solid.index_of(cells[seed.item]));
  }
  graph_ = SolidGraph(solid);
  graph_.divide(surface.points, surface.triangles, surface.tree, near_short_bones(joints), progress);
  if (graph_.is_divided()) {
    const std::vector<std::uint8_t> is_outside = is_outside_;
    begin(progress);
    is_outside_ = is_outside;
    graph_.connect(origins());
  }
  measure_nearest();
}

void BoneDistances::begin(const Progress* progress) {
  parallel_for(bones_.size(), 1, [&](std::size_t begin, std::size_t end) {
    stop_if_cancelled(progress);
    for (std::size_t bone = begin; bone < end; ++bone) begin_at(bone);
  });
}

std::vector<std::uint32_t> BoneDistances::origins() const {
  const bool all_are_outside = std::ranges::find(is_outside_, 0) == is_outside_.end();
  std::vector<std::uint32_t> nodes;
  for (std::size_t bone = 0; bone < seeds_.size(); ++bone) {
    if (is_outside_[bone] && !all_are_outside) continue;
    for (const auto& seed : seeds_[bone]) nodes.push_back(seed.item);
  }
  return nodes;
}

std::vector<std::uint8_t> BoneDistances::near_short_bones(std::span<const std::int32_t> joints) const {
  const VoxelGrid& grid = solid_.grid();
  std::vector<double> lengths(joints.empty() ? 0 : *std::ranges::max_element(joints) + 1);
  for (std::size_t bone = 0; bone < bones_.size(); ++bone) {
    lengths[joints[bone]] += (bones_[bone].tail - bones_[bone].head).norm() / grid.voxel();
  }
  std::vector<std::uint8_t> is_near(solid_.size());
  for (std::size_t bone = 0; bone < bones_.size(); ++bone) {
    if (lengths[joints[bone]] >= kShort) continue;
    const Eigen::Vector3d head = grid.coordinates(bones_[bone].head), tail = grid.coordinates(bones_[bone].tail);
    std::array<int, 3> first, last;
    for (int axis = 0; axis < 3; ++axis) {
      const double most = grid.counts()[axis] - 1.0;
      first[axis] = static_cast<int>(std::clamp(std::min(head[axis], tail[axis]) - kAround - 1, 0.0, most));
      last[axis] = static_cast<int>(std::clamp(std::max(head[axis], tail[axis]) + kAround + 1, 0.0, most));
    }
    for (int k = first[2]; k <= last[2]; ++k) {
      for (int j = first[1]; j <= last[1]; ++j) {
        for (int i = first[0]; i <= last[0]; ++i) {
          const std::int32_t index = solid_.index_of(grid.cell(i, j, k));
          if (index < 0 || is_near[index]) continue;
          const Eigen::Vector3d centre = grid.centre(grid.cell(i, j, k));
          is_near[index] = (centre - bones_[bone].closest(centre)).norm() <= kAround * grid.voxel();
        }
      }
    }
  }
  return is_near;
}

void BoneDistances::measure_nearest() {
  nearest_.assign(graph_.size(), kFar);
  std::vector<BucketQueue::Seed> from;
  for (const auto& seeds : seeds_) from.insert(from.end(), seeds.begin(), seeds.end());
  for (const auto& seed : from) nearest_[seed.item] = std::min(nearest_[seed.item], seed.distance);
  BucketQueue().run(std::move(from), [&](std::uint32_t now, std::uint32_t node, const auto& push) {
    if (nearest_[node] != now) return;
    graph_.neighbours(node, [&](std::uint32_t other, std::uint32_t length) {
      if (nearest_[other] <= now + length) return;
      nearest_[other] = now + length;
      push(nearest_[other], other);
    });
  });
}

void BoneDistances::begin_at(std::size_t bone) {
  const VoxelGrid& grid = solid_.grid();
  const Segment& segment = bones_[bone];
  std::vector<std::uint32_t> inside;
  // The part of the segment in the grid, in steps of a quarter of a cell at most.
  const Eigen::Vector3d head = grid.coordinates(segment.head), way = grid.coordinates(segment.tail) - head;
  double from = 0, to = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double end = grid.counts()[axis];
    if (way[axis] == 0) {
      if (head[axis] < 0 || head[axis] >= end) to = -1;
      continue;
    }
    const double a = -head[axis] / way[axis], b = (end - head[axis]) / way[axis];
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  if (from <= to) {
    const int samples = 1 + static_cast<int>(std::ceil(4 * graph_.factor() * (to - from) * way.norm()));
    for (int i = 0; i <= samples; ++i) {
      const std::int32_t node = graph_.open_at(head + (from + (to - from) * i / samples) * way);
      if (node >= 0) inside.push_back(static_cast<std::uint32_t>(node));
    }
  }
  is_outside_[bone] = inside.empty();
  const auto distance_of = [&](std::uint32_t node) {
    const Eigen::Vector3d centre = graph_.centre(node);
    return (centre - segment.closest(centre)).norm() / grid.voxel() * kStepsPerVoxel;
  };
  if (inside.empty()) {
    std::vector<double> distances(graph_.size(), std::numeric_limits<double>::infinity());
    double nearest = std::numeric_limits<double>::infinity();
    for (std::uint32_t node = 0; node < distances.size(); ++node) {
      if (graph_.is_open(node)) distances[node] = distance_of(node);
      nearest = std::min(nearest, distances[node]);
    }
    for (std::uint32_t node = 0; node < distances.size(); ++node) {
      if (distances[node] <= nearest + kStepsPerVoxel) inside.push_back(node);
    }
  }
  std::ranges::sort(inside);
  inside.erase(std::unique(inside.begin(), inside.end()), inside.end());
  seeds_[bone].clear();
  for (const std::uint32_t node : inside) {
    // However far it is, all steps of a way through the grid can still be added.
    const double distance = std::min(std::round(distance_of(node)), 1e9);
    seeds_[bone].push_back({static_cast<std::uint32_t>(distance), node});
  }
}

void BoneDistances::spread(std::size_t bone, Search& search) const {
  const VoxelGrid& grid = solid_.grid();
  for (const std::uint32_t node : search.touched) {
    search.distances[node] = kFar;
    search.detours[node] = 0;
  }
  search.reached.clear();
  search.touched.clear();
  for (const auto& seed : seeds_[bone]) {
    search.distances[seed.item] = seed.distance;
    search.touched.push_back(seed.item);
  }
  search.queue.run(seeds_[bone], [&](std::uint32_t now, std::uint32_t node, const auto& push) {
    if (search.distances[node] != now) return;
    if (now > std::uint64_t{kTimes} * nearest_[node] + kSlack) return;
    const Eigen::Vector3d centre = graph_.centre(node);
    const double straight = octile((centre - bones_[bone].closest(centre)) / grid.voxel());
    search.detours[node] =
        static_cast<float>(std::max(1.0, (now - double{kStepsPerVoxel}) / std::max(straight, double{kStepsPerVoxel})));
    search.reached.push_back(node);
    graph_.neighbours(node, [&](std::uint32_t other, std::uint32_t length) {
      if (search.distances[other] <= now + length) return;
      if (search.distances[other] == kFar) search.touched.push_back(other);
      search.distances[other] = now + length;
      push(search.distances[other], other);
    });
  });
}

double BoneDistances::detour_at(const Eigen::Vector3d& point, const Search& search) const {
  double sum = 0, weights = 0;
  graph_.around(point, [&](std::int32_t node, double weight) {
    if (search.detours[node] == 0) return;
    sum += weight * search.detours[node];
    weights += weight;
  });
  return weights > 0 ? sum / weights : 1;
}

NearestBones BoneDistances::nearest(std::span<const Place> places, double least, Progress* progress,
                                    std::int64_t steps) const {
  // The places in each node.
  std::vector<std::int32_t> node_of(places.size());
  for (std::size_t place = 0; place < places.size(); ++place) node_of[place] = graph_.node_of(places[place].point);
  const Lists<std::uint32_t> in_node(graph_.size(), [&](const auto& add) {
    for (std::uint32_t place = 0; place < places.size(); ++place) {
      if (node_of[place] >= 0) add(node_of[place], place);
    }
  });

  const double shortest = least * solid_.grid().voxel();
  std::vector<std::vector<Found>> found(bones_.size());
  Kept<Search> searches;
  parallel_for(bones_.size(), 1, [&](std::size_t first, std::size_t end) {
    const auto search = searches.borrow([&] { return std::make_unique<Search>(graph_.size()); });
    for (std::size_t bone = first; bone < end; ++bone) {
      stop_if_cancelled(progress_);
      spread(bone, *search);
      const Segment measured = shorter(bones_[bone]);
      for (const std::uint32_t node : search->reached) {
        for (const std::uint32_t i : in_node[node]) {
          const double distance = distance_from(measured, places[i], detour_at(places[i].point, *search), shortest);
          found[bone].push_back({i, static_cast<float>(distance)});
        }
      }
      advance_share(progress, steps, bone, bones_.size());
    }
  });

  NearestBones result;
  result.distances.assign(places.size(), std::numeric_limits<double>::infinity());
  for (const auto& of_bone : found) {
    for (const auto& [place, distance] : of_bone) {
      result.distances[place] = std::min<double>(result.distances[place], distance);
    }
  }
  result.begin.assign(places.size() + 1, 0);
  for (const auto& of_bone : found) {
    for (const auto& [place, distance] : of_bone) {
      result.begin[place + 1] += share_of(distance, result.distances[place]) > 0;
    }
  }
  for (std::size_t place = 1; place < result.begin.size(); ++place) result.begin[place] += result.begin[place - 1];
  result.bones.resize(result.begin.back());
  result.shares.resize(result.begin.back());
  std::vector<std::uint32_t> at(result.begin.begin(), result.begin.end() - 1);
  for (std::uint32_t bone = 0; bone < found.size(); ++bone) {
    for (const auto& [place, distance] : found[bone]) {
      const double share = share_of(distance, result.distances[place]);
      if (share <= 0) continue;
      result.bones[at[place]] = bone;
      result.shares[at[place]++] = share;
    }
    found[bone] = {};
  }
  normalise_shares(result);
  return result;
}

NearestBones nearest_in_air(std::span<const Place> places, std::span<const Segment> bones) {
  NearestBones result;
  result.begin.push_back(0);
  std::vector<double> distances(bones.size());
  for (const Place& place : places) {
    for (std::size_t bone = 0; bone < bones.size(); ++bone) {
      distances[bone] = std::max((place.point - shorter(bones[bone]).closest(place.point)).norm(), kShortest);
    }
    result.distances.push_back(*std::ranges::min_element(distances));
    for (std::uint32_t bone = 0; bone < bones.size(); ++bone) {
      const double share = share_of(distances[bone], result.distances.back());
      if (share <= 0) continue;
      result.bones.push_back(bone);
      result.shares.push_back(share);
    }
    result.begin.push_back(static_cast<std::uint32_t>(result.bones.size()));
  }
  normalise_shares(result);
  return result;
}

}  // namespace sinew
