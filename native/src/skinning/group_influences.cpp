#include "sinew/group_influences.h"

#include <cmath>

#include "base/offsets.h"

namespace sinew {
namespace {

// Blender's modifier does not move a vertex whose weights sum to no more than this.
constexpr double kSmallestSum = 1e-4;
// Blender's own automatic weights sum to 0.97 or more.
constexpr double kNormalizedWithin = 0.05;

void check(std::span<const std::int64_t> offsets, std::size_t groups, std::size_t weights) {
  if (groups != weights) {
    fail("groups has ", grouped(static_cast<long long>(groups)), " entries and weights has ",
         grouped(static_cast<long long>(weights)), "; expected as many of each");
  }
  check_offsets("offsets", offsets, static_cast<std::ptrdiff_t>(groups), "entries");
}

}  // namespace

GroupInfluences group_influences(std::span<const std::int64_t> offsets, std::span<const std::int32_t> groups,
                                 std::span<const float> weights, std::span<const std::int32_t> joint_of_group,
                                 bool normalize) {
  GroupInfluences result;
  result.offsets.assign(offsets.begin(), offsets.end());
  check(result.offsets, groups.size(), weights.size());
  result.joints.resize(groups.size());
  result.weights.resize(groups.size());
  std::int64_t kept = 0, entry = 0;
  for (std::size_t v = 0; v + 1 < result.offsets.size(); ++v) {
    const std::int64_t first = kept, end = result.offsets[v + 1];
    double sum = 0;
    for (; entry < end; ++entry) {
      const auto group = static_cast<std::uint32_t>(groups[entry]);  // a negative one is huge
      const std::int32_t joint = group < joint_of_group.size() ? joint_of_group[group] : -1;
      if (joint < 0 || weights[entry] == 0) continue;
      result.joints[kept] = joint;
      result.weights[kept] = weights[entry];
      sum += result.weights[kept++];
    }
    if (sum > kSmallestSum) {
      const double scale = normalize ? 1 / sum : 1;
      for (std::int64_t i = first; i < kept; ++i) result.weights[i] = static_cast<float>(result.weights[i] * scale);
      result.unnormalized_count += std::abs(sum - 1) > kNormalizedWithin;
    } else {
      kept = first;
      ++result.unweighted_count;
    }
    result.offsets[v + 1] = kept;
  }
  result.joints.resize(kept);
  result.weights.resize(kept);
  return result;
}

}  // namespace sinew
