#include "sinew/weight_table.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/offsets.h"
#include "sinew/skin.h"

namespace sinew {
namespace {

void check_bone_count(const char* name, std::ptrdiff_t bones) {
  if (bones < 1) fail(name, " has no columns; expected one for each bone");
  if (bones > kMostJoints) fail(name, " has ", plural(bones, "bone"), "; expected ", grouped(kMostJoints), " at most");
}

void check_weight(const char* name, float weight, std::ptrdiff_t vertex, std::ptrdiff_t bone) {
  if (std::isfinite(weight) && weight >= 0) return;
  fail(name, " is ", weight, " at vertex ", vertex, ", bone ", bone, "; expected 0 or more");
}

}  // namespace

void merge_bones(std::vector<BoneWeight>& row) {
  std::ranges::stable_sort(row, {}, &BoneWeight::bone);
  std::size_t kept = 0;
  for (const BoneWeight& own : row) {
    if (kept > 0 && row[kept - 1].bone == own.bone) {
      row[kept - 1].weight = std::min(row[kept - 1].weight + own.weight, std::numeric_limits<float>::max());
    } else {
      row[kept++] = own;
    }
  }
  row.resize(kept);
}

WeightTable WeightTable::from_dense(const char* name, std::span<const float> weights, std::ptrdiff_t vertices,
                                    std::ptrdiff_t bones) {
  check_bone_count(name, bones);
  WeightTable table(bones);
  for (std::ptrdiff_t v = 0; v < vertices; ++v) {
    for (std::ptrdiff_t bone = 0; bone < bones; ++bone) {
      const float weight = weights[v * bones + bone];
      check_weight(name, weight, v, bone);
      if (weight > 0) table.entries_.push_back({static_cast<std::int32_t>(bone), weight});
    }
    table.offsets_.push_back(std::ssize(table.entries_));
  }
  return table;
}

WeightTable WeightTable::from_lists(std::span<const std::int64_t> offsets, std::span<const std::int32_t> bones,
                                    std::span<const float> weights, std::ptrdiff_t bone_count) {
  if (bone_count < 1 || bone_count > kMostJoints) {
    fail("bone_count is ", bone_count, "; expected 1 to ", grouped(kMostJoints));
  }
  if (bones.size() != weights.size()) {
    fail("bones has ", plural(std::ssize(bones), "number"), ", weights ", grouped(std::ssize(weights)));
  }
  check_offsets("offsets", offsets, std::ssize(bones), "bones");
  WeightTable table(bone_count);
  table.reserve(offsets.size() - 1, bones.size());
  std::vector<BoneWeight> row;
  for (std::size_t v = 0; v + 1 < offsets.size(); ++v) {
    row.clear();
    for (std::int64_t i = offsets[v]; i < offsets[v + 1]; ++i) {
      if (bones[i] < 0 || bones[i] >= bone_count) {
        fail("bones names bone ", bones[i], " at vertex ", v, "; there are ", plural(bone_count, "bone"));
      }
      check_weight("weights", weights[i], static_cast<std::ptrdiff_t>(v), bones[i]);
      if (weights[i] > 0) row.push_back({bones[i], weights[i]});
    }
    merge_bones(row);
    table.add_row(row);
  }
  return table;
}

void WeightTable::add_rows(const WeightTable& more) {
  const std::int64_t first = offsets_.back();
  for (std::size_t v = 1; v < more.offsets_.size(); ++v) offsets_.push_back(first + more.offsets_[v]);
  entries_.insert(entries_.end(), more.entries_.begin(), more.entries_.end());
}

}  // namespace sinew
