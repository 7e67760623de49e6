/// Weights of points while they are put together.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "sinew/automatic_weights.h"
#include "sinew/lists.h"
#include "weights/heat.h"

namespace sinew {

/// The influences of one point.
using WeightRow = std::vector<std::pair<std::int32_t, double>>;

/// Leaves out small weights and those beyond the allowed number, never all, and makes the sum 1.
class RowFinisher {
 public:
  explicit RowFinisher(const WeightSettings& settings) : settings_(settings) {}
  /// row  joints ascending, each once, at least one weight above 0.
  void operator()(WeightRow& row);

 private:
  const WeightSettings& settings_;
  WeightRow sorted_;
};

/// Rows of points, in the order of their joints.
using PointRows = Lists<WeightEntry>;

}  // namespace sinew
