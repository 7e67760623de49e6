#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/parallel.h"
#include "decompose/simplex_least_squares.h"
#include "sinew/weight_tools.h"
#include "weight_tools/check_tables.h"

namespace sinew {
namespace {

/// So many sets are tried at a vertex, times poses.
constexpr double kTries = 100000;

/// Draws fitted weights to those of before where the poses do not determine them.
constexpr double kPull = 1e-6;

double combinations(int n, int k) {
  double count = 1;
  for (int i = 1; i <= k; ++i) count = count * (n - k + i) / i;
  return count;
}

/// Changes ascending numbers from [0, n) into those that follow in lexicographic order. Returns false after the last.
bool next_combination(std::vector<int>& numbers, int n) {
  const int k = static_cast<int>(numbers.size());
  int i = k - 1;
  while (i >= 0 && numbers[i] == n - k + i) --i;
  if (i < 0) return false;
  std::iota(numbers.begin() + i, numbers.end(), numbers[i] + 1);
  return true;
}

/// One vertex: where its bones take it in the poses. One object for each thread.
class VertexReduction {
 public:
  VertexReduction(const WeightTable& weights, std::span<const float> positions, MatrixStack<const double> matrices,
                  int most)
      : weights_(weights), positions_(positions), matrices_(matrices), most_(most) {}

  void run(std::ptrdiff_t v, ReducedWeights& result) {
    const float* const row = weights_.row(v);
    bones_.clear();
    for (std::ptrdiff_t j = 0; j < weights_.bones; ++j) {
      if (row[j] > 0) bones_.push_back(static_cast<std::int32_t>(j));
    }
    if (std::ssize(bones_) <= most_) return;
    read(v, row);
    const std::vector<int> kept = choose();
    Eigen::VectorXd own = normalized(kept);
    Eigen::VectorXd fitted = fit(kept, own);
    if (largest(fitted) <= largest(own)) own = fitted;
    float* const written = result.weights.data() + v * weights_.bones;
    for (std::size_t i = 0; i < bones_.size(); ++i) {
      written[bones_[i]] = static_cast<float>(sum_ * own[static_cast<Eigen::Index>(i)]);
    }
    measure(own, v, result);
  }

  /// Measures how far the vertex moves by weights that have become others.
  void measure_changed(std::ptrdiff_t v, ReducedWeights& result) {
    const float* const row = weights_.row(v);
    bones_.clear();
    for (std::ptrdiff_t j = 0; j < weights_.bones; ++j) {
      if (row[j] > 0) bones_.push_back(static_cast<std::int32_t>(j));
    }
    read(v, row);
    Eigen::VectorXd own(shares_.size());
    for (std::size_t i = 0; i < bones_.size(); ++i) {
      own[static_cast<Eigen::Index>(i)] = result.weights[v * weights_.bones + bones_[i]] / sum_;
    }
    measure(own, v, result);
  }

 private:
  void measure(const Eigen::VectorXd& own, std::ptrdiff_t v, ReducedWeights& result) const {
    const Eigen::VectorXd off = moves(own);
    double sum = 0, longest = 0;
    for (Eigen::Index f = 0; f < matrices_.frames; ++f) {
      const double move = off.segment<3>(3 * f).norm();
      sum += move;
      longest = std::max(longest, move);
    }
    result.largest[v] = static_cast<float>(longest);
    result.mean[v] = static_cast<float>(sum / static_cast<double>(std::max<std::ptrdiff_t>(1, matrices_.frames)));
  }

  void read(std::ptrdiff_t v, const float* row) {
    const auto n = static_cast<Eigen::Index>(bones_.size());
    const Eigen::Vector3d rest = Eigen::Vector3f::Map(positions_.data() + 3 * v).cast<double>();
    shares_.resize(n);
    for (Eigen::Index i = 0; i < n; ++i) shares_[i] = row[bones_[i]];
    sum_ = shares_.sum();
    shares_ /= sum_;
    places_.resize(3 * matrices_.frames, n);
    for (Eigen::Index f = 0; f < matrices_.frames; ++f) {
      for (Eigen::Index i = 0; i < n; ++i) {
        const auto matrix = matrices_.at(f, bones_[i]);
        places_.block<3, 1>(3 * f, i) = matrix.topLeftCorner<3, 3>() * rest + matrix.topRightCorner<3, 1>();
      }
    }
    target_ = places_ * shares_;
    places_.colwise() -= target_;  // so that what is left out of a sum with shares of 1 is the move
  }

