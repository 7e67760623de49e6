#include "weights/welded_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/cancelled.h"
#include "base/disjoint_sets.h"
#include "mesh/faces.h"

namespace sinew {
namespace {

// Cells in which all vertices are one point, and how close to a cell's border a vertex joins those beyond it.
constexpr double kCell = 8e-6, kClose = 1e-6;

using Cell = std::array<std::int64_t, 3>;

/// The cells that have vertices, in an open hash table.
class Cells {
 public:
  explicit Cells(std::size_t most) {
    std::size_t size = 16;
    while (size < 2 * most) size *= 2;
    entries_.resize(size, {Cell{}, kNone});
  }

  /// Returns the first vertex of a cell, which is `vertex` if there was none.
  std::uint32_t first_or(const Cell& cell, std::uint32_t vertex) {
    Entry& entry = entries_[at(cell)];
    if (entry.vertex == kNone) entry = {cell, vertex};
    return entry.vertex;
  }
  /// Returns the first vertex of a cell, or kNone.
  std::uint32_t find(const Cell& cell) const { return entries_[at(cell)].vertex; }

  static constexpr std::uint32_t kNone = 0xffffffff;

 private:
  struct Entry {
    Cell cell;
    std::uint32_t vertex;
  };
  std::size_t at(const Cell& cell) const {
    auto hash = static_cast<std::uint64_t>(cell[0]);
    hash = hash * 0x9e3779b97f4a7c15u + static_cast<std::uint64_t>(cell[1]);
    hash = hash * 0x9e3779b97f4a7c15u + static_cast<std::uint64_t>(cell[2]);
    hash = (hash ^ (hash >> 29)) * 0xbf58476d1ce4e5b9u;
    const std::size_t mask = entries_.size() - 1;
    std::size_t slot = (hash ^ (hash >> 32)) & mask;
    while (entries_[slot].vertex != kNone && entries_[slot].cell != cell) slot = (slot + 1) & mask;
    return slot;
  }
  std::vector<Entry> entries_;
};

std::vector<std::uint32_t> weld_points(std::span<const Eigen::Vector3d> all, std::vector<Eigen::Vector3d>& points) {
  DisjointSets sets(all.size());
  Cells cells(all.size());
  std::vector<Cell> cell_of(all.size());
  for (std::uint32_t v = 0; v < all.size(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      cell_of[v][axis] = static_cast<std::int64_t>(std::floor(all[v][axis] / kCell));
    }
    sets.join(v, cells.first_or(cell_of[v], v));
  }
  for (std::uint32_t v = 0; v < all.size(); ++v) {
    Cell low = cell_of[v], high = cell_of[v];
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = static_cast<std::int64_t>(std::floor((all[v][axis] - kClose) / kCell));
      high[axis] = static_cast<std::int64_t>(std::floor((all[v][axis] + kClose) / kCell));
    }
    if (low == high) continue;
    for (Cell cell = low; cell[0] <= high[0]; ++cell[0]) {
      for (cell[1] = low[1]; cell[1] <= high[1]; ++cell[1]) {
        for (cell[2] = low[2]; cell[2] <= high[2]; ++cell[2]) {
          const std::uint32_t other = cells.find(cell);
          if (other != Cells::kNone && (all[other] - all[v]).norm() <= kCell) sets.join(v, other);
        }
      }
    }
  }
  auto [point_of, count] = sets.numbered();
  points.resize(count);
  std::vector<std::uint8_t> is_set(count);
  for (std::size_t v = 0; v < all.size(); ++v) {
    if (std::exchange(is_set[point_of[v]], 1) == 0) points[point_of[v]] = all[v];
  }
  return std::move(point_of);
}

/// One side of a triangle.
struct Side {
  std::uint32_t low, high;
  std::uint32_t triangle;
  bool is_forward;  ///< from low to high
};

/// All sides, those of the same edge one after the other.
std::vector<Side> sorted_sides(const WeldedMesh& mesh) {
  // Sorted by counting: first by the higher end, then, in that order, by the lower.
  std::vector<Side> sides, sorted;
  sides.reserve(3 * mesh.triangles.size());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t a = mesh.triangles[t][i], b = mesh.triangles[t][(i + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), t, a < b});
    }
  }
  sorted.resize(sides.size());
  for (const auto end : {&Side::high, &Side::low}) {
    std::vector<std::uint32_t> begin(mesh.points.size() + 1);
    for (const Side& side : sides) ++begin[side.*end + 1];
    for (std::size_t p = 1; p < begin.size(); ++p) begin[p] += begin[p - 1];
    for (const Side& side : sides) sorted[begin[side.*end]++] = side;
    sides.swap(sorted);
  }
  return sides;
}

/// Calls visit(first, end) for the sides of each edge.
template <class Visit>
void for_edges(std::span<const Side> sides, const Visit& visit) {
  for (std::size_t first = 0; first < sides.size();) {
    std::size_t end = first + 1;
    while (end < sides.size() && sides[end].low == sides[first].low && sides[end].high == sides[first].high) ++end;
    visit(first, end);
    first = end;
  }
}

