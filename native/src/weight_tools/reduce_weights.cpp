#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "decompose/simplex_least_squares.h"
#include "mesh/adjacency.h"
#include "sinew/weight_tools.h"
#include "weight_tools/check_tables.h"
#include "weights/weight_rows.h"

namespace sinew {
namespace {

constexpr std::size_t kVertices = 64;  // in a task

/// So many sets are tried at a vertex, times poses.
constexpr double kTries = 100000;

/// If a vertex has more weights, and more than twice as many as may stay, the others leave first.
constexpr std::size_t kMany = 24;

/// Draws fitted weights to those of before where the poses do not determine them.
constexpr double kPull = 1e-6;

/// Steps of the progress.
constexpr std::int64_t kReduceSteps = 100, kFadeSteps = 20;

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

/// How far a vertex moves over the poses.
struct Move {
  float largest, mean;
};

/// One vertex: where its bones take it in the poses. One object for each thread.
class VertexReduction {
 public:
  VertexReduction(std::span<const float> positions, MatrixStack<const double> matrices,
                  std::span<const std::uint8_t> is_locked, int most)
      : positions_(positions), matrices_(matrices), is_locked_(is_locked), most_(most) {}

  /// Adds the vertex's new row, and returns how far it moves by it.
  Move run(std::size_t v, std::span<const BoneWeight> row, WeightTable& rows) {
    const auto held = std::ranges::count_if(row, [&](const BoneWeight& own) { return is_locked_[own.bone] != 0; });
    const auto most = std::max<std::ptrdiff_t>(1, most_ - held);
    if (std::ssize(row) - held <= most) {
      rows.add_row(row);
      return {0, 0};
    }
    read(v, row);
    const std::vector<int> kept = choose(static_cast<int>(most));
    Eigen::VectorXd own = normalized(kept), fitted = fit(kept, own);
    if (largest(fitted) <= largest(own)) own = fitted;  // not if it is not a number
    row_.clear();
    for (std::size_t i = 0, free = 0; i < row.size(); ++i) {
      const bool stays = is_locked_[row[i].bone] != 0;
      const float weight = stays ? row[i].weight : as_weight(sum_ * own[static_cast<Eigen::Index>(free)]);
      free += !stays;
      if (weight > 0) row_.push_back({row[i].bone, weight});
    }
    rows.add_row(row_);
    return moved(own);
  }

  /// Measures how far the vertex moves by weights that have become others.
  Move measure(std::size_t v, std::span<const BoneWeight> before, std::span<const BoneWeight> after) {
    read(v, before);
    Eigen::VectorXd own = Eigen::VectorXd::Zero(shares_.size());
    for (const BoneWeight& one : after) {
      const auto found = std::ranges::lower_bound(bones_, one.bone);
      if (found != bones_.end() && *found == one.bone) own[found - bones_.begin()] = one.weight / sum_;
    }
    return moved(own);
  }

 private:
  Move moved(const Eigen::VectorXd& own) const {
    const Eigen::VectorXd off = places_ * own;
    double sum = 0, longest = 0;
    for (Eigen::Index f = 0; f < matrices_.frames; ++f) {
      const double move = free_share_ * off.segment<3>(3 * f).norm();
      sum += move;
      longest = std::max(longest, move);
    }
    return {static_cast<float>(longest), static_cast<float>(sum / static_cast<double>(matrices_.frames))};
  }

  /// Reads the bones that are not locked.
  void read(std::size_t v, std::span<const BoneWeight> row) {
    bones_.clear();
    shares_.resize(std::ssize(row));
    for (const BoneWeight& own : row) {
      if (is_locked_[own.bone]) continue;
      shares_[std::ssize(bones_)] = own.weight;
      bones_.push_back(own.bone);
    }
    const auto n = std::ssize(bones_);
    shares_.conservativeResize(n);
    sum_ = shares_.sum();
    free_share_ = sum_ / sum_of(row);
    shares_ /= sum_;
    const Eigen::Vector3d rest = Eigen::Vector3f::Map(positions_.data() + 3 * v).cast<double>();
    places_.resize(3 * matrices_.frames, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index f = 0; f < matrices_.frames; ++f) {
        const auto matrix = matrices_.at(f, bones_[i]);
        places_.block<3, 1>(3 * f, i) = matrix.topLeftCorner<3, 3>() * rest + matrix.topRightCorner<3, 1>();
      }
    }
    // So that what is left out of a sum with shares of 1 is the move.
    const Eigen::VectorXd target = places_ * shares_;
    places_.colwise() -= target;
  }

