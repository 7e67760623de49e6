#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "base/set_free.h"
#include "mesh/adjacency.h"
#include "sinew/weight_tools.h"
#include "weight_tools/check_tables.h"
#include "weight_tools/inpaint_weights.h"
#include "weight_tools/weighted_surface.h"

namespace sinew {
namespace {

/// The target is tight where it is no farther from the source, as a share of its diagonal, and what belongs to that at most
/// kFarther times as far. Near by is kAround times as far as the closest point. A point that faces away by less than the
/// angle of kTurned is taken whatever is near by.
constexpr double kTight = 0.0125, kFarther = 2, kAround = 2, kTurned = 0.5;

constexpr std::size_t kPart = 128;  // in a task

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

/// Those with weights at a corner.
std::vector<Triangle> with_weights(std::span<const Triangle> triangles, const WeightTable& weights) {
  std::vector<Triangle> own;
  std::ranges::copy_if(triangles, std::back_inserter(own), [&](const Triangle& corners) {
    return std::ranges::any_of(corners, [&](std::uint32_t v) { return !weights.row(v).empty(); });
  });
  return own;
}

class Transfer {
 public:
  Transfer(std::span<const float> source_positions, std::vector<Triangle> source_triangles,
           const WeightTable& source_weights, std::span<const float> positions, const Faces& faces,
           const TransferSettings& settings, Progress* progress)
      : weights_(source_weights),
        faces_(faces),
        settings_(settings),
        progress_(progress),
        bones_(static_cast<std::size_t>(source_weights.bones())),
        exact_(positions.begin(), positions.end()),
        frame_(exact_),
        target_(weld(frame_, exact_, faces, progress)),
        source_(points_in(frame_, std::vector<double>(source_positions.begin(), source_positions.end())),
                std::move(source_triangles), source_weights, progress),
        is_matched_(target_.points.size()) {}

  TransferredWeights run() {
    if (progress_) progress_->start(kMatchSteps + kInpaintSteps + kIslandSteps);
    match(points_in(frame_, exact_));
    set_free(exact_);
    inpaint_weights(target_, faces_, rows_, progress_, kInpaintSteps);
    attach_islands();
    if (progress_) progress_->advance(kInpaintSteps + kIslandSteps);  // what was not needed counts as done
    TransferredWeights made{WeightTable(weights_.bones()), {}};
    for (const std::uint32_t p : target_.point_of) {
      made.weights.add_row(rows_.row(p));
      made.matched.push_back(is_matched_[p]);
    }
    return made;
  }

 private:
  /// places  of the vertices of the target.
  void match(const std::vector<Eigen::Vector3d>& places) {
    const std::vector<Eigen::Vector3d> normals =
        normals_of(places, triangles_of(faces_), target_.point_of, target_.points.size());
    Eigen::Vector3d low = places.front(), high = low;
    for (const Eigen::Vector3d& place : places) low = low.cwiseMin(place), high = high.cwiseMax(place);
    const double within = settings_.distance * (high - low).norm();
    const double least_cosine = std::cos(settings_.angle * std::numbers::pi / 180) - 1e-12;
    const std::vector<Eigen::Vector3d> source_normals =
        normals_of(source_.points(), source_.triangles(), {}, source_.points().size());
    const auto cosine_of = [&](const Eigen::Vector3d& normal, const Eigen::Vector3d& own) {
      const double lengths = normal.stableNorm() * own.stableNorm();
      const double cosine = lengths > 0 ? normal.dot(own) / lengths : 1;  // without normals: by distance alone
      return settings_.flipped ? std::abs(cosine) : cosine;
    };
    const auto cosine_at = [&](const SurfacePoint& hit, const Eigen::Vector3d& own) {
      Eigen::Vector3d normal = Eigen::Vector3d::Zero();
      const Triangle& corners = source_.triangle(hit);
      for (int i = 0; i < 3; ++i) normal += hit.shares[i] * source_normals[corners[i]].stableNormalized();
      return cosine_of(normal, own);
    };
    std::vector<SurfacePoint> hits(target_.points.size());
    std::vector<double> cosines(hits.size(), -2);  // those of points without a hit
    for_parts(hits.size(), kPart, progress_, kMatchSteps, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t p = begin; p < end; ++p) {
        hits[p] = source_.tree().closest(target_.points[p],
                                         within * within * (1 + 1e-9) + std::numeric_limits<double>::min());
        if (hits[p].triangle != SurfacePoint().triangle) cosines[p] = cosine_at(hits[p], normals[p]);
      }
    });
    add_tight(hits, kTight * (high - low).norm(), cosine_of, least_cosine, normals, cosines);
    rows_ = table_of_rows(hits.size(), weights_.bones(), kPart, progress_, 0, [&](auto begin, auto end, auto& rows) {
      RowSum sum(bones_);
      for (std::size_t p = begin; p < end; ++p) {
        if (cosines[p] >= least_cosine) source_.read(hits[p], sum);
        const double total = sum.total();
        is_matched_[p] = total > 0;
        rows.add_row(sum.take(total > 0 ? 1 / total : 0));
      }
    });
  }

