#include "sinew/automatic_weights.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <numeric>
#include <optional>

#include "weights/check_input.h"
#include "weights/heat.h"
#include "weights/outward.h"
#include "weights/point_weights.h"
#include "weights/rigid_parts.h"
#include "weights/weight_rows.h"

namespace sinew {
namespace {

// A part with fewer triangles, or one of few that is smaller than this many voxels, says too little about its own shape.
constexpr std::uint32_t kFewestTriangles = 16, kFewTriangles = 200;
constexpr double kFewestVoxels = 4;
// No place counts as closer to a bone than this many voxels.
constexpr double kLeastOnSurface = 0.25, kLeastInVolume = 0.5;
// A solid has this many cells at most, times the resolution squared: a person has 2.
constexpr double kMostCells = 6;
// So many at most, divided by the number of joints, or this many.
constexpr double kMostOfAllJoints = 5e7, kFewestCells = 2e4;
constexpr int kLeastResolution = 8;
// Steps of the progress for each phase.
constexpr std::int64_t kWeldSteps = 100, kSolidSteps = 150, kDistanceSteps = 150, kSurfaceSteps = 450,
                       kVolumeSteps = 150;
constexpr std::int64_t kAllSteps = kWeldSteps + kSolidSteps + kDistanceSteps + kSurfaceSteps + kVolumeSteps;

/// The inside of a mesh, and how far its bones are from everywhere.
struct Inside {
  explicit Inside(const WeldedMesh& mesh) : tree(mesh.points, mesh.triangles) {}

  TriangleTree tree;
  std::optional<VoxelSolid> solid;
  std::optional<BoneDistances> distances;
};

class Computation {
 public:
  Computation(std::span<const double> positions, std::span<const std::int32_t> face_offsets,
              std::span<const std::int32_t> face_vertices, const WeightBones& bones, const FixedWeights& fixed,
              const WeightSettings& settings, std::int32_t joint_count, Progress* progress)
      : fixed_(fixed),
        settings_(settings),
        joint_count_(joint_count),
        progress_(progress),
        frame_(positions),
        mesh_(weld(frame_, positions, {face_offsets, face_vertices})),
        way_of_(mesh_.points.size(), WeightWay::nearest) {
    for (std::size_t i = 0; i < bones.heads.size(); i += 3) {
      bones_.push_back({frame_(&bones.heads[i]), frame_(&bones.tails[i])});
    }
    joints_.assign(bones.joints.begin(), bones.joints.end());
    if (joints_.empty()) {
      joints_.resize(bones_.size());
      std::iota(joints_.begin(), joints_.end(), 0);
    }
  }

  AutomaticWeights run() {
    AutomaticWeights result;
    stop_if_cancelled(progress_);
    auto inside = std::make_unique<Inside>(mesh_);
    bool has_changed = false;
    const auto is_two_sided = turn_outward(mesh_, inside->tree, progress_, has_changed);
    if (has_changed) inside->tree = TriangleTree(mesh_.points, mesh_.triangles);
    advance(kWeldSteps);
    set_fixed();
    std::vector<WeightEntry> entries;
    if (frame_.size() > 0) {
      inside->solid.emplace(make_solid(inside->tree));
      advance(kSolidSteps);
      const SolidSurface surface{mesh_.points, mesh_.triangles, inside->tree};
      const BoneDistances& distances = inside->distances.emplace(*inside->solid, surface, bones_, joints_, progress_);
      for (std::int32_t bone = 0; bone < std::ssize(bones_); ++bone) {
        if (distances.is_outside()[bone]) result.bones_outside.push_back(bone);
      }
      result.voxel_size = inside->solid->grid().voxel() * frame_.size();
      if (settings_.method != WeightMethod::nearest) entries = diffuse(std::move(inside), is_two_sided);
    }
    inside.reset();
    add_nearest(entries);
    stop_if_cancelled(progress_);
    add_fixed(entries);
    const PointRows rows(mesh_.points.size(), [&](const auto& add) {
      for (const WeightEntry& entry : entries) add(entry.place, entry);
    });
    set_free(entries);
    const RigidRows rigid(mesh_, rows, joint_count_, settings_, is_fixed_);
    finish(rows, rigid, result);
    return result;
  }

 private:
  void advance(std::int64_t steps) {
    stop_if_cancelled(progress_);
    if (progress_) progress_->advance(steps);
  }

