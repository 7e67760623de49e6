#include "weight_tools/vertex_reduction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "weights/weight_rows.h"

namespace sinew {
namespace {

/// So many sets are tried at a vertex, times poses.
constexpr double kTries = 100000;

/// If a vertex has more weights, and more than twice as many as may stay, the others leave first.
constexpr std::size_t kMany = 24;

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

}  // namespace

Move VertexReduction::run(std::size_t v, std::span<const BoneWeight> row, WeightTable& rows) {
  const auto held = std::ranges::count_if(row, [&](const BoneWeight& own) { return is_locked_[own.bone] != 0; });
  const auto most = std::max<std::ptrdiff_t>(1, most_ - held);
  if (std::ssize(row) - held <= most) {
    rows.add_row(row);
    return {0, 0};
  }
  read(v, row);
  const std::vector<int> kept = choose(static_cast<int>(most));
  Eigen::VectorXd own = normalized(kept), fitted = fit(kept, own);
  // Not if it is not a number, or too large to be compared.
  if (const double move = largest(fitted); std::isfinite(move) && move <= largest(own)) own = fitted;
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

Move VertexReduction::measure(std::size_t v, std::span<const BoneWeight> before, std::span<const BoneWeight> after) {
  read(v, before);
  Eigen::VectorXd own = Eigen::VectorXd::Zero(shares_.size());
  for (const BoneWeight& one : after) {
    const auto found = std::ranges::lower_bound(bones_, one.bone);
    if (found != bones_.end() && *found == one.bone) own[found - bones_.begin()] = one.weight / sum_;
  }
  return moved(own);
}

Move VertexReduction::moved(const Eigen::VectorXd& own) const {
  const Eigen::VectorXd off = places_ * own;
  double sum = 0, longest = 0;
  for (Eigen::Index f = 0; f < matrices_.frames; ++f) {
    const double move = free_share_ * off.segment<3>(3 * f).norm();
    sum += move;
    longest = std::max(longest, move);
  }
  return {static_cast<float>(longest), static_cast<float>(sum / static_cast<double>(matrices_.frames))};
}

void VertexReduction::read(std::size_t v, std::span<const BoneWeight> row) {
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

double VertexReduction::largest(const Eigen::VectorXd& shares) const {
  const Eigen::VectorXd off = places_ * shares;
  return off.reshaped(3, matrices_.frames).colwise().squaredNorm().maxCoeff();
}

Eigen::VectorXd VertexReduction::normalized(const std::vector<int>& kept) const {
  Eigen::VectorXd own = Eigen::VectorXd::Zero(shares_.size());
  for (const int i : kept) own[i] = shares_[i];
  return own / own.sum();
}

double VertexReduction::largest_within(const Eigen::VectorXd& sum, double share, double most) {
  const double limit = most * share * share;
  const auto squared = [&](Eigen::Index f) { return sum.segment<3>(3 * f).squaredNorm(); };
  worst_ = std::min<Eigen::Index>(worst_, matrices_.frames - 1);
  double longest = squared(worst_);  // the pose that was worst before is likely to be so again
  for (Eigen::Index f = 0; f < matrices_.frames && longest <= limit; ++f) {
    if (const double own = squared(f); own > longest) longest = own, worst_ = f;
  }
  return longest / (share * share);
}

std::vector<int> VertexReduction::choose(int most) {
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

Eigen::VectorXd VertexReduction::fit(const std::vector<int>& kept, const Eigen::VectorXd& near) {
  // Eigen 3.4 and 5 have no common name for all rows.
  const Eigen::MatrixXd places = places_(Eigen::seqN(0, places_.rows()), kept);
  Eigen::MatrixXd g = places.transpose() * places;
  const double pull = kPull * g.diagonal().maxCoeff() + std::numeric_limits<double>::min();
  const Eigen::VectorXd b = pull * near(kept);
  g.diagonal().array() += pull;
  Eigen::VectorXd own = Eigen::VectorXd::Constant(b.size(), 1.0 / static_cast<double>(b.size()));
  WholeGram whole(g);
  solver_.solve(whole, b, own);
  Eigen::VectorXd all = Eigen::VectorXd::Zero(shares_.size());
  all(kept) = own;
  return all;
}

}  // namespace sinew
