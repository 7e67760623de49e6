#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <numeric>

#include "base/parallel.h"
#include "sinew/weight_tools.h"
#include "weight_tools/check_tables.h"

namespace sinew {
namespace {

/// Solved together, so that the factor is read once for all of them.
constexpr std::ptrdiff_t kColumns = 8;

/// Points, one for all vertices that coincide, and what they are joined to by edges.
struct Graph {
  std::vector<std::uint32_t> point_of;  ///< V
  std::vector<std::uint32_t> begin, neighbours;
  std::size_t points() const { return begin.size() - 1; }
};

std::vector<std::uint32_t> points_of_vertices(std::span<const float> positions, std::size_t vertices,
                                              std::size_t& count) {
  std::vector<std::uint32_t> order(vertices), first(vertices), point(vertices);
  std::iota(order.begin(), order.end(), 0u);
  first = order;
  if (!positions.empty()) {
    const auto place = [&](std::uint32_t v) {
      return std::array{positions[3 * v], positions[3 * v + 1], positions[3 * v + 2]};
    };
    std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return place(a) < place(b); });
    for (std::size_t i = 1; i < vertices; ++i) {
      if (place(order[i]) == place(order[i - 1])) first[order[i]] = first[order[i - 1]];
    }
  }
  count = 0;
  for (std::uint32_t v = 0; v < vertices; ++v) {
    point[v] = first[v] == v ? static_cast<std::uint32_t>(count++) : point[first[v]];
  }
  return point;
}

Graph graph_of(std::span<const float> positions, const Faces& faces, std::size_t vertices) {
  Graph graph;
  std::size_t points = 0;
  graph.point_of = points_of_vertices(positions, vertices, points);
  const auto for_edges = [&](const auto& visit) {
    for (std::size_t f = 0; f + 1 < faces.offsets.size(); ++f) {
      std::uint32_t a = graph.point_of[faces.vertices[faces.offsets[f + 1] - 1]];
      for (std::int32_t i = faces.offsets[f]; i < faces.offsets[f + 1]; ++i) {
        const std::uint32_t b = graph.point_of[faces.vertices[i]];
        if (a != b) visit(a, b);
        a = b;
      }
    }
  };
  // Edges of two faces are there twice at first.
  std::vector<std::uint32_t> first(points + 1, 0);
  for_edges([&](std::uint32_t a, std::uint32_t b) { ++first[a + 1], ++first[b + 1]; });
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<std::uint32_t> others(first.back()), end(first.begin(), first.end() - 1);
  for_edges([&](std::uint32_t a, std::uint32_t b) { others[end[a]++] = b, others[end[b]++] = a; });
  graph.begin.push_back(0);
  graph.neighbours.reserve(others.size());
  for (std::size_t p = 0; p < points; ++p) {
    const auto own = others.begin() + first[p], last = others.begin() + first[p + 1];
    std::sort(own, last);
    graph.neighbours.insert(graph.neighbours.end(), own, std::unique(own, last));
    graph.begin.push_back(static_cast<std::uint32_t>(graph.neighbours.size()));
  }
  return graph;
}

class Smoothing {
 public:
  Smoothing(const WeightTable& weights, const Faces& faces, const SmoothWeightsSettings& settings)
      : weights_(weights),
        settings_(settings),
        graph_(graph_of(settings.positions, faces, static_cast<std::size_t>(weights.vertices))),
        numbers_(weights.numbers.begin(), weights.numbers.end()),
        rate_(graph_.points(), 1) {
    if (!settings.mask.empty()) {
      for (std::size_t v = 0; v < graph_.point_of.size(); ++v) {
        float& own = rate_[graph_.point_of[v]];
        own = std::min(own, settings.mask[v]);
      }
    }
    if (graph_.points() < graph_.point_of.size()) join_coincident();
  }

  void take_steps() {
    std::vector<float> next(numbers_.size());
    for (int step = 0; step < settings_.steps; ++step) {
      parallel_for(graph_.points(), 512, [&](std::size_t begin, std::size_t end) {
        for (std::size_t p = begin; p < end; ++p) {
          const float* const own = numbers_.data() + p * bones();
          float* const result = next.data() + p * bones();
          const std::uint32_t first = graph_.begin[p], last = graph_.begin[p + 1];
          const float share = static_cast<float>(settings_.factor) * rate_[p];
          if (first == last || share == 0) {
            std::copy_n(own, bones(), result);
            continue;
          }
          std::fill_n(result, bones(), 0.0f);
          for (std::uint32_t i = first; i < last; ++i) {
            const float* const other = numbers_.data() + graph_.neighbours[i] * bones();
            for (std::size_t j = 0; j < bones(); ++j) result[j] += other[j];
          }
          const float of_each = share / static_cast<float>(last - first);
          for (std::size_t j = 0; j < bones(); ++j) result[j] = (1 - share) * own[j] + of_each * result[j];
        }
      });
      numbers_.swap(next);
    }
  }

