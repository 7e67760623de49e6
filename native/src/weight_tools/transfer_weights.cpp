#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "mesh/adjacency.h"
#include "sinew/weight_tools.h"
#include "weight_tools/check_tables.h"
#include "weight_tools/inpaint_weights.h"
#include "weight_tools/weighted_surface.h"

namespace sinew {
namespace {

/// The target is tight where it is no farther from the source, as a share of its diagonal, and what belongs to that at most
/// kFarther times as far. Near by is kAround times as far as the closest point.
constexpr double kTight = 0.0125, kFarther = 2, kAround = 2;

constexpr std::size_t kPoints = 128;  // in a task

/// Steps of the progress.
constexpr std::int64_t kMatchSteps = 60, kInpaintSteps = 100, kIslandSteps = 20;

/// Sums of areas times normals, by vertex.
std::vector<Eigen::Vector3d> normals_of(std::span<const Eigen::Vector3d> places, std::span<const Triangle> triangles,
                                        std::span<const std::uint32_t> point_of, std::size_t points) {
  std::vector<Eigen::Vector3d> normals(points, Eigen::Vector3d::Zero());
  for (const Triangle& own : triangles) {
    const Eigen::Vector3d normal = doubled_area(places, own);
    for (const std::uint32_t v : own) normals[point_of.empty() ? v : point_of[v]] += normal;
  }
  return normals;
}

class Transfer {
 public:
  Transfer(std::span<const float> source_positions, const Faces& source_faces, const WeightTable& source_weights,
           std::span<const float> positions, const Faces& faces, const TransferSettings& settings, Progress* progress)
      : weights_(source_weights),
        faces_(faces),
        settings_(settings),
        progress_(progress),
        bones_(static_cast<std::size_t>(source_weights.bones())),
        exact_(positions.begin(), positions.end()),
        frame_(exact_),
        places_(points_in(frame_, exact_)),
        target_(weld(frame_, exact_, faces, progress)),
        source_triangles_(triangles_of(source_faces)),
        source_(points_in(frame_, std::vector<double>(source_positions.begin(), source_positions.end())),
                source_triangles_, source_weights, progress),
        is_matched_(target_.points.size()) {}

  TransferredWeights run() {
    if (progress_) progress_->start(kMatchSteps + kInpaintSteps + kIslandSteps);
    match();
    inpaint_weights(target_, faces_, rows_, progress_, kInpaintSteps);
    attach_islands();
    if (progress_) progress_->advance(kInpaintSteps + kIslandSteps);  // what was not needed counts as done
    TransferredWeights made{WeightTable(weights_.bones()), std::vector<std::uint8_t>(target_.point_of.size())};
    for (std::size_t v = 0; v < target_.point_of.size(); ++v) {
      const std::size_t p = target_.point_of[v];
      made.weights.add_row(rows_.row(p));
      made.matched[v] = is_matched_[p];
    }
    return made;
  }

 private:
  void match() {
    const std::vector<Eigen::Vector3d> normals =
        normals_of(places_, triangles_of(faces_), target_.point_of, target_.points.size());
    Eigen::Vector3d low = places_.front(), high = low;
    for (const Eigen::Vector3d& place : places_) low = low.cwiseMin(place), high = high.cwiseMax(place);
    const double within = settings_.distance * (high - low).norm();
    const double least_cosine = std::cos(settings_.angle * std::numbers::pi / 180);
    const std::vector<Eigen::Vector3d> source_normals =
        normals_of(source_.points(), source_triangles_, {}, source_.points().size());
    const auto faces_like = [&](const Eigen::Vector3d& normal, const Eigen::Vector3d& own) {
      const double lengths = normal.stableNorm() * own.stableNorm();
      const double cosine = lengths > 0 ? normal.dot(own) / lengths : 1;  // without normals: by distance alone
      return (settings_.flipped ? std::abs(cosine) : cosine) >= least_cosine - 1e-12;
    };
    const auto is_alike = [&](const SurfacePoint& hit, const Eigen::Vector3d& own) {
      Eigen::Vector3d normal = Eigen::Vector3d::Zero();
      for (int i = 0; i < 3; ++i) {
        normal += hit.shares[i] * source_normals[source_.triangle(hit)[i]].stableNormalized();
      }
      return faces_like(normal, own);
    };
    std::vector<SurfacePoint> hits(target_.points.size());
    std::vector<std::uint8_t> is_right(hits.size());
    for_parts(hits.size(), kPoints, progress_, kMatchSteps, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t p = begin; p < end; ++p) {
        hits[p] = source_.tree().closest(target_.points[p],
                                         within * within * (1 + 1e-9) + std::numeric_limits<double>::min());
        is_right[p] = hits[p].triangle != SurfacePoint().triangle && is_alike(hits[p], normals[p]);
      }
    });
    add_tight(hits, kTight * (high - low).norm(), faces_like, normals, is_right);
    rows_ = table_of_rows(hits.size(), weights_.bones(), kPoints, progress_, 0, [&](auto begin, auto end, auto& rows) {
      RowSum sum(bones_);
      for (std::size_t p = begin; p < end; ++p) {
        if (is_right[p]) source_.read(hits[p], sum);
        const double total = sum.total();
        is_matched_[p] = total > 0;
        rows.add_row(sum.take(total > 0 ? 1 / total : 0));
      }
    });
  }