  Eigen::VectorXd moves(const Eigen::VectorXd& shares) const { return places_ * shares; }

  double largest(const Eigen::VectorXd& shares) const {
    const Eigen::VectorXd off = moves(shares);
    double most = 0;
    for (Eigen::Index f = 0; f < matrices_.frames; ++f) most = std::max(most, off.segment<3>(3 * f).squaredNorm());
    return most;
  }

  Eigen::VectorXd normalized(const std::vector<int>& kept) const {
    Eigen::VectorXd own = Eigen::VectorXd::Zero(shares_.size());
    for (const int i : kept) own[i] = shares_[i];
    return own / own.sum();
  }

  /// The kept weights for which the largest move is smallest; among equals, those that keep more weight.
  std::vector<int> choose() const {
    const int n = static_cast<int>(bones_.size());
    std::pair<double, double> best(std::numeric_limits<double>::infinity(), 0);
    std::vector<int> kept, tried;
    const auto try_it = [&] {
      double weight = 0;
      for (const int i : tried) weight += shares_[i];
      const std::pair cost(largest(normalized(tried)), -weight);
      if (cost < best) best = cost, kept = tried;
    };
    if (combinations(n, most_) * static_cast<double>(std::max<std::ptrdiff_t>(1, matrices_.frames)) <= kTries) {
      tried.resize(most_);
      std::iota(tried.begin(), tried.end(), 0);
      do {
        try_it();
      } while (next_combination(tried, n));
      return kept;
    }
    std::vector<int> left(n);
    for (int i = 0; i < n; ++i) left[i] = i;
    while (std::ssize(left) > most_) {
      best = {std::numeric_limits<double>::infinity(), 0};
      for (std::size_t out = 0; out < left.size(); ++out) {
        tried = left;
        tried.erase(tried.begin() + static_cast<std::ptrdiff_t>(out));
        try_it();
      }
      left = kept;
    }
    return left;
  }

  Eigen::VectorXd fit(const std::vector<int>& kept, const Eigen::VectorXd& near) {
    Eigen::MatrixXd g = places_.transpose() * places_;
    const double pull = kPull * g.diagonal().maxCoeff() + std::numeric_limits<double>::min();
    const Eigen::VectorXd b = pull * near;
    g.diagonal().array() += pull;
    Eigen::VectorXd own(shares_.size());
    solver_.solve_among(g, b, kept, own);
    return own;
  }

  const WeightTable& weights_;
  std::span<const float> positions_;
  MatrixStack<const double> matrices_;
  int most_;
  std::vector<std::int32_t> bones_;  // of the vertex
  Eigen::VectorXd shares_, target_;  // of the bones; where they take it
  Eigen::MatrixXd places_;           // where each bone takes it, less the target
  double sum_ = 0;
  SimplexLeastSquares solver_;
};

/// The neighbours of each vertex along edges of faces, some of them twice.
struct Rings {
  std::vector<std::uint32_t> begin, neighbours;