  double largest(const Eigen::VectorXd& shares) const {
    const Eigen::VectorXd off = places_ * shares;
    return off.reshaped(3, matrices_.frames).colwise().squaredNorm().maxCoeff();
  }

  Eigen::VectorXd normalized(const std::vector<int>& kept) const {
    Eigen::VectorXd own = Eigen::VectorXd::Zero(shares_.size());
    for (const int i : kept) own[i] = shares_[i];
    return own / own.sum();
  }

  /// The largest squared move with a sum of places and shares, or any number above `most` if it is above that.
  double largest_within(const Eigen::VectorXd& sum, double share, double most) {
    const double limit = most * share * share;
    const auto squared = [&](Eigen::Index f) { return sum.segment<3>(3 * f).squaredNorm(); };
    worst_ = std::min<Eigen::Index>(worst_, matrices_.frames - 1);
    double longest = squared(worst_);  // the pose that was worst before is likely to be so again
    for (Eigen::Index f = 0; f < matrices_.frames && longest <= limit; ++f) {
      if (const double own = squared(f); own > longest) longest = own, worst_ = f;
    }
    return longest / (share * share);
  }

  /// The kept weights for which the largest move is smallest; among equals, those that keep more weight.
  std::vector<int> choose(int most) {
    const int n = static_cast<int>(bones_.size());
    std::pair<double, double> best(std::numeric_limits<double>::infinity(), 0);
    std::vector<int> kept(n), tried(most);
    std::iota(kept.begin(), kept.end(), 0);
    if (!std::isfinite(places_.squaredNorm())) {  // too far to be compared: the largest weights stay
      std::ranges::stable_sort(kept, [&](int a, int b) { return shares_[a] > shares_[b]; });
      kept.resize(most);
      return kept;
    }
    if (combinations(n, most) * static_cast<double>(matrices_.frames) <= kTries) {
      std::iota(tried.begin(), tried.end(), 0);
      do {
        double share = 0;
        sum_of_places_.setZero(places_.rows());
        for (const int i : tried) {
          share += shares_[i];
          sum_of_places_ += shares_[i] * places_.col(i);
        }
        const std::pair cost(largest_within(sum_of_places_, share, best.first), -share);
        if (cost < best) best = cost, kept = tried;
      } while (next_combination(tried, n));
      return kept;
    }
    if (const std::size_t many = std::max<std::size_t>(kMany, 2 * most); kept.size() > many) {
      std::vector<double> reach(n);  // how far each can move the vertex
      for (int i = 0; i < n; ++i) {
        reach[i] =
            shares_[i] * std::sqrt(places_.col(i).reshaped(3, matrices_.frames).colwise().squaredNorm().maxCoeff());
      }
      std::ranges::stable_sort(
          kept, [&](int a, int b) { return reach[a] != reach[b] ? reach[a] > reach[b] : shares_[a] > shares_[b]; });
      kept.resize(many);
      std::ranges::sort(kept);
    }
    sum_of_places_.setZero(places_.rows());
    double all = 0;
    for (const int i : kept) {
      sum_of_places_ += shares_[i] * places_.col(i);
      all += shares_[i];
    }
    while (std::ssize(kept) > most) {
      best = {std::numeric_limits<double>::infinity(), 0};
      std::size_t gone = 0;
      for (std::size_t out = 0; out < kept.size(); ++out) {
        const double share = all - shares_[kept[out]];
        if (!(share > 0)) continue;
        without_ = sum_of_places_ - shares_[kept[out]] * places_.col(kept[out]);
        const std::pair cost(largest_within(without_, share, best.first), -share);
        if (cost < best) best = cost, gone = out;
      }
      sum_of_places_ -= shares_[kept[gone]] * places_.col(kept[gone]);
      all -= shares_[kept[gone]];
      kept.erase(kept.begin() + static_cast<std::ptrdiff_t>(gone));
    }
    return kept;
  }

