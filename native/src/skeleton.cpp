#include "sinew/skeleton.h"

#include <Eigen/LU>

#include "check.h"

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

/// Children of every joint as one list with offsets; entry 0 holds the roots, entry j + 1 the
/// children of joint j, each in ascending order.
struct Children {
  std::vector<std::int32_t> begin;
  std::vector<std::int32_t> joints;
};

Children children_of(std::span<const std::int32_t> parents) {
  Children children{std::vector<std::int32_t>(parents.size() + 2, 0),
                    std::vector<std::int32_t>(parents.size())};
  for (const std::int32_t parent : parents) ++children.begin[parent + 2];
  for (std::size_t i = 1; i < children.begin.size(); ++i)
    children.begin[i] += children.begin[i - 1];
  std::vector<std::int32_t> next(children.begin.begin(), children.begin.end() - 1);
  for (std::size_t j = 0; j < parents.size(); ++j) {
    children.joints[next[parents[j] + 1]++] = static_cast<std::int32_t>(j);
  }
  return children;
}

}  // namespace

Skeleton::Skeleton(std::span<const std::int32_t> parents, std::span<const Matrix4<double>> rest)
    : parents_(parents.begin(), parents.end()), rest_(rest.begin(), rest.end()) {
  if (parents.size() != rest.size()) {
    fail("there are ", plural(parents.size(), "parent"), " and ",
         plural(rest.size(), "rest transform"), "; expected one of each a joint");
  }
  check_parents(parents);

  // Breadth first from the roots. What is not reached hangs on a cycle.
  const Children children = children_of(parents);
  order_.reserve(parents.size());
  std::vector<bool> reached(parents.size(), false);
  const auto visit = [&](std::int32_t list) {
    for (auto i = children.begin[list]; i < children.begin[list + 1]; ++i) {
      order_.push_back(children.joints[i]);
      reached[children.joints[i]] = true;
    }
  };
  visit(0);
  level_begin_.push_back(0);
  while (level_begin_.back() < static_cast<std::int32_t>(order_.size())) {
    const std::int32_t begin = level_begin_.back();
    const auto end = static_cast<std::int32_t>(order_.size());
    level_begin_.push_back(end);
    for (std::int32_t i = begin; i < end; ++i) visit(order_[i] + 1);
  }
  for (std::size_t j = 0; j < parents.size(); ++j) {
    if (!reached[j]) fail("joint ", j, " is its own ancestor: its chain of parents is a cycle");
  }

  rest_float_.reserve(rest.size());
  rest_world_.resize(rest.size());
  inverse_rest_.resize(rest.size());
  for (std::size_t j = 0; j < rest.size(); ++j) {
    if (!rest[j].allFinite()) {
      fail("the rest transform of joint ", j, " holds a number that is not finite");
    }
    rest_float_.push_back(rest[j].cast<float>());
  }
  for (const std::int32_t j : order_) {
    rest_world_[j] = parents[j] < 0 ? rest[j] : Matrix4<double>(rest_world_[parents[j]] * rest[j]);
    const Eigen::FullPivLU<Matrix4<double>> lu(rest_world_[j]);
    if (!lu.isInvertible()) fail("the rest transform of joint ", j, " cannot be inverted");
    inverse_rest_[j] = lu.inverse();
  }
}

}  // namespace sinew
