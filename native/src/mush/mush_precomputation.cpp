#include "mush/mush_precomputation.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/parallel.h"
#include "mush/mush_neighbourhoods.h"

namespace sinew {
namespace {

// If a vertex gets less than this of all weights, its motion is undetermined.
constexpr double kReached = 1e-6;
// A neighbourhood is a line if the two shorter of its three extents are less than this fraction of the whole.
constexpr double kLine = 1e-4;
// The share of a ball that is added to a line, or to a point, which has no extent; and to any that must be inverted.
constexpr double kBall = 1e-3;
// A neighbourhood no larger than this is a point: the first moment over the second would be too large for a float.
constexpr double kSmallest = std::numeric_limits<float>::min();
// Fraction of MushSettings::prune below which an entry is dropped at once.
constexpr double kNothing = 1e-3;

/// A vertex's neighbourhood with all joints taken together.
struct Whole {
  bool is_reached = false;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< p
  double weight = 0;                                 ///< of the moments
  double share = 0;                                  ///< the last entry of the sum of Omega
  double extent = 0;                                 ///< trace of the second moment about p, divided by weight
  bool is_point = false, is_line = false;
  double leverage = 0;  ///< how far a turn of the neighbourhood by its own extent moves the vertex
};

/// One joint's share in one vertex's neighbourhood, in the units of its Whole.
struct Entry {
  std::uint32_t vertex;
  std::int32_t joint;
  float second[6];
  float first[3];
  float weight, share;
};

class Precomputation {
 public:
  Precomputation(const Skin& skin, const Laplacian& laplacian, const MushSettings& settings, Progress* progress)
      : skin_(skin),
        settings_(settings),
        progress_(progress),
        neighbourhoods_(skin, laplacian, settings),
        wholes_(static_cast<std::size_t>(skin.vertex_count())),
        dropped_(wholes_.size()) {
    using Positions = Eigen::Map<const Eigen::Matrix3Xf>;
    const Positions positions(skin.rest_positions().data(), 3, skin.vertex_count());
    if (!wholes_.empty()) {
      diagonal_ = (positions.rowwise().maxCoeff() - positions.rowwise().minCoeff()).cast<double>().norm();
    }
  }

  MushArrays run() {
    const std::vector<WeightField> fields = fields_of_joints();
    std::size_t work = wholes_.size();
    for (const WeightField& field : fields) work += field.vertices.size();
    if (progress_) progress_->start(static_cast<std::int64_t>(work));
    measure_wholes();
    // The largest first, so that no thread still has a large one to do at the end.
    std::vector<std::size_t> order(fields.size());
    std::iota(order.begin(), order.end(), 0);
    std::ranges::stable_sort(order, std::greater(), [&](std::size_t j) { return fields[j].vertices.size(); });
    std::vector<std::vector<Entry>> of_joints(fields.size());
    parallel_for(order.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const std::size_t joint = order[i];
        stop_if_cancelled(progress_);
        if (!fields[joint].vertices.empty()) of_joints[joint] = entries_of(joint, fields[joint]);
      }
    });
    return gathered(of_joints);
  }

 private:
  std::vector<WeightField> fields_of_joints() const {
    std::vector<WeightField> fields(static_cast<std::size_t>(skin_.joint_count()));
    for (std::size_t v = 0; v < wholes_.size(); ++v) {
      for (auto i = skin_.offsets()[v]; i < skin_.offsets()[v + 1]; ++i) {
        WeightField& field = fields[skin_.joints()[i]];
        if (field.vertices.empty() || field.vertices.back() != v) {
          field.vertices.push_back(static_cast<std::uint32_t>(v));
          field.weights.push_back(0);
        }
        field.weights.back() += skin_.weights()[i];
      }
    }
    return fields;
  }

  void measure_wholes() {
    WeightField all;
    all.vertices.resize(wholes_.size());
    std::iota(all.vertices.begin(), all.vertices.end(), 0);
    for (std::size_t v = 0; v < wholes_.size(); ++v) {
      const auto own = skin_.weights().subspan(skin_.offsets()[v], skin_.offsets()[v + 1] - skin_.offsets()[v]);
      all.weights.push_back(std::accumulate(own.begin(), own.end(), 0.0));
    }
    neighbourhoods_.smooth(all, progress_, [&](const MushNeighbourhoods::Smoothed& smoothed) {
      for (std::size_t v = 0; v < wholes_.size(); ++v) wholes_[v] = whole_of(v, smoothed.at(v), smoothed.origin);
    });
  }