  /// Where the target lies on the source, no farther than `reach`, adds the closest points that face another way, as those
  /// of inner layers and seams, unless something near by faces as it should, as of lips that touch.
  template <class Test>
  void add_tight(std::span<const SurfacePoint> hits, double reach, const Test& faces_like,
                 std::span<const Eigen::Vector3d> normals, std::span<std::uint8_t> is_right) const {
    const auto neighbours = neighbours_by_sides(faces_, target_.point_of, hits.size());
    std::vector<std::uint32_t> tight;
    std::vector<std::uint8_t> is_known(is_right.begin(), is_right.end());
    for (std::uint32_t p = 0; p < hits.size(); ++p) {
      if (is_right[p] && hits[p].squared_distance <= reach * reach) tight.push_back(p);
    }
    const std::size_t first = tight.size();
    for (std::size_t i = 0; i < tight.size(); ++i) {
      for (const std::uint32_t p : neighbours[tight[i]]) {
        if (is_known[p] || !(hits[p].squared_distance <= kFarther * kFarther * reach * reach)) continue;
        is_known[p] = 1;
        tight.push_back(p);
      }
    }
    const auto has_other = [&](std::uint32_t p, std::vector<std::uint32_t>& near) {
      near.clear();
      const Eigen::Vector3d around = Eigen::Vector3d::Constant(kAround * std::sqrt(hits[p].squared_distance));
      source_.tree().in_box(target_.points[p] - around, target_.points[p] + around, near);
      return std::ranges::any_of(near, [&](std::uint32_t t) {
        return faces_like(doubled_area(source_.points(), source_.triangle(t)), normals[p]);
      });
    };
    for_parts(tight.size() - first, kPoints, progress_, 0, [&](std::size_t begin, std::size_t end, std::size_t) {
      std::vector<std::uint32_t> near;
      for (std::size_t i = first + begin; i < first + end; ++i) is_right[tight[i]] = !has_other(tight[i], near);
    });
  }

  static bool has_weights(const Triangle& triangle, const WeightTable& weights) {
    return std::ranges::any_of(triangle, [&](std::uint32_t v) { return !weights.row(v).empty(); });
  }