  /// Makes a solid of the resolution that was asked for, or a lower one if it is so bulky that it would take long. What
  /// decides is near the surface, where distances are exact if nothing is in between.
  VoxelSolid make_solid(const TriangleTree& tree) const {
    const double most = std::min(kMostCells * settings_.resolution * settings_.resolution,
                                 std::max(kFewestCells, kMostOfAllJoints / joint_count_));
    for (int resolution = settings_.resolution;;) {
      VoxelSolid solid(mesh_.points, mesh_.triangles, tree, resolution, progress_);
      const double ratio = most / static_cast<double>(solid.size());
      if (ratio >= 1 || resolution <= kLeastResolution) return solid;
      resolution = std::max(kLeastResolution, static_cast<int>(resolution * std::cbrt(ratio)));
    }
  }

  /// Gives coincident vertices the mean of their fixed weights.
  void set_fixed() {
    given_.row_of.assign(mesh_.points.size(), -1);
    is_fixed_.assign(mesh_.points.size(), 0);
    given_.rows = WeightTable(joint_count_);
    const Lists<std::uint32_t> at_point(mesh_.points.size(), [&](const auto& add) {
      for (std::uint32_t f = 0; f < fixed_.vertices.size(); ++f) add(mesh_.point_of[fixed_.vertices[f]], f);
    });
    RowSum sum(static_cast<std::size_t>(joint_count_));
    for (std::size_t p = 0; p < at_point.size(); ++p) {
      if (at_point[p].empty()) continue;
      is_fixed_[p] = 1;
      given_.row_of[p] = static_cast<std::int32_t>(given_.rows.vertices());
      for (const std::uint32_t f : at_point[p]) sum.add(fixed_.weights.row(f), 1 / sum_of(fixed_.weights.row(f)));
      given_.rows.add_row(sum.take(1 / static_cast<double>(at_point[p].size())));
    }
  }

  /// Whether the surface of each point is worth to solve on.
  std::vector<std::uint8_t> surface_points(double voxel) const {
    const auto parts = static_cast<std::size_t>(mesh_.part_count);
    std::vector<std::uint32_t> triangles(parts);
    std::vector<std::uint8_t> has_triangle(mesh_.points.size());
    for (const Triangle& triangle : mesh_.triangles) {
      ++triangles[mesh_.part_of[triangle[0]]];
      for (const std::uint32_t corner : triangle) has_triangle[corner] = 1;
    }
    const std::vector<double> diagonals = part_diagonals(mesh_);
    for (std::size_t p = 0; p < has_triangle.size(); ++p) {
      const std::int32_t part = mesh_.part_of[p];
      const std::uint32_t fewest = diagonals[part] < kFewestVoxels * voxel ? kFewTriangles : kFewestTriangles;
      const bool is_fragment = triangles[part] < fewest;
      if (is_fragment || settings_.method == WeightMethod::volume) has_triangle[p] = 0;
    }
    return has_triangle;
  }

  std::vector<WeightEntry> diffuse(std::unique_ptr<Inside> inside, const std::vector<std::uint8_t>& is_two_sided) {
    const VoxelSolid& solid = *inside->solid;
    const BoneDistances& distances = *inside->distances;
    std::vector<Place> places = places_of(mesh_, is_two_sided);
    const std::vector<std::uint8_t> has_heat = surface_points(solid.grid().voxel());
    // Since all sum to 1, one is as large as this at least.
    const HeatSettings heat{settings_.stiffness, std::min(settings_.least_weight / 2, 0.25 / joint_count_)};
    std::vector<WeightEntry> entries;
    std::vector<std::uint32_t> wanted;
    bool has_surface = false;
    for (std::uint32_t p = 0; p < has_heat.size(); ++p) {
      has_surface |= has_heat[p] != 0;
      if (!has_heat[p] && solid.index_of(solid.grid().cell_at(places[p].point)) >= 0) wanted.push_back(p);
    }
    if (!wanted.empty()) {
      std::vector<Place> centres(solid.size());
      for (std::size_t i = 0; i < centres.size(); ++i) {
        centres[i] = {solid.grid().centre(solid.cells()[i]), Eigen::Vector3d::Zero(), false};
      }
      const NearestBones nearest = distances.nearest(centres, kLeastInVolume, progress_, 0);
      heat_in_volume(solid, {nearest, joints_, joint_count_}, mesh_.points, wanted, heat, progress_, kVolumeSteps,
                     entries);
    }
    if (has_surface) {
      const NearestBones nearest = distances.nearest(places, kLeastOnSurface, progress_, kDistanceSteps);
      inside.reset();  // the factor of a large mesh wants its memory
      set_free(places);
      heat_on_surface(mesh_.points, mesh_.triangles, has_heat, {nearest, joints_, joint_count_}, given_, heat,
                      progress_, kSurfaceSteps, entries);
    }
    for (const WeightEntry& entry : entries) {
      way_of_[entry.place] = has_heat[entry.place] ? WeightWay::surface : WeightWay::volume;
    }
    return entries;
  }