/// Finds faces with the same points as an earlier one.
std::vector<std::uint8_t> doubles(const Faces& faces, std::span<const std::uint32_t> point_of) {
  const auto corners_of = [&](std::size_t face) {
    return faces.vertices.subspan(faces.offsets[face], faces.offsets[face + 1] - faces.offsets[face]);
  };
  const auto sorted_points_of = [&](std::size_t face) {
    std::vector<std::uint32_t> points;
    for (const std::int32_t v : corners_of(face)) points.push_back(point_of[v]);
    std::ranges::sort(points);
    return points;
  };
  std::vector<std::pair<std::uint64_t, std::uint32_t>> hashes;
  for (std::uint32_t face = 0; face < faces.count(); ++face) {
    std::uint64_t hash = 0;
    for (const std::int32_t v : corners_of(face)) {
      std::uint64_t own = (point_of[v] + 1) * 0x9e3779b97f4a7c15u;
      own = (own ^ (own >> 31)) * 0xbf58476d1ce4e5b9u;
      hash += own ^ (own >> 27);
    }
    hashes.emplace_back(hash, face);
  }
  std::ranges::sort(hashes);
  std::vector<std::uint8_t> is_double(faces.count());
  for (std::size_t i = 1; i < hashes.size(); ++i) {
    if (hashes[i].first != hashes[i - 1].first) continue;
    is_double[hashes[i].second] = sorted_points_of(hashes[i].second) == sorted_points_of(hashes[i - 1].second);
  }
  return is_double;
}

/// Sets the triangles, without those of double faces: the winding numbers of a front and a back side would cancel.
/// Returns their sides.
std::vector<Side> set_triangles(const Faces& faces, WeldedMesh& mesh) {
  mesh.triangles = triangles_of(faces, mesh.point_of);
  std::vector<Side> sides = sorted_sides(mesh);
  bool has_many = false;
  for_edges(sides, [&](std::size_t first, std::size_t end) { has_many |= end - first > 2; });
  if (!has_many) return sides;
  const std::vector<std::uint8_t> is_double = doubles(faces, mesh.point_of);
  if (std::ranges::find(is_double, 1) == is_double.end()) return sides;
  mesh.triangles = triangles_of(faces, mesh.point_of, is_double);
  return sorted_sides(mesh);
}

/// Finds the patches, and orients the triangles of each alike: as most of them were.
void orient(WeldedMesh& mesh, std::span<const Side> sides) {
  constexpr std::uint32_t kNone = 0xffffffff;
  struct Neighbour {
    std::uint32_t triangle = kNone;
    bool is_alike = true;
  };
  const std::size_t count = mesh.triangles.size();
  std::vector<std::array<Neighbour, 3>> neighbours(count);
  std::vector<std::uint8_t> used(count), has_border(count);
  for_edges(sides, [&](std::size_t first, std::size_t end) {
    const Side &a = sides[first], &b = sides[end - 1];
    if (end - first == 2) {
      const bool is_alike = a.is_forward != b.is_forward;
      neighbours[a.triangle][used[a.triangle]++] = {b.triangle, is_alike};
      neighbours[b.triangle][used[b.triangle]++] = {a.triangle, is_alike};
    } else {
      for (std::size_t i = first; i < end; ++i) has_border[sides[i].triangle] = 1;
    }
  });
  mesh.patch_of.assign(count, kNone);
  std::vector<std::uint8_t> is_flipped(count);
  std::vector<std::uint32_t> patch;
  for (std::uint32_t start = 0; start < count; ++start) {
    if (mesh.patch_of[start] != kNone) continue;
    const auto number = static_cast<std::uint32_t>(mesh.patch_count());
    patch.assign(1, start);
    mesh.patch_of[start] = number;
    std::size_t flipped = 0;
    bool is_closed = true;
    for (std::size_t i = 0; i < patch.size(); ++i) {
      const std::uint32_t t = patch[i];
      flipped += is_flipped[t];
      is_closed &= has_border[t] == 0;
      for (int k = 0; k < used[t]; ++k) {
        const auto [other, is_alike] = neighbours[t][k];
        if (mesh.patch_of[other] != kNone) continue;
        mesh.patch_of[other] = number;
        is_flipped[other] = is_flipped[t] ^ static_cast<std::uint8_t>(!is_alike);
        patch.push_back(other);
      }
    }
    const bool flip_others = 2 * flipped > patch.size();
    for (const std::uint32_t t : patch) {
      if ((is_flipped[t] != 0) != flip_others) mesh.flip(t);
    }
    mesh.is_closed.push_back(is_closed);
  }
}

/// Turns closed patches inside out where they enclose a negative volume.
void turn_closed_outward(WeldedMesh& mesh) {
  std::vector<Eigen::Vector3d> origin(mesh.patch_count(), Eigen::Vector3d::Zero());
  std::vector<std::uint8_t> has_origin(mesh.patch_count());
  std::vector<double> volume(mesh.patch_count());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t patch = mesh.patch_of[t];
    const auto& [a, b, c] = mesh.triangles[t];
    if (std::exchange(has_origin[patch], 1) == 0) origin[patch] = mesh.points[a];
    const Eigen::Vector3d& o = origin[patch];
    volume[patch] += (mesh.points[a] - o).dot((mesh.points[b] - o).cross(mesh.points[c] - o));
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t patch = mesh.patch_of[t];
    if (mesh.is_closed[patch] && volume[patch] < 0) mesh.flip(t);
  }
}

}  // namespace

WeldedMesh weld(const UnitFrame& frame, std::span<const double> positions, const Faces& faces,
                const Progress* progress) {
  WeldedMesh mesh;
  mesh.point_of = weld_points(points_in(frame, positions), mesh.points);
  stop_if_cancelled(progress);
  const std::vector<Side> sides = set_triangles(faces, mesh);
  stop_if_cancelled(progress);
  orient(mesh, sides);
  turn_closed_outward(mesh);
  // A side of a triangle without extent still connects two points.
  DisjointSets parts(mesh.points.size());
  for_sides(faces,
            [&](std::size_t, std::int32_t a, std::int32_t b) { parts.join(mesh.point_of[a], mesh.point_of[b]); });
  const auto [numbers, count] = parts.numbered();
  mesh.part_of.assign(numbers.begin(), numbers.end());
  mesh.part_count = static_cast<std::int32_t>(count);
  return mesh;
}

}  // namespace sinew
