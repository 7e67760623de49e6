#include "sinew/automatic_weights.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <numeric>
#include <optional>

#include "base/set_free.h"
#include "weights/check_input.h"
#include "weights/heat.h"
#include "weights/outward.h"
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
constexpr std::size_t kRows = 1024;  // in a task
// Steps of the progress for each phase.
constexpr std::int64_t kWeldSteps = 100, kSolidSteps = 150, kDistanceSteps = 150, kSurfaceSteps = 450,
                       kVolumeSteps = 150;
constexpr std::int64_t kAllSteps = kWeldSteps + kSolidSteps + kDistanceSteps + kSurfaceSteps + kVolumeSteps;

/// The inside of a mesh, and how far its bones are from everywhere.
struct Inside {
  Inside(const WeldedMesh& mesh, const Progress* progress) : tree(mesh.points, mesh.triangles, progress) {}

  TriangleTree tree;
  std::optional<VoxelSolid> solid;
  std::optional<BoneDistances> distances;
};

/// The weights of points from heat; nothing where there are none.
struct Heated {
  Lists<BoneWeight> volume, surface;
};

/// Leaves out small weights and those beyond the allowed number, never all, and makes the sum 1.
/// row  joints ascending, at least one weight above 0.
void finish_row(std::vector<BoneWeight>& row, const WeightSettings& settings) {
  const double largest = std::ranges::max(row, {}, &BoneWeight::weight).weight;
  const double least = std::min(settings.least_weight, largest / 2);
  std::erase_if(row, [&](const BoneWeight& own) { return own.weight < least; });
  const auto most = static_cast<std::size_t>(settings.max_influences);
  if (most > 0 && row.size() > most) {
    std::ranges::stable_sort(row, std::ranges::greater(), &BoneWeight::weight);
    row.resize(most);
    std::ranges::sort(row, {}, &BoneWeight::bone);
  }
  const double sum = sum_of(row);
  for (BoneWeight& own : row) own.weight = static_cast<float>(own.weight / sum);
}

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
        mesh_(weld(frame_, positions, {face_offsets, face_vertices}, progress)),
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
    auto inside = std::make_unique<Inside>(mesh_, progress_);
    bool has_changed = false;
    const auto is_two_sided = turn_outward(mesh_, inside->tree, progress_, has_changed);
    if (has_changed) inside->tree = TriangleTree(mesh_.points, mesh_.triangles, progress_);
    advance(kWeldSteps);
    set_fixed();
    Heated heated;
    if (frame_.size() > 0) {
      inside->solid.emplace(make_solid(inside->tree));
      advance(kSolidSteps);
      const SolidSurface surface{mesh_.points, mesh_.triangles, inside->tree};
      const BoneDistances& distances = inside->distances.emplace(*inside->solid, surface, bones_, joints_, progress_);
      for (std::int32_t bone = 0; bone < std::ssize(bones_); ++bone) {
        if (distances.is_outside()[bone]) result.bones_outside.push_back(bone);
      }
      result.voxel_size = inside->solid->grid().voxel() * frame_.size();
      if (settings_.method != WeightMethod::nearest) heated = diffuse(std::move(inside), is_two_sided);
    }
    inside.reset();
    const WeightTable rows = rows_of_points(heated);
    heated = {};
    finish(rows, result);
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
    given_.rows = WeightTable(joint_count_);
    const Lists<std::uint32_t> at_point(mesh_.points.size(), [&](const auto& add) {
      for (std::uint32_t f = 0; f < fixed_.vertices.size(); ++f) add(mesh_.point_of[fixed_.vertices[f]], f);
    });
    RowSum sum(static_cast<std::size_t>(joint_count_));
    for (std::size_t p = 0; p < at_point.size(); ++p) {
      if (at_point[p].empty()) continue;
      way_of_[p] = WeightWay::fixed;
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

  Heated diffuse(std::unique_ptr<Inside> inside, const std::vector<std::uint8_t>& is_two_sided) {
    const VoxelSolid& solid = *inside->solid;
    const BoneDistances& distances = *inside->distances;
    std::vector<Place> places = places_of(mesh_, is_two_sided);
    const std::vector<std::uint8_t> has_heat = surface_points(solid.grid().voxel());
    // Since all sum to 1, one is as large as this at least.
    const HeatSettings heat{settings_.stiffness, std::min(settings_.least_weight / 2, 0.25 / joint_count_)};
    Heated heated;
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
      heated.volume =
          heat_in_volume(solid, {nearest, joints_, joint_count_}, mesh_.points, wanted, heat, progress_, kVolumeSteps);
    }
    if (has_surface) {
      const NearestBones nearest = distances.nearest(places, kLeastOnSurface, progress_, kDistanceSteps);
      inside.reset();  // the factor of a large mesh wants its memory
      set_free(places);
      heated.surface = heat_on_surface(mesh_.points, mesh_.triangles, has_heat, {nearest, joints_, joint_count_},
                                       given_, heat, progress_, kSurfaceSteps);
    }
    return heated;
  }

  /// The weights that are given, else those from heat, else the shares of the nearest bones.
  WeightTable rows_of_points(const Heated& heated) {
    const auto make = [&](std::size_t begin, std::size_t end, WeightTable& rows) {
      RowSum sum(static_cast<std::size_t>(joint_count_));
      for (std::size_t p = begin; p < end; ++p) {
        const auto add = [&](const Lists<BoneWeight>& from, WeightWay way) {
          if (from.size() == 0 || from[p].empty()) return false;
          rows.add_row(from[p]);
          way_of_[p] = way;
          return true;
        };
        if (way_of_[p] == WeightWay::fixed) {
          rows.add_row(given_.rows.row(given_.row_of[p]));
        } else if (!add(heated.surface, WeightWay::surface) && !add(heated.volume, WeightWay::volume)) {
          const Place place{mesh_.points[p], Eigen::Vector3d::Zero(), false};
          const NearestBones nearest = nearest_in_air({&place, 1}, bones_);
          for (std::size_t i = 0; i < nearest.bones.size(); ++i) sum.add(joints_[nearest.bones[i]], nearest.shares[i]);
          rows.add_row(sum.take());
        }
      }
    };
    return table_of_rows(mesh_.points.size(), joint_count_, kRows, progress_, 0, make);
  }

  void finish(const WeightTable& rows, AutomaticWeights& result) {
    const RigidRows rigid(mesh_, rows, way_of_, settings_);
    const std::size_t vertices = mesh_.point_of.size();
    result.ways.resize(vertices);
    result.parts.resize(vertices);
    result.part_count = mesh_.part_count;
    const auto make = [&](std::size_t begin, std::size_t end, WeightTable& made) {
      std::vector<BoneWeight> row;
      for (std::size_t v = begin; v < end; ++v) {
        const std::uint32_t point = mesh_.point_of[v];
        const auto own = rigid.of(v);
        const auto from = own.value_or(rows.row(point));
        row.assign(from.begin(), from.end());
        finish_row(row, settings_);
        made.add_row(row);
        result.ways[v] = own ? WeightWay::rigid : way_of_[point];
        result.parts[v] = mesh_.part_of[point];
      }
    };
    result.weights = table_of_rows(vertices, joint_count_, kRows, progress_, 0, make);
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