  /// For points that have no weights yet.
  void add_nearest(std::vector<WeightEntry>& entries) const {
    std::vector<std::uint8_t> has_weights(is_fixed_);
    for (const WeightEntry& entry : entries) has_weights[entry.place] = 1;
    std::map<std::int32_t, double> row;
    for (std::uint32_t p = 0; p < has_weights.size(); ++p) {
      if (has_weights[p]) continue;
      if (p % 1024 == 0) stop_if_cancelled(progress_);
      const Place place{mesh_.points[p], Eigen::Vector3d::Zero(), false};
      const NearestBones nearest = nearest_in_air({&place, 1}, bones_);
      row.clear();
      for (std::size_t i = 0; i < nearest.bones.size(); ++i) row[joints_[nearest.bones[i]]] += nearest.shares[i];
      for (const auto& [joint, weight] : row) entries.push_back({p, joint, static_cast<float>(weight)});
    }
  }

  void add_fixed(std::vector<WeightEntry>& entries) {
    std::erase_if(entries, [&](const WeightEntry& entry) { return is_fixed_[entry.place] != 0; });
    for (std::uint32_t p = 0; p < is_fixed_.size(); ++p) {
      if (!is_fixed_[p]) continue;
      way_of_[p] = WeightWay::fixed;
      for (const auto& [joint, weight] : given_.rows.row(given_.row_of[p])) entries.push_back({p, joint, weight});
    }
  }

  void finish(const PointRows& rows, const RigidRows& rigid, AutomaticWeights& result) const {
    RowFinisher finish_row(settings_);
    WeightRow row;
    result.offsets.push_back(0);
    for (std::size_t v = 0; v < mesh_.point_of.size(); ++v) {
      const std::uint32_t point = mesh_.point_of[v];
      if (const WeightRow* const own = rigid.of(v)) {
        row = *own;
        result.ways.push_back(WeightWay::rigid);
      } else {
        row.clear();
        for (const WeightEntry& entry : rows[point]) row.emplace_back(entry.joint, entry.weight);
        result.ways.push_back(way_of_[point]);
      }
      finish_row(row);
      for (const auto& [joint, weight] : row) {
        result.joints.push_back(joint);
        result.weights.push_back(static_cast<float>(weight));
      }
      result.offsets.push_back(std::ssize(result.joints));
      result.parts.push_back(mesh_.part_of[point]);
    }
    result.part_count = mesh_.part_count;
  }

  const FixedWeights& fixed_;
  const WeightSettings& settings_;
  const std::int32_t joint_count_;
  Progress* const progress_;
  const UnitFrame frame_;
  WeldedMesh mesh_;
  std::vector<Segment> bones_;
  std::vector<std::int32_t> joints_;
  FixedPlaces given_;
  std::vector<std::uint8_t> is_fixed_;
  std::vector<WeightWay> way_of_;
};

}  // namespace

std::optional<AutomaticWeights> automatic_weights(std::span<const double> positions,
                                                  std::span<const std::int32_t> face_offsets,
                                                  std::span<const std::int32_t> face_vertices, const WeightBones& bones,
                                                  const FixedWeights& fixed, const WeightSettings& settings,
                                                  Progress* progress) {
  const auto start = std::chrono::steady_clock::now();
  const std::int32_t joints = check_weight_input(positions, face_offsets, face_vertices, bones, fixed, settings);
  if (progress) progress->start(kAllSteps);
  try {
    Computation computation(positions, face_offsets, face_vertices, bones, fixed, settings, joints, progress);
    AutomaticWeights result = computation.run();
    if (progress) progress->advance(kAllSteps);  // what was not needed counts as done
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return result;
  } catch (const Cancelled&) {
    return std::nullopt;
  }
}

}  // namespace sinew
