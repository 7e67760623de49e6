#include "mush/laplacian.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "mesh/adjacency.h"
#include "mesh/faces.h"

namespace sinew {
namespace {

/// Ends the row of a vertex, whose numbers from `first` on are those of L, without the diagonal.
void end_row(std::size_t first, double diagonal, Laplacian& result) {
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

  /// Returns D^-1 L.
  Laplacian normalised() {
    std::ranges::stable_sort(entries_, {}, [](const Entry& entry) { return std::pair(entry.row, entry.column); });
    Laplacian result;
    result.begin.push_back(0);
    auto at = entries_.begin();
    for (std::size_t v = 0; v < diagonal_.size(); ++v) {
      const std::size_t first = result.columns.size();
      for (; at != entries_.end() && at->row == static_cast<std::int32_t>(v); ++at) {
        const auto column = static_cast<std::uint32_t>(at->column);
        if (result.columns.size() > first && result.columns.back() == column) {
          result.values.back() += at->value;
        } else {
          result.columns.push_back(column);
          result.values.push_back(at->value);
        }
      }
      end_row(first, diagonal_[v], result);
    }
    return result;
  }

 private:
  struct Entry {
    std::int32_t row, column;
    double value;
  };

  std::vector<double> diagonal_;
  std::vector<Entry> entries_;
};

Laplacian uniform_laplacian(const Faces& faces, std::size_t vertices) {
  const Lists<std::uint32_t> neighbours = neighbours_by_sides(faces, vertices);
  Laplacian result;
  result.begin.push_back(0);
  for (std::size_t v = 0; v < vertices; ++v) {
    const std::size_t first = result.columns.size();
    result.columns.insert(result.columns.end(), neighbours[v].begin(), neighbours[v].end());
    result.values.resize(result.columns.size(), -1);
    end_row(first, static_cast<double>(neighbours[v].size()), result);
  }
  return result;
}

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
  const std::size_t vertices = positions.size() / 3;
  if (kind == LaplacianKind::uniform) return uniform_laplacian({face_offsets, face_vertices}, vertices);
  Entries entries(vertices);
  for_triangles(face_offsets, face_vertices, [&](const auto& corners) { add_triangle(positions, corners, entries); });
  return entries.normalised();
}

}  // namespace sinew
