#include "sinew/skeleton.h"

#include <Eigen/LU>
#include <algorithm>
#include <iterator>
#include <numeric>

#include "base/check.h"

namespace sinew {
namespace {

void check_parents(std::span<const std::int32_t> parents) {
  const auto count = static_cast<std::ptrdiff_t>(parents.size());
  for (std::ptrdiff_t j = 0; j < count; ++j) {
    if (parents[j] < -1 || parents[j] >= count) {
      fail("joint ", j, " has parent ", parents[j], "; expected -1 (a root) to ", count - 1);
    }
  }
}

/// The children of every joint as one list with offsets; entry 0 holds the roots, entry j + 1 the
/// children of joint j, each in ascending order.
struct Children {
  std::vector<std::int32_t> begin;
  std::vector<std::int32_t> joints;
};

Children children_of(std::span<const std::int32_t> parents) {
  Children children{std::vector<std::int32_t>(parents.size() + 2, 0), std::vector<std::int32_t>(parents.size())};
  for (const std::int32_t parent : parents) ++children.begin[parent + 2];
  for (std::size_t i = 1; i < children.begin.size(); ++i) children.begin[i] += children.begin[i - 1];
  std::vector<std::int32_t> next(children.begin.begin(), children.begin.end() - 1);
  for (std::size_t j = 0; j < parents.size(); ++j) {
    children.joints[next[parents[j] + 1]++] = static_cast<std::int32_t>(j);
  }
  return children;
}

/// Appends `joint` and its descendants, parents before children.
void append_subtree(const Children& children, std::int32_t joint, std::vector<std::int32_t>& order) {
  std::size_t next = order.size();
  order.push_back(joint);
  for (; next < order.size(); ++next) {
    for (auto i = children.begin[order[next] + 1]; i < children.begin[order[next] + 2]; ++i) {
      order.push_back(children.joints[i]);
    }
  }
}

}  // namespace

Skeleton::Skeleton(std::span<const std::int32_t> parents, std::span<const Matrix4<double>> rest)
    : parents_(parents.begin(), parents.end()), rest_(rest.begin(), rest.end()) {
  if (parents.size() != rest.size()) {
    fail("there are ", plural(parents.size(), "parent"), " and ", plural(rest.size(), "rest transform"),
         "; expected one of each per joint");
  }
  check_parents(parents);

  put_in_order();

  rest_float_.reserve(rest.size());
  rest_world_.resize(rest.size());
  inverse_rest_.resize(rest.size());
  for (std::size_t j = 0; j < rest.size(); ++j) {
    if (!rest[j].allFinite()) {
      fail("the rest transform of joint ", j, " holds a number that is not finite");
    }
    rest_float_.emplace_back(rest[j].cast<float>());
  }
  for (const std::int32_t j : order_) {
    rest_world_[j] = parents[j] < 0 ? rest[j] : Matrix4<double>(rest_world_[parents[j]] * rest[j]);
    const Eigen::FullPivLU<Matrix4<double>> lu(rest_world_[j]);
    if (!lu.isInvertible()) fail("the rest transform of joint ", j, " cannot be inverted");
    inverse_rest_[j] = lu.inverse();
  }
}

void Skeleton::put_in_order() {
  const Children children = children_of(parents_);
  std::vector<std::int32_t> all;
  for (auto i = children.begin[0]; i < children.begin[1]; ++i) {
    append_subtree(children, children.joints[i], all);
  }
  if (all.size() < parents_.size()) {  // joints not reached from a root depend on a cycle
    std::vector<bool> reached(parents_.size(), false);
    for (const std::int32_t j : all) reached[j] = true;
    const auto lost = std::ranges::find(reached, false) - reached.begin();
    fail("joint ", lost, " is its own ancestor: its chain of parents is a cycle");
  }

  std::vector<std::int32_t> size(parents_.size(), 1);  // of the subtree, including the joint itself
  for (auto j = all.rbegin(); j != all.rend(); ++j) {
    if (parents_[*j] >= 0) size[parents_[*j]] += size[*j];
  }
  const auto in_trunk = [&](std::int32_t j) { return size[j] > kLargestGroup; };
  std::ranges::copy_if(all, std::back_inserter(grouped_order_), in_trunk);
  group_begin_.push_back(static_cast<std::int32_t>(grouped_order_.size()));
  for (const std::int32_t j : all) {
    if (in_trunk(j) || (parents_[j] >= 0 && !in_trunk(parents_[j]))) continue;
    const auto begin = static_cast<std::int32_t>(grouped_order_.size());
    if (begin > group_begin_.back() && begin + size[j] - group_begin_.back() > kLargestGroup) {
      group_begin_.push_back(begin);
    }
    append_subtree(children, j, grouped_order_);
  }
  if (group_begin_.back() < static_cast<std::int32_t>(grouped_order_.size())) {
    group_begin_.push_back(static_cast<std::int32_t>(grouped_order_.size()));
  }

  std::int32_t number = 0;
  if (!std::ranges::all_of(parents_, [&](std::int32_t parent) { return parent < number++; })) {
    order_ = std::move(all);
    return;
  }
  // In order of their numbers, so that matrices are used in the order in which they are in memory.
  order_.resize(parents_.size());
  std::iota(order_.begin(), order_.end(), 0);
  std::int32_t begin = 0;
  for (const std::int32_t end : group_begin_) {
    std::sort(grouped_order_.begin() + begin, grouped_order_.begin() + end);
    begin = end;
  }
}

}  // namespace sinew