  Whole whole_of(std::size_t v, const Moments& moments, const Eigen::Vector3d& origin) const {
    const Eigen::Vector3d rest = Eigen::Map<const Eigen::Vector3f>(&skin_.rest_positions()[3 * v]).cast<double>();
    Whole whole;
    whole.center = rest;
    whole.weight = moments.weight;
    whole.share = (1 - settings_.blend) * moments.weight + settings_.blend * moments.smoothed_weight;
    whole.is_reached = moments.weight > kReached && whole.share > kReached;
    if (!whole.is_reached) return whole;
    const Eigen::Vector3d center = moments.first / moments.weight;
    whole.center = origin + center;
    const Eigen::Matrix3d second = moments.moved_to(center).second / moments.weight;
    whole.extent = second.trace();
    whole.is_point = !(whole.extent > std::max(1e-14 * diagonal_ * diagonal_, kSmallest * kSmallest));
    if (whole.is_point) whole.extent = 1;
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(second / whole.extent, Eigen::EigenvaluesOnly);
    const double width = solver.eigenvalues()[0] + solver.eigenvalues()[1];
    whole.is_line = !whole.is_point && width < kLine;
    whole.leverage = (rest - whole.center).norm() / std::max(width, kBall);
    return whole;
  }

  std::vector<Entry> entries_of(std::size_t joint, const WeightField& field) {
    std::vector<Entry> entries;
    neighbourhoods_.smooth(field, progress_, [&](const MushNeighbourhoods::Smoothed& smoothed) {
      for (std::size_t i = 0; i < smoothed.vertices.size(); ++i) {
        const std::uint32_t v = smoothed.vertices[i];
        if (!wholes_[v].is_reached) continue;
        const Entry entry = entry_of(v, joint, smoothed.at(i).moved_to(wholes_[v].center - smoothed.origin));
        const double importance = importance_of(entry);
        if (importance > kNothing * settings_.prune) {
          entries.push_back(entry);
        } else {
          // Integers, whose sum does not depend on the order in which threads add them.
          dropped_[v].fetch_add(static_cast<std::uint64_t>(importance * kDroppedUnit), std::memory_order_relaxed);
        }
      }
    });
    return entries;
  }

  Entry entry_of(std::uint32_t v, std::size_t joint, const Moments& moments) const {
    const Whole& whole = wholes_[v];
    const double weight = moments.weight / whole.weight, scale = 1 / (whole.weight * whole.extent);
    Eigen::Matrix3d second = scale * moments.second;
    Eigen::Vector3d first = scale * moments.first;
    if (whole.is_point) {
      second.setZero();
      first.setZero();
    }
    if (whole.is_point || whole.is_line || settings_.variant == 1)
      second += kBall * weight * Eigen::Matrix3d::Identity();
    const double share =
        ((1 - settings_.blend) * moments.weight + settings_.blend * moments.smoothed_weight) / whole.share;
    Entry entry{v, static_cast<std::int32_t>(joint), {}, {}, static_cast<float>(weight), static_cast<float>(share)};
    set_second(second, entry);
    Eigen::Map<Eigen::Vector3f>(entry.first) = first.cast<float>();
    return entry;
  }

  static void set_second(const Eigen::Matrix3d& second, Entry& entry) {
    const double numbers[] = {second(0, 0), second(0, 1), second(0, 2), second(1, 1), second(1, 2), second(2, 2)};
    std::copy_n(numbers, 6, entry.second);
  }