  Eigen::VectorXd fit(const std::vector<int>& kept, const Eigen::VectorXd& near) {
    // Eigen 3.4 and 5 have no common name for all rows.
    const Eigen::MatrixXd places = places_(Eigen::seqN(0, places_.rows()), kept);
    Eigen::MatrixXd g = places.transpose() * places;
    const double pull = kPull * g.diagonal().maxCoeff() + std::numeric_limits<double>::min();
    const Eigen::VectorXd b = pull * near(kept);
    g.diagonal().array() += pull;
    Eigen::VectorXd own = Eigen::VectorXd::Constant(b.size(), 1.0 / static_cast<double>(b.size()));
    solver_.solve(g, b, own);
    Eigen::VectorXd all = Eigen::VectorXd::Zero(shares_.size());
    all(kept) = own;
    return all;
  }

  std::span<const float> positions_;
  MatrixStack<const double> matrices_;
  std::span<const std::uint8_t> is_locked_;
  std::ptrdiff_t most_;
  std::vector<std::int32_t> bones_;  // of the vertex that are not locked
  Eigen::VectorXd shares_;           // of these bones
  Eigen::MatrixXd places_;           // where each bone takes it, less where all do
  double sum_ = 0, free_share_ = 1;  // of their weights; that in all weights
  Eigen::Index worst_ = 0;
  Eigen::VectorXd sum_of_places_, without_;
  std::vector<BoneWeight> row_;
  SimplexLeastSquares solver_;
};

/// Returns the weights in which each bone fades towards the vertices that have lost it.
WeightTable fade(const WeightTable& before, const WeightTable& reduced, const Faces& faces, int rings,
                 std::span<const std::uint8_t> is_locked, Progress* progress) {
  const auto vertices = static_cast<std::size_t>(before.vertices()), bones = static_cast<std::size_t>(before.bones());
  std::vector<std::uint32_t> each(vertices);
  std::iota(each.begin(), each.end(), 0u);
  const Lists<std::uint32_t> around = neighbours_by_sides(faces, each, vertices);
  const auto entry_of = [&](std::uint32_t v, std::int32_t bone) {
    const auto row = reduced.row(v);
    const auto found = std::ranges::lower_bound(row, bone, {}, &BoneWeight::bone);
    return found != row.end() && found->bone == bone ? reduced.offsets()[v] + (found - row.begin()) : std::int64_t{-1};
  };
  const Lists<std::uint32_t> lost(bones, [&](const auto& add) {
    for (std::uint32_t v = 0; v < vertices; ++v) {
      for (const BoneWeight& own : before.row(v)) {
        if (entry_of(v, own.bone) < 0) add(own.bone, v);
      }
    }
  });
  std::vector<float> factors(reduced.entries().size(), 1);
  parallel_for(bones, 1, [&](std::size_t begin, std::size_t end) {
    std::vector<int> ring(vertices, -1);
    std::vector<std::uint32_t> reached;
    for (std::size_t bone = begin; bone < end; ++bone) {
      stop_if_cancelled(progress);
      reached.assign(lost[bone].begin(), lost[bone].end());
      for (const std::uint32_t v : reached) ring[v] = 0;
      for (std::size_t next = 0; next < reached.size(); ++next) {
        const int step = ring[reached[next]] + 1;
        if (step > rings) break;
        for (const std::uint32_t other : around[reached[next]]) {
          if (ring[other] >= 0) continue;
          ring[other] = step;
          reached.push_back(other);
          const std::int64_t entry = entry_of(other, static_cast<std::int32_t>(bone));
          if (entry >= 0) factors[entry] = static_cast<float>(step) / static_cast<float>(rings + 1);
        }
      }
      for (const std::uint32_t v : reached) ring[v] = -1;
    }
  });
  return table_of_rows(vertices, before.bones(), 4096, progress, kFadeSteps, [&](auto begin, auto end, auto& rows) {
    RowSum sum(bones);
    for (std::size_t v = begin; v < end; ++v) {
      const auto row = reduced.row(v);
      const std::span<const float> own = std::span(factors).subspan(reduced.offsets()[v], row.size());
      if (std::ranges::all_of(own, [](float factor) { return factor == 1; }) ||
          std::ranges::any_of(row, [&](const BoneWeight& one) { return is_locked[one.bone] != 0; })) {
        rows.add_row(row);
        continue;
      }
      for (std::size_t i = 0; i < row.size(); ++i) sum.add(row[i].bone, static_cast<double>(own[i]) * row[i].weight);
      rows.add_row(sum.take(sum_of(row) / sum.total()));
    }
  });
}

}  // namespace

