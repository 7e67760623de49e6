#include "mesh/adjacency.h"

namespace sinew {

Lists<std::uint32_t> neighbours_by_sides(const Faces& faces, std::span<const std::uint32_t> point_of,
                                         std::size_t points) {
  Lists<std::uint32_t> joined(points, [&](const auto& add) {  // sides of two faces are in it twice
    for_sides(faces, [&](std::size_t, std::int32_t from, std::int32_t to) {
      const std::uint32_t a = point_of[from], b = point_of[to];
      if (a == b) return;
      add(a, b);
      add(b, a);
    });
  });
  std::uint32_t kept = 0, begin = 0;
  for (std::size_t p = 0; p < points; ++p) {
    const auto first = joined.items.begin() + begin, last = joined.items.begin() + joined.begin[p + 1];
    std::sort(first, last);
    const auto end = std::unique(first, last);
    begin = joined.begin[p + 1];
    kept = static_cast<std::uint32_t>(std::copy(first, end, joined.items.begin() + kept) - joined.items.begin());
    joined.begin[p + 1] = kept;
  }
  joined.items.resize(kept);
  return joined;
}

}  // namespace sinew