  /// Gives each island without weights those of the nearest point of one that has them, or of the source.
  void attach_islands() {
    std::vector<std::vector<std::uint32_t>> islands(static_cast<std::size_t>(target_.part_count));
    for (std::uint32_t p = 0; p < target_.points.size(); ++p) {
      if (rows_.row(p).empty()) islands[target_.part_of[p]].push_back(p);
    }
    std::erase_if(islands, [](const auto& own) { return own.empty(); });
    if (islands.empty()) return;
    std::vector<Triangle> dressed, painted;
    for (const Triangle& own : target_.triangles) {
      if (has_weights(own, rows_)) dressed.push_back(own);
    }
    for (const Triangle& own : source_triangles_) {
      if (has_weights(own, weights_)) painted.push_back(own);
    }
    std::optional<WeightedSurface> on_target, on_source;
    if (!dressed.empty()) on_target.emplace(target_.points, std::move(dressed), rows_, progress_);
    if (painted.size() < source_triangles_.size())
      on_source.emplace(source_.points(), std::move(painted), weights_, progress_);
    const WeightedSurface& whole = on_source ? *on_source : source_;
    std::vector<std::int32_t> island_of(target_.points.size(), -1);
    for (std::size_t i = 0; i < islands.size(); ++i) {
      for (const std::uint32_t p : islands[i]) island_of[p] = static_cast<std::int32_t>(i);
    }
    const WeightTable made = table_of_rows(
        islands.size(), weights_.bones(), 1, progress_, kIslandSteps, [&](auto begin, auto end, auto& rows) {
          RowSum sum(bones_);
          for (std::size_t i = begin; i < end; ++i) {
            const auto nearest = [&](const WeightedSurface& surface) {
              SurfacePoint best;
              for (std::size_t k = 0; k < islands[i].size(); ++k) {
                if (k % kPoints == 0) stop_if_cancelled(progress_);
                const SurfacePoint hit = surface.tree().closest(target_.points[islands[i][k]], best.squared_distance);
                if (hit.squared_distance < best.squared_distance) best = hit;
              }
              return best;
            };
            const SurfacePoint from = nearest(whole);
            const SurfacePoint own = on_target ? nearest(*on_target) : SurfacePoint();
            const bool is_own = on_target && own.squared_distance <= from.squared_distance;
            const WeightedSurface& surface = is_own ? *on_target : whole;
            SurfacePoint hit = is_own ? own : from;
            surface.read(hit, sum);
            if (!(sum.total() > 0)) {  // on the border of what has weights
              hit.shares.setOnes();
              surface.read(hit, sum);
            }
            rows.add_row(sum.take(1 / sum.total()));
          }
        });
    WeightTable rows(weights_.bones());
    for (std::size_t p = 0; p < island_of.size(); ++p) {
      rows.add_row(island_of[p] < 0 ? rows_.row(p) : made.row(island_of[p]));
    }
    rows_ = std::move(rows);
  }

  const WeightTable& weights_;
  const Faces& faces_;
  const TransferSettings& settings_;
  Progress* const progress_;
  std::size_t bones_;
  std::vector<double> exact_;
  UnitFrame frame_;  // of the target
  std::vector<Eigen::Vector3d> places_;
  WeldedMesh target_;
  std::vector<Triangle> source_triangles_;
  WeightedSurface source_;
  WeightTable rows_;                      // of the points of the target
  std::vector<std::uint8_t> is_matched_;  // whether the row of each is that of the closest point
};

}  // namespace

std::optional<TransferredWeights> transfer_weights(std::span<const float> source_positions, const Faces& source_faces,
                                                   const WeightTable& source_weights, std::span<const float> positions,
                                                   const Faces& faces, const TransferSettings& settings,
                                                   Progress* progress) {
  check_positions("source_positions", source_positions, source_weights.vertices());
  check_faces(source_faces, source_weights.vertices(), "source_face_vertices", "source_face_offsets");
  const std::ptrdiff_t vertices = std::ssize(positions) / 3;
  check_positions("positions", positions, vertices);
  check_faces(faces, vertices);
  if (!(settings.distance > 0) || !std::isfinite(settings.distance)) {
    fail("distance is ", settings.distance, "; expected a number above 0");
  }
  check_range("angle", settings.angle, 0, 180);
  const std::vector<Triangle> triangles = triangles_of(source_faces);
  if (triangles.empty()) fail("the source has no faces; expected a surface on which the closest points are");
  if (std::ranges::none_of(triangles, [&](const Triangle& own) {
        return std::ranges::any_of(own, [&](std::uint32_t v) { return !source_weights.row(v).empty(); });
      })) {
    fail("the source has no weight above 0 on its faces; bind or paint it first");
  }
  if (vertices == 0) return TransferredWeights{WeightTable(source_weights.bones()), {}};
  try {
    return Transfer(source_positions, source_faces, source_weights, positions, faces, settings, progress).run();
  } catch (const Cancelled&) {
    return std::nullopt;
  }
}

}  // namespace sinew
