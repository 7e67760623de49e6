#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "base/parallel.h"
#include "sinew/weight_tools.h"
#include "weight_tools/check_tables.h"
#include "weight_tools/weighted_surface.h"

namespace sinew {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

constexpr std::size_t kColumns = 8;

/// Solved weights below are left out.
constexpr double kLeast = 1e-4;

/// Cotangents are clamped to this range, so that no weight is negative and everything is connected.
constexpr double kLeastCotangent = 0.01, kMostCotangent = 20;

/// Sums of areas times normals, by vertex.
std::vector<Eigen::Vector3d> normals_of(std::span<const Eigen::Vector3d> places, std::span<const Triangle> triangles,
                                        std::span<const std::uint32_t> point_of, std::size_t points) {
  std::vector<Eigen::Vector3d> normals(points, Eigen::Vector3d::Zero());
  for (const Triangle& own : triangles) {
    const Eigen::Vector3d normal = (places[own[1]] - places[own[0]]).cross(places[own[2]] - places[own[0]]);
    for (const std::uint32_t v : own) normals[point_of.empty() ? v : point_of[v]] += normal;
  }
  return normals;
}

/// Returns the weights nearest to w that are not negative and sum to 1.
void project(Eigen::Ref<Eigen::VectorXd> w) {
  std::vector<double> sorted(w.data(), w.data() + w.size());
  std::sort(sorted.begin(), sorted.end(), std::greater<>());
  double sum = 0, shift = 0;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    sum += sorted[i];
    const double own = (sum - 1) / static_cast<double>(i + 1);
    if (sorted[i] > own) shift = own;
  }
  w = (w.array() - shift).max(0.0);
}

class Transfer {
 public:
  Transfer(std::span<const float> source_positions, const Faces& source_faces, const WeightTable& source_weights,
           std::span<const float> positions, const Faces& faces, const TransferSettings& settings)
      : weights_(source_weights),
        settings_(settings),
        bones_(static_cast<std::size_t>(source_weights.bones)),
        exact_(positions.begin(), positions.end()),
        frame_(exact_),
        places_(points_in(frame_, exact_)),
        target_(weld(frame_, exact_, faces.offsets, faces.vertices)),
        source_triangles_(triangles_of(source_faces)),
        source_places_(points_in(frame_, std::vector<double>(source_positions.begin(), source_positions.end()))),
        source_(source_places_, source_triangles_, source_weights),
        rows_(target_.points.size() * bones_),
        state_(target_.points.size(), State::open) {
    match(normals_of(places_, triangles_of(faces), target_.point_of, target_.points.size()));
  }

  TransferredWeights run() {
    inpaint();
    attach_islands();
    TransferredWeights made;
    made.weights.resize(target_.point_of.size() * bones_);
    made.matched.resize(target_.point_of.size());
    for (std::size_t v = 0; v < target_.point_of.size(); ++v) {
      const std::size_t p = target_.point_of[v];
      std::copy_n(row(p), bones_, made.weights.data() + v * bones_);
      made.matched[v] = state_[p] == State::matched;
    }
    return made;
  }

 private:
  enum class State : std::uint8_t { open, matched, solved };

  float* row(std::size_t point) { return rows_.data() + point * bones_; }

  void match(const std::vector<Eigen::Vector3d>& normals) {
    Eigen::Vector3d low = places_.front(), high = low;
    for (const Eigen::Vector3d& place : places_) low = low.cwiseMin(place), high = high.cwiseMax(place);
    const double within = settings_.distance * (high - low).norm();
    const double least_cosine = std::cos(settings_.angle * std::numbers::pi / 180);
    const std::vector<Eigen::Vector3d> source_normals =
        normals_of(source_places_, source_triangles_, {}, source_places_.size());
    parallel_for(target_.points.size(), 128, [&](std::size_t begin, std::size_t end) {
      for (std::size_t p = begin; p < end; ++p) {
        const SurfacePoint hit = source_.tree().closest(
            target_.points[p], within * within * (1 + 1e-9) + std::numeric_limits<double>::min());
        if (hit.triangle == SurfacePoint().triangle) continue;
        Eigen::Vector3d normal = Eigen::Vector3d::Zero();
        for (int i = 0; i < 3; ++i) {
          normal += hit.shares[i] * source_normals[source_.triangle(hit)[i]].stableNormalized();
        }
        const double lengths = normal.stableNorm() * normals[p].stableNorm();
        double cosine = lengths > 0 ? normal.dot(normals[p]) / lengths : 1;  // without normals: by distance alone
        if (settings_.flipped) cosine = std::abs(cosine);
        if (cosine < least_cosine - 1e-12) continue;
        source_.read(hit, row(p));
        if (normalize(row(p), weights_.bones)) state_[p] = State::matched;
      }
    });
  }