std::optional<ReducedWeights> reduce_weights(const WeightTable& weights, std::span<const float> positions,
                                             MatrixStack<const double> matrices, const Faces& faces,
                                             const ReduceSettings& settings, Progress* progress) {
  check_positions("positions", positions, weights.vertices());
  check_faces(faces, weights.vertices());
  check_range("max_influences", settings.most, 1, 64);
  check_range("rings", settings.rings, 0, 64);
  const std::vector<std::uint8_t> is_locked = checked_locked(settings.locked, weights.bones());
  if (settings.rings > 0 && faces.offsets.empty())
    fail("rings is ", settings.rings, ", and there are no faces; expected both");
  if (matrices.joints != weights.bones()) {
    fail("matrices has ", plural(matrices.joints, "joint"), ", weights ", plural(weights.bones(), "column"));
  }
  if (matrices.frames < 1) fail("matrices has no poses; expected one at least");
  for (std::ptrdiff_t f = 0; f < matrices.frames; ++f) {
    for (std::ptrdiff_t j = 0; j < matrices.joints; ++j) {
      if (!matrices.at(f, j).allFinite()) fail("matrices is not finite in pose ", f, " at joint ", j);
    }
  }
  const auto vertices = static_cast<std::size_t>(weights.vertices());
  try {
    if (progress) progress->start(kReduceSteps + (settings.rings > 0 ? 2 * kFadeSteps : 0));
    ReducedWeights result{WeightTable(), std::vector<float>(vertices), std::vector<float>(vertices)};
    const auto keep = [&](std::size_t v, const Move& move) {
      result.largest[v] = move.largest;
      result.mean[v] = move.mean;
    };
    result.weights = table_of_rows(vertices, weights.bones(), kVertices, progress, kReduceSteps,
                                   [&](auto begin, auto end, auto& rows) {
                                     VertexReduction reduction(positions, matrices, is_locked, settings.most);
                                     for (std::size_t v = begin; v < end; ++v)
                                       keep(v, reduction.run(v, weights.row(v), rows));
                                   });
    if (settings.rings == 0) return result;
    WeightTable faded = fade(weights, result.weights, faces, settings.rings, is_locked, progress);
    parallel_for((vertices + kVertices - 1) / kVertices, 1, [&](std::size_t first, std::size_t last) {
      VertexReduction reduction(positions, matrices, is_locked, settings.most);
      for (std::size_t v = first * kVertices; v < std::min(vertices, last * kVertices); ++v) {
        if (v % kVertices == 0) stop_if_cancelled(progress);
        if (std::ranges::equal(faded.row(v), result.weights.row(v))) continue;
        keep(v, reduction.measure(v, weights.row(v), faded.row(v)));
      }
    });
    result.weights = std::move(faded);
    if (progress) progress->advance(kFadeSteps);
    return result;
  } catch (const Cancelled&) {
    return std::nullopt;
  }
}

}  // namespace sinew