  Rings(const Faces& faces, std::size_t vertices) : begin(vertices + 1, 0) {
    const auto for_edges = [&](const auto& visit) {
      for (std::size_t f = 0; f + 1 < faces.offsets.size(); ++f) {
        std::int32_t a = faces.vertices[faces.offsets[f + 1] - 1];
        for (std::int32_t i = faces.offsets[f]; i < faces.offsets[f + 1]; ++i) {
          visit(a, faces.vertices[i]);
          a = faces.vertices[i];
        }
      }
    };
    for_edges([&](std::int32_t a, std::int32_t b) { ++begin[a + 1], ++begin[b + 1]; });
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    neighbours.resize(begin.back());
    std::vector<std::uint32_t> end(begin.begin(), begin.end() - 1);
    for_edges([&](std::int32_t a, std::int32_t b) { neighbours[end[a]++] = b, neighbours[end[b]++] = a; });
  }
};

/// Fades each bone's weights towards the vertices that have lost it. Returns the vertices whose weights it changes.
std::vector<std::uint8_t> fade(const WeightTable& before, const Faces& faces, int rings, std::vector<float>& weights) {
  const auto vertices = static_cast<std::size_t>(before.vertices), bones = static_cast<std::size_t>(before.bones);
  const Rings around(faces, vertices);
  std::vector<float> faded = weights;
  parallel_for(bones, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t j = begin; j < end; ++j) {
      std::vector<int> ring(vertices, -1);
      std::vector<std::uint32_t> front, next;
      for (std::uint32_t v = 0; v < vertices; ++v) {
        if (before.numbers[v * bones + j] > 0 && weights[v * bones + j] == 0) ring[v] = 0, front.push_back(v);
      }
      for (int step = 1; step <= rings && !front.empty(); ++step, front.swap(next)) {
        next.clear();
        for (const std::uint32_t v : front) {
          for (std::uint32_t i = around.begin[v]; i < around.begin[v + 1]; ++i) {
            const std::uint32_t other = around.neighbours[i];
            if (ring[other] >= 0) continue;
            ring[other] = step;
            next.push_back(other);
            faded[other * bones + j] *= static_cast<float>(step) / static_cast<float>(rings + 1);
          }
        }
      }
    }
  });
  std::vector<std::uint8_t> is_changed(vertices);
  for (std::size_t v = 0; v < vertices; ++v) {
    double sum = 0, rest = 0;
    for (std::size_t i = v * bones; i < (v + 1) * bones; ++i) {
      is_changed[v] |= faded[i] != weights[i];
      sum += weights[i];
      rest += faded[i];
    }
    if (!is_changed[v]) continue;
    for (std::size_t i = v * bones; i < (v + 1) * bones; ++i) weights[i] = static_cast<float>(faded[i] * (sum / rest));
  }
  return is_changed;
}

}  // namespace

ReducedWeights reduce_weights(const WeightTable& weights, std::span<const float> positions,
                              MatrixStack<const double> matrices, const Faces& faces, const ReduceSettings& settings) {
  check_table("weights", weights);
  check_positions("positions", positions, weights.vertices);
  check_faces(faces, weights.vertices);
  check_range("max_influences", settings.most, 1, 64);
  check_range("rings", settings.rings, 0, 64);
  if (settings.rings > 0 && faces.offsets.empty())
    fail("rings is ", settings.rings, ", and there are no faces; expected both");
  if (matrices.joints != weights.bones) {
    fail("matrices has ", plural(matrices.joints, "joint"), ", weights ", plural(weights.bones, "column"));
  }
  if (matrices.frames < 1) fail("matrices has no poses; expected one at least");
  for (std::ptrdiff_t f = 0; f < matrices.frames; ++f) {
    for (std::ptrdiff_t j = 0; j < matrices.joints; ++j) {
      if (!matrices.at(f, j).allFinite()) fail("matrices is not finite in pose ", f, " at joint ", j);
    }
  }
  const auto vertices = static_cast<std::size_t>(weights.vertices);
  ReducedWeights result{
      {weights.numbers.begin(), weights.numbers.end()}, std::vector<float>(vertices), std::vector<float>(vertices)};
  parallel_for(vertices, 64, [&](std::size_t begin, std::size_t end) {
    VertexReduction reduction(weights, positions, matrices, settings.most);
    for (std::size_t v = begin; v < end; ++v) reduction.run(static_cast<std::ptrdiff_t>(v), result);
  });
  if (settings.rings == 0) return result;
  const std::vector<std::uint8_t> is_changed = fade(weights, faces, settings.rings, result.weights);
  parallel_for(vertices, 64, [&](std::size_t begin, std::size_t end) {
    VertexReduction reduction(weights, positions, matrices, settings.most);
    for (std::size_t v = begin; v < end; ++v) {
      if (is_changed[v]) reduction.measure_changed(static_cast<std::ptrdiff_t>(v), result);
    }
  });
  return result;
}

}  // namespace sinew