  static Eigen::Matrix3d second_of(const Entry& entry) {
    const float* s = entry.second;
    Eigen::Matrix3d second;
    second << s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5];
    return second;
  }

  /// Returns the largest error of the vertex without this entry, as a fraction of the spread of its joints' motions.
  double importance_of(const Entry& entry) const {
    const double leverage = wholes_[entry.vertex].leverage;
    const double first = Eigen::Map<const Eigen::Vector3f>(entry.first).cast<double>().norm();
    const double second = diagonal_ > 0 ? second_of(entry).norm() / diagonal_ : 0;
    return std::abs(entry.share) + leverage * (first + second);
  }

  MushArrays gathered(const std::vector<std::vector<Entry>>& of_joints) const {
    std::vector<std::size_t> at(wholes_.size() + 1);
    for (const auto& entries : of_joints) {
      for (const Entry& entry : entries) ++at[entry.vertex + 1];
    }
    std::partial_sum(at.begin(), at.end(), at.begin());
    std::vector<const Entry*> by_vertex(at.back());
    std::vector<std::size_t> next(at.begin(), at.end() - 1);
    for (const auto& entries : of_joints) {
      for (const Entry& entry : entries) by_vertex[next[entry.vertex]++] = &entry;
    }
    MushArrays arrays;
    arrays.variant = settings_.variant;
    arrays.offsets.push_back(0);
    for (std::size_t v = 0; v < wholes_.size(); ++v) {
      if (v % 1024 == 0) stop_if_cancelled(progress_);
      pack_vertex(v, std::span(by_vertex).subspan(at[v], next[v] - at[v]), arrays);
      arrays.offsets.push_back(std::ssize(arrays.joints));
    }
    return arrays;
  }

  /// entries  in ascending order of joints.
  void pack_vertex(std::size_t v, std::span<const Entry*> entries, MushArrays& arrays) const;
  void add_entry(const Entry& entry, const Eigen::Vector3d& moved, double share, double scale,
                 MushArrays& arrays) const;

  static constexpr double kDroppedUnit = 1e15;

  const Skin& skin_;
  const MushSettings& settings_;
  Progress* progress_;
  MushNeighbourhoods neighbourhoods_;
  std::vector<Whole> wholes_;
  std::vector<std::atomic<std::uint64_t>> dropped_;  // per vertex: the importance of what was dropped so far
  double diagonal_ = 0;
};

void Precomputation::pack_vertex(std::size_t v, std::span<const Entry*> entries, MushArrays& arrays) const {
  const Whole& whole = wholes_[v];
  std::ranges::sort(entries, {}, [&](const Entry* entry) { return std::pair(importance_of(*entry), entry->joint); });
  double dropped = static_cast<double>(dropped_[v].load()) / kDroppedUnit;
  std::size_t first = 0;
  for (; first + 1 < entries.size(); ++first) {
    const double after = dropped + importance_of(*entries[first]);
    if (after > settings_.prune) break;
    dropped = after;
  }
  const auto kept = entries.subspan(first);
  std::ranges::sort(kept, {}, &Entry::joint);
  arrays.pruned = std::max(arrays.pruned, dropped);

  // The remaining entries have a center and a sum of their own.
  double weight = 0, share = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Entry* entry : kept) {
    weight += entry->weight;
    share += entry->share;
    sum += Eigen::Map<const Eigen::Vector3f>(entry->first).cast<double>();
  }
  const Eigen::Vector3d moved = kept.empty() ? sum : Eigen::Vector3d(whole.extent / weight * sum);
  const double scale = kept.empty() ? 0 : (1 - settings_.blend) * whole.weight * whole.extent / (whole.share * share);
  for (const Entry* entry : kept) add_entry(*entry, moved, share, scale, arrays);
  for (const double x : Eigen::Vector3d(whole.center + moved)) arrays.centers.push_back(static_cast<float>(x));
  arrays.scales.push_back(static_cast<float>(scale));
}

void Precomputation::add_entry(const Entry& entry, const Eigen::Vector3d& moved, double share, double scale,
                               MushArrays& arrays) const {
  const Eigen::Vector3d given = Eigen::Map<const Eigen::Vector3f>(entry.first).cast<double>();
  const double weight = entry.weight / wholes_[entry.vertex].extent;
  const Eigen::Vector3d first = given - weight * moved;
  const Eigen::Matrix3d mixed = given * moved.transpose();
  Entry own = entry;
  set_second(second_of(entry) - mixed - mixed.transpose() + weight * moved * moved.transpose(), own);
  const auto add = [&](double number) { arrays.omega.push_back(static_cast<float>(number)); };
  const int width = MushArrays::width_of(settings_.variant);
  if (width == 10) std::ranges::for_each(own.second, add);
  if (width >= 4) std::ranges::for_each(Eigen::Vector3d(width == 4 ? scale * first : first), add);
  add(entry.share / share);
  arrays.joints.push_back(entry.joint);
}

}  // namespace

MushArrays precompute_mush(const Skin& skin, const Laplacian& laplacian, const MushSettings& settings,
                           Progress* progress) {
  return Precomputation(skin, laplacian, settings, progress).run();
}

}  // namespace sinew
