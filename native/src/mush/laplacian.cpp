#include "mush/laplacian.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "mesh/faces.h"

namespace sinew {
namespace {

/// L, entry by entry; entries with the same row and column are added up.
class Entries {
 public:
  explicit Entries(std::size_t vertices) : diagonal_(vertices) {}

  void add_diagonal(std::int32_t v, double value) { diagonal_[v] += value; }
  void add_edge(std::int32_t a, std::int32_t b, double value) {
    if (a == b) return;
    entries_.push_back({a, b, value});
    entries_.push_back({b, a, value});
  }

  /// Returns D^-1 L. once  entries of the same edge count as one.
  Laplacian normalised(bool once) {
    std::ranges::stable_sort(
        entries_, [](const Entry& a, const Entry& b) { return a.row != b.row ? a.row < b.row : a.column < b.column; });
    Laplacian result;
    result.begin.push_back(0);
    auto at = entries_.begin();
    for (std::size_t v = 0; v < diagonal_.size(); ++v) {
      auto end = at;
      while (end != entries_.end() && end->row == static_cast<std::int32_t>(v)) ++end;
      add_row(at, end, once, once ? 0 : diagonal_[v], result);
      at = end;
    }
    return result;
  }

 private:
  struct Entry {
    std::int32_t row, column;
    double value;
  };
  using At = std::vector<Entry>::const_iterator;

  static void add_row(At at, At end, bool once, double diagonal, Laplacian& result) {
    const std::size_t first = result.columns.size();
    for (; at != end; ++at) {
      const auto column = static_cast<std::uint32_t>(at->column);
      const bool known = result.columns.size() > first && result.columns.back() == column;
      if (known && !once) result.values.back() += at->value;
      if (known) continue;
      result.columns.push_back(column);
      result.values.push_back(at->value);
    }
    if (once) diagonal = static_cast<double>(result.columns.size() - first);
    double sum = 1;
    for (std::size_t i = first; i < result.values.size(); ++i) {
      result.values[i] /= diagonal;
      sum += std::abs(result.values[i]);
    }
    if (!(diagonal > 0) || !std::isfinite(sum)) {
      result.columns.resize(first);
      result.values.resize(first);
    } else {
      // Gershgorin; and a triangle's contribution has no eigenvalue above 3 relative to its own diagonal, since its
      // three eigenvalues are not negative and add up to 3.
      result.largest = std::max(result.largest, std::min(sum, 3.0));
    }
    result.begin.push_back(static_cast<std::uint32_t>(result.columns.size()));
  }

  std::vector<double> diagonal_;
  std::vector<Entry> entries_;
};

/// Adds a Gram matrix of the sides: -cot / 2 off the diagonal. Written so, it keeps its sign however thin the triangle.
void add_triangle(std::span<const float> positions, const std::array<std::int32_t, 3>& corners, Entries& entries) {
  constexpr double kNoArea = 1e-12;  // relative to the longest side squared
  Eigen::Vector3d points[3], sides[3];
  for (int i = 0; i < 3; ++i) points[i] = Eigen::Map<const Eigen::Vector3f>(&positions[3 * corners[i]]).cast<double>();
  double longest = 0;
  for (int i = 0; i < 3; ++i) {
    sides[i] = points[(i + 2) % 3] - points[(i + 1) % 3];
    longest = std::max(longest, sides[i].squaredNorm());
  }
  const double area = sides[0].cross(sides[1]).norm() / 2;
  const bool flat = !(area > kNoArea * longest);
  const double equilateral = 1 / std::sqrt(12.0);
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    if (!flat) {
      entries.add_diagonal(corners[i], sides[i].squaredNorm() / (4 * area));
      entries.add_edge(corners[i], corners[j], sides[i].dot(sides[j]) / (4 * area));
    } else if (corners[i] != corners[j]) {
      entries.add_diagonal(corners[i], equilateral);
      entries.add_diagonal(corners[j], equilateral);
      entries.add_edge(corners[i], corners[j], -equilateral);
    }
  }
}

}  // namespace

Laplacian laplacian(std::span<const float> positions, std::span<const std::int32_t> face_offsets,
                    std::span<const std::int32_t> face_vertices, LaplacianKind kind) {
  Entries entries(positions.size() / 3);
  const bool uniform = kind == LaplacianKind::uniform;
  for (std::size_t f = 0; uniform && f + 1 < face_offsets.size(); ++f) {
    const auto face = face_vertices.subspan(face_offsets[f], face_offsets[f + 1] - face_offsets[f]);
    for (std::size_t i = 0; i < face.size(); ++i) entries.add_edge(face[i], face[(i + 1) % face.size()], -1);
  }
  if (!uniform) {
    for_triangles(face_offsets, face_vertices, [&](const auto& corners) { add_triangle(positions, corners, entries); });
  }
  return entries.normalised(uniform);
}

}  // namespace sinew
