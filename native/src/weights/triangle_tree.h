/// A hierarchy of bounds over triangles: winding numbers and closest points.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "sinew/progress.h"
#include "weights/welded_mesh.h"

namespace sinew {

/// A closest point on a triangle.
struct SurfacePoint {
  std::uint32_t triangle = 0xffffffff;  ///< or that, if there was none
  double squared_distance = std::numeric_limits<double>::infinity();
  Eigen::Vector3d shares = Eigen::Vector3d::Zero();  ///< of the triangle's corners
};

/// Keeps references to points and triangles.
class TriangleTree {
 public:
  /// has_winding  whether winding numbers will be wanted; without them it takes a third of the memory.
  TriangleTree(std::span<const Eigen::Vector3d> points, std::span<const Triangle> triangles,
               const Progress* progress = nullptr, bool has_winding = true);

  /// The generalised winding number: the solid angle of all triangles seen from a point, divided by 4 pi. Far groups of
  /// triangles count by the first two terms of their expansion: Barill, Dickson, Schmidt, Levin, Jacobson, "Fast
  /// winding numbers for soups and clouds", ACM TOG 37(4), 2018, with beta = 2.
  double winding_number(const Eigen::Vector3d& point) const;

  /// Returns the closest point, if one is closer than the square root of `within`.
  SurfacePoint closest(const Eigen::Vector3d& point, double within = std::numeric_limits<double>::infinity()) const;

  /// Adds the triangles whose bounding boxes meet a box to `found`.
  void in_box(const Eigen::Vector3d& low, const Eigen::Vector3d& high, std::vector<std::uint32_t>& found) const;

 private:
  struct Node {
    Eigen::Vector3d low, high;
    std::uint32_t begin, end;
    std::uint32_t right;  ///< the second child, 0 for a leaf; the first follows its parent
  };
  struct Far {               ///< a node from afar
    Eigen::Vector3d centre;  ///< weighted by areas
    Eigen::Vector3d normal;  ///< sum of area times normal
    Eigen::Matrix3d moment;  ///< sum of (centroid - centre) (area times normal)^T
    double area;
    double radius;  ///< of a ball about the centre that holds all
  };
  void split(std::uint32_t begin, std::uint32_t end, std::size_t at, std::span<const Eigen::Vector3d> centroids,
             const Progress* progress);
  void fill_leaf(std::size_t at);
  void fill_from_children(std::size_t at);
  Eigen::Vector3d corner(std::uint32_t triangle, int i) const { return points_[triangles_[triangle][i]]; }
  Eigen::Vector3d centroid(std::uint32_t t) const { return (corner(t, 0) + corner(t, 1) + corner(t, 2)) / 3; }

  std::span<const Eigen::Vector3d> points_;
  std::span<const Triangle> triangles_;
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
  std::vector<Far> far_;  // of each node, or none
};

}  // namespace sinew
