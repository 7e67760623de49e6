/// Makes tables of weights.
#pragma once

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

#include "base/cancelled.h"
#include "base/parallel.h"
#include "sinew/weight_table.h"

namespace sinew {

/// A weight that float32 can hold.
inline float as_weight(double weight) {
  return static_cast<float>(std::min<double>(weight, std::numeric_limits<float>::max()));
}

inline double sum_of(std::span<const BoneWeight> row) {
  double sum = 0;
  for (const BoneWeight& own : row) sum += own.weight;
  return sum;
}

/// Adds up weighted rows. One object for each thread.
class RowSum {
 public:
  explicit RowSum(std::size_t bones) : sums_(bones), is_used_(bones) {}

  void add(std::int32_t bone, double weight) {
    if (!is_used_[bone]) is_used_[bone] = 1, used_.push_back(bone);
    sums_[bone] += weight;
  }
  void add(std::span<const BoneWeight> row, double factor) {
    for (const BoneWeight& own : row) add(own.bone, factor * own.weight);
  }

  double total() const {
    double sum = 0;
    for (const std::int32_t bone : used_) sum += sums_[bone];
    return sum;
  }

  /// Returns what is above 0, times a factor, and begins anew. Valid until the next call.
  std::span<const BoneWeight> take(double factor = 1) {
    std::ranges::sort(used_);
    row_.clear();
    for (const std::int32_t bone : used_) {
      if (const float weight = as_weight(factor * sums_[bone]); weight > 0) row_.push_back({bone, weight});
      sums_[bone] = 0;
      is_used_[bone] = 0;
    }
    used_.clear();
    return row_;
  }

 private:
  std::vector<double> sums_;
  std::vector<std::uint8_t> is_used_;
  std::vector<std::int32_t> used_;
  std::vector<BoneWeight> row_;
};

/// Calls body(begin, end, part) for `count` items in parts of `grain`, in parallel. Stops if it is cancelled. The progress
/// is advanced by `steps`.
template <class Body>
void for_parts(std::size_t count, std::size_t grain, Progress* progress, std::int64_t steps, const Body& body) {
  const std::size_t parts = (count + grain - 1) / grain;
  parallel_for(parts, 1, [&](std::size_t first, std::size_t last) {
    for (std::size_t part = first; part < last; ++part) {
      stop_if_cancelled(progress);
      body(part * grain, std::min(count, (part + 1) * grain), part);
      advance_share(progress, steps, part, parts);
    }
  });
}

/// Makes a table in parallel: make(begin, end, rows) adds those vertices' rows. The progress is advanced by `steps`.
template <class Make>
WeightTable table_of_rows(std::size_t vertices, std::ptrdiff_t bones, std::size_t grain, Progress* progress,
                          std::int64_t steps, const Make& make) {
  std::vector<WeightTable> parts((vertices + grain - 1) / grain, WeightTable(bones));
  for_parts(vertices, grain, progress, steps,
            [&](std::size_t begin, std::size_t end, std::size_t part) { make(begin, end, parts[part]); });
  if (parts.size() == 1) return std::move(parts.front());
  std::size_t entries = 0;
  for (const WeightTable& part : parts) entries += part.entries().size();
  WeightTable whole(bones);
  whole.reserve(vertices, entries);
  for (WeightTable& part : parts) {
    whole.add_rows(part);
    part = WeightTable();
  }
  return whole;
}

}  // namespace sinew
