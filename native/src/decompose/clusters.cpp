#include "decompose/clusters.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <queue>
#include <tuple>

#include "base/cancelled.h"
#include "base/parallel.h"

namespace sinew {
namespace {

/// So many frames tell the clusters apart.
constexpr std::ptrdiff_t kFrames = 40;
constexpr std::size_t kStepsBetweenLooks = 1024;  // at whether the work is cancelled
constexpr int kRounds = 3, kLastRounds = 4;

/// Mean squared distances, in units of the size, below which points move exactly.
constexpr double kExact = 1e-12;

class Clusters {
 public:
  Clusters(const Clip& clip, const Neighbours& neighbours, Progress* progress)
      : clip_(clip), neighbours_(neighbours), progress_(progress), label_of_(neighbours.size(), 0) {}

  void split_until(std::int32_t most) {
    fit();
    for (std::int32_t before = 0; count_ < most && count_ > before;) {  // splits that leave too few points do not last
      before = count_;
      if (!split(most)) break;
      for (int round = 0; round < kRounds; ++round) grow(), fit();
      advance(kClusterSteps * count_ / most);
    }
    for (int round = 0; round < kLastRounds; ++round) grow(), fit();
  }

  void begin_at(std::span<const Eigen::Vector3d> heads) {
    count_ = static_cast<std::int32_t>(heads.size());
    for (std::size_t p = 0; p < label_of_.size(); ++p) {
      if (p % kStepsBetweenLooks == 0) stop_if_cancelled(progress_);
      double least = std::numeric_limits<double>::infinity();
      for (std::int32_t j = 0; j < count_; ++j) {
        const double distance = (clip_.rest[p].head<3>() - heads[j]).squaredNorm();
        if (distance < least) least = distance, label_of_[p] = j;
      }
    }
  }

  std::pair<std::vector<std::int32_t>, std::int32_t> result() && {
    advance(kClusterSteps);
    return {std::move(label_of_), count_};
  }

 private:
  /// The squared distance of a point to where a cluster's motion takes it, summed over frames.
  double distance(std::size_t point, std::int32_t label) {
    Known& known = known_[point];
    if (known.label != label) known = {label, compute_distance(point, label)};
    return known.distance;
  }

  double compute_distance(std::size_t point, std::int32_t label) const {
    const auto rows = motions_.rows().middleRows<4>(4 * label);
    const auto moves = Eigen::RowVectorXf::Map(clip_.row(point), rows.cols());
    return (clip_.rest[point].transpose() * rows - moves.cast<double>()).squaredNorm();
  }

  void advance(int steps) {
    if (progress_) progress_->advance(steps - steps_);
    steps_ = steps;
  }

  /// Fits a rigid motion to each cluster, and computes how well each moves each point.
  void fit() {
    stop_if_cancelled(progress_);
    motions_ = Motions(clip_.frames, count_);
    MotionFit(clip_, {1, label_of_, std::vector<double>(label_of_.size(), 1)}, count_, progress_)
        .fit_alone(motions_, progress_);
    known_.assign(label_of_.size(), {});
    parallel_for(label_of_.size(), 512, [&](std::size_t begin, std::size_t end) {
      stop_if_cancelled(progress_);
      for (std::size_t p = begin; p < end; ++p) distance(p, label_of_[p]);
    });
    centres_.assign(count_, Eigen::Vector3d::Zero());
    sizes_.assign(count_, 0);
    errors_.assign(count_, 0);
    spreads_.assign(count_, 0);
    for (std::size_t p = 0; p < label_of_.size(); ++p) {
      const std::int32_t label = label_of_[p];
      centres_[label] += clip_.rest[p].head<3>();
      sizes_[label] += 1;
      errors_[label] += distance(p, label);
    }
    for (std::int32_t j = 0; j < count_; ++j) centres_[j] /= std::max(1.0, sizes_[j]);
    for (std::size_t p = 0; p < label_of_.size(); ++p) spreads_[label_of_[p]] += from_centre(p);
  }

  double from_centre(std::size_t p) const { return (clip_.rest[p].head<3>() - centres_[label_of_[p]]).squaredNorm(); }

