/// Lists of items by number, one after the other: neighbours of points, triangles of patches, entries of vertices.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace sinew {

template <class Item>
struct Lists {
  std::vector<std::uint32_t> begin{0};  ///< lists + 1
  std::vector<Item> items;

  Lists() = default;
  /// each  calls its argument with the number of a list and an item, for all items; it is called twice, and must do the
  /// same. Items are in the order in which they come.
  template <class Each>
  Lists(std::size_t count, const Each& each) : begin(count + 1) {
    each([&](std::size_t list, const Item&) { ++begin[list + 1]; });
    for (std::size_t i = 0; i < count; ++i) begin[i + 1] += begin[i];
    items.resize(begin.back());
    std::vector<std::uint32_t> at(begin.begin(), begin.end() - 1);
    each([&](std::size_t list, const Item& item) { items[at[list]++] = item; });
  }

  std::size_t size() const { return begin.size() - 1; }
  std::span<const Item> operator[](std::size_t list) const {
    return std::span(items).subspan(begin[list], begin[list + 1] - begin[list]);
  }
};

}  // namespace sinew