  /// Where the target lies on the source, no farther than `reach`, closest points that face another way count as alike, as
  /// those of folds, inner layers and seams, unless they face away and something near by does not, as of lips that touch.
  template <class Cosine>
  void add_tight(std::span<const SurfacePoint> hits, double reach, const Cosine& cosine_of, double least_cosine,
                 std::span<const Eigen::Vector3d> normals, std::span<double> cosines) const {
    const auto neighbours = neighbours_by_sides(faces_, target_.point_of, hits.size());
    std::vector<std::uint32_t> tight;
    std::vector<std::uint8_t> is_known(hits.size());
    for (std::uint32_t p = 0; p < hits.size(); ++p) {
      is_known[p] = cosines[p] >= least_cosine;
      if (is_known[p] && hits[p].squared_distance <= reach * reach) tight.push_back(p);
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
        return cosine_of(doubled_area(source_.points(), source_.triangles()[t]), normals[p]) >= least_cosine;
      });
    };
    for_parts(tight.size() - first, kPart, progress_, 0, [&](std::size_t begin, std::size_t end, std::size_t) {
      std::vector<std::uint32_t> near;
      for (std::size_t i = first + begin; i < first + end; ++i) {
        if (cosines[tight[i]] >= kTurned || !has_other(tight[i], near)) cosines[tight[i]] = 1;
      }
    });
  }

  /// Gives each island without weights those of the nearest point of one that has them, or of the source.
  void attach_islands() {
    std::vector<std::vector<std::uint32_t>> islands(static_cast<std::size_t>(target_.part_count));
    for (std::uint32_t p = 0; p < target_.points.size(); ++p) {
      if (rows_.row(p).empty()) islands[target_.part_of[p]].push_back(p);
    }
    std::erase_if(islands, [](const auto& own) { return own.empty(); });
    if (islands.empty()) return;
    std::vector<Triangle> dressed = with_weights(target_.triangles, rows_),
                          painted = with_weights(source_.triangles(), weights_);
    std::optional<WeightedSurface> on_target, on_source;
    if (!dressed.empty()) on_target.emplace(target_.points, std::move(dressed), rows_, progress_);
    if (painted.size() < source_.triangles().size())
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
                if (k % kPart == 0) stop_if_cancelled(progress_);
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
  WeldedMesh target_;
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
  std::vector<Triangle> triangles = triangles_of(source_faces);
  if (triangles.empty()) fail("the source has no faces; expected a surface on which the closest points are");
  if (with_weights(triangles, source_weights).empty()) {
    fail("the source has no weight above 0 on its faces; bind or paint it first");
  }
  if (vertices == 0) return TransferredWeights{WeightTable(source_weights.bones()), {}};
  try {
    return Transfer(source_positions, std::move(triangles), source_weights, positions, faces, settings, progress).run();
  } catch (const Cancelled&) {
    return std::nullopt;
  }
}

}  // namespace sinew
