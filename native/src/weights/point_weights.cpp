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

}  // namespace sinew