  /// Grows each cluster anew from a point in its middle that it moves well. Those left with fewer than three points are
  /// given to their neighbours, if any.
  void grow() {
    std::vector<std::uint32_t> seeds(count_, 0);
    std::vector<double> best(count_, std::numeric_limits<double>::infinity());
    for (std::uint32_t p = 0; p < label_of_.size(); ++p) {
      const std::int32_t label = label_of_[p];
      const double per_point = 1e-30 + errors_[label] / sizes_[label];
      const double cost = distance(p, label) / per_point + from_centre(p) * sizes_[label] / (1e-30 + spreads_[label]);
      if (cost < best[label]) best[label] = cost, seeds[label] = p;
    }
    using Step = std::tuple<double, std::uint32_t, std::int32_t>;
    std::priority_queue<Step, std::vector<Step>, std::greater<>> ahead;
    std::fill(label_of_.begin(), label_of_.end(), -1);
    const auto visit = [&](std::uint32_t p, std::int32_t label) {
      label_of_[p] = label;
      for (const auto& [other, share] : neighbours_[p]) {
        if (label_of_[other] < 0) ahead.emplace(distance(other, label), other, label);
      }
    };
    for (std::int32_t j = 0; j < count_; ++j) {
      if (sizes_[j] > 0) label_of_[seeds[j]] = j;
    }
    for (std::int32_t j = 0; j < count_; ++j) {
      if (sizes_[j] > 0) visit(seeds[j], j);
    }
    for (std::size_t step = 0; !ahead.empty(); ++step) {
      if (step % kStepsBetweenLooks == 0) stop_if_cancelled(progress_);
      const auto [cost, p, label] = ahead.top();
      ahead.pop();
      if (label_of_[p] < 0) visit(p, label);
    }
    number_anew();
  }

  void number_anew() {
    std::vector<std::size_t> sizes(count_, 0);
    for (const std::int32_t label : label_of_) ++sizes[label];
    if (label_of_.size() > 3 * sizes.size()) {
      for (std::uint32_t p = 0; p < label_of_.size(); ++p) {
        if (sizes[label_of_[p]] >= 3) continue;
        for (const Neighbour& neighbour : neighbours_[p]) {
          const std::int32_t other = label_of_[neighbour.point];
          if (sizes[other] < 3) continue;
          --sizes[label_of_[p]];
          label_of_[p] = other;
          ++sizes[other];
          break;
        }
      }
    }
    std::vector<std::int32_t> number(count_, -1);
    std::int32_t next = 0;
    for (std::int32_t j = 0; j < count_; ++j) {
      if (sizes[j] > 0) number[j] = next++;
    }
    for (std::int32_t& label : label_of_) label = number[label];
    count_ = next;
  }

  /// Splits the clusters with the largest errors, each once. Returns whether there are more of them now.
  bool split(std::int32_t most) {
    std::vector<std::int32_t> order(count_);
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return errors_[a] > errors_[b]; });
    const std::int32_t before = count_;
    std::vector<std::uint32_t> seeds(before, 0);
    std::vector<double> best(before, 0);
    for (std::uint32_t p = 0; p < label_of_.size(); ++p) {
      const double cost = distance(p, label_of_[p]) * from_centre(p);
      if (cost > best[label_of_[p]]) best[label_of_[p]] = cost, seeds[label_of_[p]] = p;
    }
    const double exact = kExact * static_cast<double>(clip_.frames);
    std::vector<std::int32_t> second(before, -1);
    std::int32_t next = before;
    for (const std::int32_t label : order) {
      if (next == most) break;
      const bool is_exact = errors_[label] <= exact * sizes_[label];
      if (sizes_[label] < 2 || is_exact || best[label] == 0) continue;
      second[label] = next++;
    }
    for (std::uint32_t p = 0; p < label_of_.size(); ++p) {
      const std::int32_t label = label_of_[p];
      if (second[label] < 0) continue;
      const double to_seed = (clip_.rest[p] - clip_.rest[seeds[label]]).squaredNorm();
      if (p == seeds[label] || to_seed < from_centre(p)) label_of_[p] = second[label];
    }
    count_ = next;
    if (next > before) fit();
    return next > before;
  }

  const Clip& clip_;
  const Neighbours& neighbours_;
  Progress* progress_;
  std::vector<std::int32_t> label_of_;
  std::int32_t count_ = 1;
  int steps_ = 0;  // of the progress
  Motions motions_;
  struct Known {
    std::int32_t label = -1;
    double distance = 0;
  };
  std::vector<Known> known_;  // P: the last distances that were asked for
  std::vector<Eigen::Vector3d> centres_;
  std::vector<double> sizes_, errors_, spreads_;  // of each cluster: points, squared distances, squares from the centre
};

}  // namespace

std::pair<std::vector<std::int32_t>, std::int32_t> find_clusters(const Clip& clip, const Neighbours& neighbours,
                                                                 std::int32_t most,
                                                                 std::span<const Eigen::Vector3d> heads,
                                                                 Progress* progress) {
  const Clip few = clip.with_frames(kFrames);
  Clusters clusters(few, neighbours, progress);
  if (heads.empty()) {
    clusters.split_until(std::min<std::int64_t>(most, clip.point_count()));
  } else {
    clusters.begin_at(heads);
  }
  return std::move(clusters).result();
}

}  // namespace sinew
