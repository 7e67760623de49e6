#include "weights/point_weights.h"

#include <algorithm>

namespace sinew {

void RowFinisher::operator()(WeightRow& row) {
  double largest = 0;
  for (const auto& [joint, weight] : row) largest = std::max(largest, weight);
  const double least = std::min(settings_.least_weight, largest / 2);
  std::erase_if(row, [&](const auto& entry) { return !(entry.second > 0) || entry.second < least; });
  const auto most = static_cast<std::size_t>(settings_.max_influences);
  if (most > 0 && row.size() > most) {
    sorted_ = row;
    std::ranges::stable_sort(sorted_, [](const auto& a, const auto& b) { return a.second > b.second; });
    sorted_.resize(most);
    std::ranges::sort(sorted_);
    row.swap(sorted_);
  }
  double sum = 0;
  for (const auto& [joint, weight] : row) sum += weight;
  for (auto& [joint, weight] : row) weight /= sum;
}

PointRows::PointRows(std::size_t points, std::span<const WeightEntry> entries)
    : begin_(points + 1), entries_(entries.size()) {
  for (const WeightEntry& entry : entries) ++begin_[entry.place + 1];
  for (std::size_t p = 1; p < begin_.size(); ++p) begin_[p] += begin_[p - 1];
  std::vector<std::size_t> at(begin_.begin(), begin_.end() - 1);
  for (const WeightEntry& entry : entries) entries_[at[entry.place]++] = entry;
}

}  // namespace sinew