  /// (D + t (D - A)) w' = D w, with the neighbours A and how many they are, D: symmetric.
  void solve() {
    std::vector<std::int32_t> row(graph_.points(), -1);
    std::vector<std::uint32_t> free;
    for (std::uint32_t p = 0; p < graph_.points(); ++p) {
      if (rate_[p] < 0.5f || graph_.begin[p] == graph_.begin[p + 1]) continue;
      row[p] = static_cast<std::int32_t>(free.size());
      free.push_back(p);
    }
    if (free.empty()) return;
    const double t = settings_.strength;
    std::vector<Eigen::Triplet<double>> entries;
    for (const std::uint32_t p : free) {
      const double degree = graph_.begin[p + 1] - graph_.begin[p];
      entries.emplace_back(row[p], row[p], (1 + t) * degree);
      for (std::uint32_t i = graph_.begin[p]; i < graph_.begin[p + 1]; ++i) {
        if (row[graph_.neighbours[i]] >= 0) entries.emplace_back(row[p], row[graph_.neighbours[i]], -t);
      }
    }
    const auto count = static_cast<Eigen::Index>(free.size());
    Eigen::SparseMatrix<double> matrix(count, count);
    matrix.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(matrix);
    const std::vector<float> before = numbers_;
    parallel_for((bones() + kColumns - 1) / kColumns, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t panel = begin; panel < end; ++panel) {
        const std::size_t first = panel * kColumns, columns = std::min<std::size_t>(kColumns, bones() - first);
        Eigen::MatrixXd right(count, columns);
        for (const std::uint32_t p : free) {
          const double degree = graph_.begin[p + 1] - graph_.begin[p];
          for (std::size_t j = 0; j < columns; ++j) {
            double sum = degree * before[p * bones() + first + j];
            for (std::uint32_t i = graph_.begin[p]; i < graph_.begin[p + 1]; ++i) {
              const std::uint32_t other = graph_.neighbours[i];
              if (row[other] < 0) sum += t * before[other * bones() + first + j];
            }
            right(row[p], static_cast<Eigen::Index>(j)) = sum;
          }
        }
        if (right.isZero(0)) continue;  // nobody near has weight
        const Eigen::MatrixXd solution = factor.solve(right);
        for (const std::uint32_t p : free) {
          for (std::size_t j = 0; j < columns; ++j) {
            numbers_[p * bones() + first + j] =
                std::max(0.0f, static_cast<float>(solution(row[p], static_cast<Eigen::Index>(j))));
          }
        }
      }
    });
  }

  std::vector<float> result() && {
    if (settings_.locked.empty() && graph_.points() == graph_.point_of.size()) return std::move(numbers_);
    std::vector<float> made(weights_.numbers.begin(), weights_.numbers.end());
    std::vector<std::uint8_t> is_locked(bones());
    for (const std::int32_t bone : settings_.locked) is_locked[bone] = 1;
    parallel_for(graph_.point_of.size(), 512, [&](std::size_t begin, std::size_t end) {
      for (std::size_t v = begin; v < end; ++v) {
        const std::size_t point = graph_.point_of[v];
        if (rate_[point] == 0 || graph_.begin[point] == graph_.begin[point + 1]) continue;
        float* const own = made.data() + v * bones();
        const float* const smooth = numbers_.data() + point * bones();
        double before = 0, after = 0;
        for (std::size_t j = 0; j < bones(); ++j) {
          if (is_locked[j]) continue;
          before += own[j];
          after += smooth[j];
        }
        if (!settings_.locked.empty() && !(after > 0)) continue;
        const auto scale = settings_.locked.empty() ? 1.0f : static_cast<float>(before / after);
        for (std::size_t j = 0; j < bones(); ++j) {
          if (!is_locked[j]) own[j] = scale * smooth[j];
        }
      }
    });
    return made;
  }

 private:
  /// Begins with the mean weights of vertices that coincide.
  void join_coincident() {
    std::vector<float> counts(graph_.points());
    numbers_.assign(graph_.points() * bones(), 0);
    for (std::size_t v = 0; v < graph_.point_of.size(); ++v) {
      const std::size_t point = graph_.point_of[v];
      const float* const own = weights_.row(static_cast<std::ptrdiff_t>(v));
      counts[point] += 1;
      for (std::size_t j = 0; j < bones(); ++j) numbers_[point * bones() + j] += own[j];
    }
    for (std::size_t p = 0; p < graph_.points(); ++p) {
      for (std::size_t j = 0; j < bones(); ++j) numbers_[p * bones() + j] /= counts[p];
    }
  }

  std::size_t bones() const { return static_cast<std::size_t>(weights_.bones); }

  const WeightTable& weights_;
  const SmoothWeightsSettings& settings_;
  Graph graph_;
  std::vector<float> numbers_;  // points x bones
  std::vector<float> rate_;     // of each point
};

}  // namespace

std::vector<float> smooth_weights(const WeightTable& weights, const Faces& faces,
                                  const SmoothWeightsSettings& settings) {
  check_table("weights", weights);
  check_faces(faces, weights.vertices);
  check_mask(settings.mask, weights.vertices);
  if (!settings.positions.empty()) check_positions("positions", settings.positions, weights.vertices);
  check_range("strength", settings.strength, 0, 1e6);
  check_range("steps", settings.steps, 0, 10000);
  check_range("factor", settings.factor, 0, 1);
  for (const std::int32_t bone : settings.locked) {
    if (bone < 0 || bone >= weights.bones)
      fail("locked names bone ", bone, "; there are ", plural(weights.bones, "bone"));
  }
  Smoothing smoothing(weights, faces, settings);
  settings.strength > 0 ? smoothing.solve() : smoothing.take_steps();
  return std::move(smoothing).result();
}

}  // namespace sinew