  /// The Laplacian of cotangents and the areas of points.
  Sparse laplacian(Eigen::VectorXd& areas) const {
    const auto count = static_cast<Eigen::Index>(target_.points.size());
    areas.setZero(count);
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(12 * target_.triangles.size());
    for (const Triangle& own : target_.triangles) {
      for (int i = 0; i < 3; ++i) {
        const std::uint32_t a = own[(i + 1) % 3], b = own[(i + 2) % 3];
        const Eigen::Vector3d to_a = target_.points[a] - target_.points[own[i]];
        const Eigen::Vector3d to_b = target_.points[b] - target_.points[own[i]];
        const double area = to_a.cross(to_b).norm();
        const double cotangent = area > 0 ? to_a.dot(to_b) / area : kLeastCotangent;
        const double half = 0.5 * std::clamp(cotangent, kLeastCotangent, kMostCotangent);
        entries.emplace_back(a, b, -half);
        entries.emplace_back(b, a, -half);
        entries.emplace_back(a, a, half);
        entries.emplace_back(b, b, half);
        areas[own[i]] += area / 6;
      }
    }
    areas = areas.array().max(1e-3 * areas.mean() + std::numeric_limits<double>::min());
    Sparse matrix(count, count);
    matrix.setFromTriplets(entries.begin(), entries.end());
    return matrix;
  }

