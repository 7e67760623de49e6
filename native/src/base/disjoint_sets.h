/// Union and find.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

namespace sinew {

/// Sets of numbers. The root of a set is its smallest member.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parents_(count) {
    std::iota(parents_.begin(), parents_.end(), std::uint32_t{0});
  }

  std::uint32_t root(std::uint32_t member) {
    while (parents_[member] != member) {
      parents_[member] = parents_[parents_[member]];
      member = parents_[member];
    }
    return member;
  }

  void join(std::uint32_t a, std::uint32_t b) {
    a = root(a);
    b = root(b);
    parents_[std::max(a, b)] = std::min(a, b);
  }

  /// Returns the number of each member's set, in the order of their smallest members, and how many there are.
  std::pair<std::vector<std::uint32_t>, std::uint32_t> numbered() {
    std::vector<std::uint32_t> numbers(parents_.size());
    std::uint32_t count = 0;
    for (std::uint32_t member = 0; member < numbers.size(); ++member) {
      const std::uint32_t own = root(member);
      numbers[member] = own == member ? count++ : numbers[own];
    }
    return {std::move(numbers), count};
  }

 private:
  std::vector<std::uint32_t> parents_;
};

}  // namespace sinew
