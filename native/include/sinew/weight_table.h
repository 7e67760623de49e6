/// Weights of vertices in bones, without those that are 0.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace sinew {

struct BoneWeight {
  std::int32_t bone;
  float weight;

  bool operator==(const BoneWeight&) const = default;
};

/// Sorts by bone, and adds the weights of the same bone.
void merge_bones(std::vector<BoneWeight>& row);

/// The weights above 0 of V vertices in B bones. Each vertex has as many as it needs, in the order of the bones.
class WeightTable {
 public:
  WeightTable() = default;
  explicit WeightTable(std::ptrdiff_t bones) : bones_(bones) {}

  /// weights  V x B, row by row. name  of the argument, for messages. Throws InputError for a weight that is below 0 or
  /// not finite, and for tables without bones.
  static WeightTable from_dense(const char* name, std::span<const float> weights, std::ptrdiff_t vertices,
                                std::ptrdiff_t bones);
  /// offsets  V + 1: vertex v has the entries offsets[v] up to offsets[v + 1], in any order; weights of a bone that is
  /// named twice are added. bones, weights  N. Throws InputError as above, and for what does not fit.
  static WeightTable from_lists(std::span<const std::int64_t> offsets, std::span<const std::int32_t> bones,
                                std::span<const float> weights, std::ptrdiff_t bone_count);

  std::ptrdiff_t vertices() const { return std::ssize(offsets_) - 1; }
  std::ptrdiff_t bones() const { return bones_; }
  std::span<const BoneWeight> row(std::size_t vertex) const {
    return std::span(entries_).subspan(offsets_[vertex], offsets_[vertex + 1] - offsets_[vertex]);
  }
  /// V + 1: where the entries of each vertex begin.
  std::span<const std::int64_t> offsets() const { return offsets_; }
  std::span<const BoneWeight> entries() const { return entries_; }
  std::span<BoneWeight> entries() { return entries_; }

  bool operator==(const WeightTable&) const = default;

  /// row  bones ascending, weights above 0.
  void add_row(std::span<const BoneWeight> row) {
    entries_.insert(entries_.end(), row.begin(), row.end());
    offsets_.push_back(std::ssize(entries_));
  }
  void add_rows(const WeightTable& more);
  void reserve(std::size_t vertices, std::size_t entries) {
    offsets_.reserve(vertices + 1);
    entries_.reserve(entries);
  }

 private:
  std::ptrdiff_t bones_ = 0;
  std::vector<std::int64_t> offsets_{0};
  std::vector<BoneWeight> entries_;
};

}  // namespace sinew