  /// Solves for the open points of islands that have matched ones.
  void inpaint() {
    std::vector<std::uint8_t> has_match(static_cast<std::size_t>(target_.part_count));
    for (std::size_t p = 0; p < state_.size(); ++p) {
      if (state_[p] == State::matched) has_match[target_.part_of[p]] = 1;
    }
    std::vector<std::uint32_t> open;
    std::vector<Eigen::Triplet<double>> picks;
    for (std::uint32_t p = 0; p < state_.size(); ++p) {
      if (state_[p] != State::open || !has_match[target_.part_of[p]]) continue;
      picks.emplace_back(p, static_cast<int>(open.size()), 1.0);
      open.push_back(p);
    }
    if (open.empty()) return;
    Sparse pick(static_cast<Eigen::Index>(state_.size()), static_cast<Eigen::Index>(open.size()));
    pick.setFromTriplets(picks.begin(), picks.end());
    Eigen::VectorXd areas;
    const Sparse own_laplacian = laplacian(areas);
    const Sparse of_open = own_laplacian * pick;
    const Sparse weighted = of_open.transpose() * areas.cwiseInverse().asDiagonal();
    Eigen::SimplicialLDLT<Sparse> factor(Sparse(weighted * of_open));
    Sparse to_right = weighted * own_laplacian;
    if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > 0)) {  // then without the square
      to_right = pick.transpose() * own_laplacian;
      factor.compute(Sparse(to_right * pick));
    }
    const std::vector<std::size_t> columns = used_bones();
    Eigen::MatrixXd solution(static_cast<Eigen::Index>(open.size()), static_cast<Eigen::Index>(columns.size()));
    parallel_for((columns.size() + kColumns - 1) / kColumns, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t panel = begin; panel < end; ++panel) {
        const std::size_t first = panel * kColumns, count = std::min(kColumns, columns.size() - first);
        Eigen::MatrixXd known(static_cast<Eigen::Index>(state_.size()), static_cast<Eigen::Index>(count));
        for (std::size_t p = 0; p < state_.size(); ++p) {
          for (std::size_t i = 0; i < count; ++i) {
            known(static_cast<Eigen::Index>(p), static_cast<Eigen::Index>(i)) =
                state_[p] == State::matched ? rows_[p * bones_ + columns[first + i]] : 0;
          }
        }
        const Eigen::MatrixXd right = -(to_right * known);
        solution.middleCols(static_cast<Eigen::Index>(first), static_cast<Eigen::Index>(count)) = factor.solve(right);
      }
    });
    parallel_for(open.size(), 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        Eigen::VectorXd own = solution.row(static_cast<Eigen::Index>(i));
        project(own);
        own = (own.array() < kLeast).select(0.0, own);
        own /= own.sum();
        for (std::size_t j = 0; j < columns.size(); ++j) {
          row(open[i])[columns[j]] = static_cast<float>(own[static_cast<Eigen::Index>(j)]);
        }
        state_[open[i]] = State::solved;
      }
    });
  }

  /// The bones that have weight at a matched point.
  std::vector<std::size_t> used_bones() const {
    std::vector<std::uint8_t> is_used(bones_);
    for (std::size_t p = 0; p < state_.size(); ++p) {
      if (state_[p] != State::matched) continue;
      for (std::size_t j = 0; j < bones_; ++j) is_used[j] |= rows_[p * bones_ + j] > 0;
    }
    std::vector<std::size_t> used;
    for (std::size_t j = 0; j < bones_; ++j) {
      if (is_used[j]) used.push_back(j);
    }
    return used;
  }

  /// Gives each island without weights those of the nearest point of one that has them, or of the source.
  void attach_islands() {
    std::vector<std::vector<std::uint32_t>> islands(static_cast<std::size_t>(target_.part_count));
    for (std::uint32_t p = 0; p < state_.size(); ++p) {
      if (state_[p] == State::open) islands[target_.part_of[p]].push_back(p);
    }
    std::erase_if(islands, [](const auto& own) { return own.empty(); });
    if (islands.empty()) return;
    std::vector<Triangle> weighted;
    for (const Triangle& own : target_.triangles) {
      if (state_[own[0]] != State::open) weighted.push_back(own);
    }
    const std::vector<float> before = rows_;
    const WeightTable table{before, std::ssize(state_), weights_.bones};
    std::optional<WeightedSurface> dressed;
    if (!weighted.empty()) dressed.emplace(target_.points, weighted, table);
    parallel_for(islands.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const auto nearest = [&](const WeightedSurface& surface) {
          SurfacePoint best;
          for (const std::uint32_t p : islands[i]) {
            const SurfacePoint hit = surface.tree().closest(target_.points[p], best.squared_distance);
            if (hit.squared_distance < best.squared_distance) best = hit;
          }
          return best;
        };
        const SurfacePoint on_source = nearest(source_);
        const SurfacePoint on_target = dressed ? nearest(*dressed) : SurfacePoint();
        std::vector<float> own(bones_);
        if (on_target.squared_distance <= on_source.squared_distance && dressed) {
          dressed->read(on_target, own.data());
        } else {
          source_.read(on_source, own.data());
        }
        normalize(own.data(), weights_.bones);
        for (const std::uint32_t p : islands[i]) std::copy(own.begin(), own.end(), row(p));
      }
    });
  }

  const WeightTable& weights_;
  const TransferSettings& settings_;
  std::size_t bones_;
  std::vector<double> exact_;
  UnitFrame frame_;  // of the target
  std::vector<Eigen::Vector3d> places_;
  WeldedMesh target_;
  std::vector<Triangle> source_triangles_;
  std::vector<Eigen::Vector3d> source_places_;
  WeightedSurface source_;
  std::vector<float> rows_;  // points of the target x bones
  std::vector<State> state_;
};

}  // namespace

TransferredWeights transfer_weights(std::span<const float> source_positions, const Faces& source_faces,
                                    const WeightTable& source_weights, std::span<const float> positions,
                                    const Faces& faces, const TransferSettings& settings) {
  check_table("source_weights", source_weights);
  check_positions("source_positions", source_positions, source_weights.vertices);
  check_faces(source_faces, source_weights.vertices);
  const std::ptrdiff_t vertices = std::ssize(positions) / 3;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (!std::isfinite(positions[i])) fail("positions is not finite at vertex ", i / 3);
  }
  check_faces(faces, vertices);
  if (!(settings.distance > 0) || !std::isfinite(settings.distance)) {
    fail("distance is ", settings.distance, "; expected a number above 0");
  }
  check_range("angle", settings.angle, 0, 180);
  if (triangles_of(source_faces).empty()) {
    fail("the source has no faces; expected a surface on which the closest points are");
  }
  if (std::none_of(source_weights.numbers.begin(), source_weights.numbers.end(), [](float w) { return w > 0; })) {
    fail("the source has no weight above 0; bind or paint it first");
  }
  if (vertices == 0) return {};
  return Transfer(source_positions, source_faces, source_weights, positions, faces, settings).run();
}

}  // namespace sinew
