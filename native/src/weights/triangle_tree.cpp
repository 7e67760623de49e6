#include "weights/triangle_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "base/cancelled.h"
#include "base/parallel.h"

namespace sinew {
namespace {

constexpr std::uint32_t kLeaf = 8;
constexpr std::uint32_t kParallel = 20000;  // triangles from which both halves are built at once
constexpr double kBeta = 2;

/// Van Oosterom, Strackee, "The solid angle of a plane triangle", 1983; divided by 4 pi.
double solid_angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  const double above = a.dot(b.cross(c));
  const double below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
  if (above == 0) return 0;  // seen edge on
  return std::atan2(above, below) / (2 * std::numbers::pi);
}

/// Returns the shares of the corners in the point of a triangle that is closest to the origin.
/// Ericson, "Real-time collision detection", 2005, 5.1.5.
Eigen::Vector3d closest_shares(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a, ac = c - a;
  const double d1 = -ab.dot(a), d2 = -ac.dot(a);
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  const double d3 = -ab.dot(b), d4 = -ac.dot(b);
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double t = d1 - d3 > 0 ? d1 / (d1 - d3) : 0;
    return {1 - t, t, 0};
  }
  const double d5 = -ab.dot(c), d6 = -ac.dot(c);
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double t = d2 - d6 > 0 ? d2 / (d2 - d6) : 0;
    return {1 - t, 0, t};
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double whole = (d4 - d3) + (d5 - d6), t = whole > 0 ? (d4 - d3) / whole : 0;
    return {0, 1 - t, t};
  }
  const double sum = va + vb + vc;
  if (!(sum > 0)) return {1, 0, 0};
  return {va / sum, vb / sum, vc / sum};
}

/// How many nodes a tree over this many triangles has.
std::size_t node_count(std::size_t triangles) {
  if (triangles <= kLeaf) return 1;
  return 1 + node_count(triangles / 2) + node_count(triangles - triangles / 2);
}

}  // namespace

TriangleTree::TriangleTree(std::span<const Eigen::Vector3d> points, std::span<const Triangle> triangles,
                           const Progress* progress, bool has_winding)
    : points_(points), triangles_(triangles), order_(triangles.size()) {
  std::iota(order_.begin(), order_.end(), std::uint32_t{0});
  if (order_.empty()) return;
  std::vector<Eigen::Vector3d> centroids(triangles.size());
  for (std::uint32_t t = 0; t < triangles.size(); ++t) centroids[t] = centroid(t);
  nodes_.resize(node_count(order_.size()));
  if (has_winding) far_.resize(nodes_.size());
  split(0, static_cast<std::uint32_t>(order_.size()), 0, centroids, progress);
}

void TriangleTree::split(std::uint32_t begin, std::uint32_t end, std::size_t at,
                         std::span<const Eigen::Vector3d> centroids, const Progress* progress) {
  if (end - begin >= kParallel) stop_if_cancelled(progress);
  Node& node = nodes_[at];
  node.begin = begin;
  node.end = end;
  node.right = 0;
  if (end - begin <= kLeaf) return fill_leaf(at);
  Eigen::Vector3d low = centroids[order_[begin]], high = low;
  for (std::uint32_t i = begin; i < end; ++i) {
    low = low.cwiseMin(centroids[order_[i]]);
    high = high.cwiseMax(centroids[order_[i]]);
  }
  Eigen::Index axis = 0;
  (high - low).maxCoeff(&axis);
  const std::uint32_t middle = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](std::uint32_t a, std::uint32_t b) {
                     const double ca = centroids[a][axis], cb = centroids[b][axis];
                     return ca != cb ? ca < cb : a < b;
                   });
  node.right = static_cast<std::uint32_t>(at + 1 + node_count(middle - begin));
  const std::array halves{std::array{begin, middle}, std::array{middle, end}};
  const std::array<std::size_t, 2> places{at + 1, node.right};
  parallel_for(2, end - begin >= kParallel ? 1 : 2, [&](std::size_t first, std::size_t last) {
    for (std::size_t half = first; half < last; ++half) {
      split(halves[half][0], halves[half][1], places[half], centroids, progress);
    }
  });
  fill_from_children(at);
}

void TriangleTree::fill_leaf(std::size_t at) {
  Node& node = nodes_[at];
  node.low.setConstant(std::numeric_limits<double>::infinity());
  node.high = -node.low;
  const auto own = std::span(order_).subspan(node.begin, node.end - node.begin);
  for (const std::uint32_t t : own) {
    for (int k = 0; k < 3; ++k) {
      node.low = node.low.cwiseMin(corner(t, k));
      node.high = node.high.cwiseMax(corner(t, k));
    }
  }
  if (far_.empty()) return;
  Far& far = far_[at];
  far = {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero(), 0, 0};
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  const auto area_normal = [&](std::uint32_t t) -> Eigen::Vector3d { return doubled_area(points_, triangles_[t]) / 2; };
  for (const std::uint32_t t : own) {
    const Eigen::Vector3d normal = area_normal(t);
    far.normal += normal;
    far.centre += normal.norm() * centroid(t);
    far.area += normal.norm();
    mean += centroid(t) / own.size();
  }
  far.centre = far.area > 0 ? Eigen::Vector3d(far.centre / far.area) : mean;
  for (const std::uint32_t t : own) {
    far.moment += (centroid(t) - far.centre) * area_normal(t).transpose();
    for (int k = 0; k < 3; ++k) far.radius = std::max(far.radius, (corner(t, k) - far.centre).norm());
  }
}

void TriangleTree::fill_from_children(std::size_t at) {
  Node& node = nodes_[at];
  node.low = nodes_[at + 1].low.cwiseMin(nodes_[node.right].low);
  node.high = nodes_[at + 1].high.cwiseMax(nodes_[node.right].high);
  if (far_.empty()) return;
  Far& far = far_[at];
  const Far &a = far_[at + 1], &b = far_[node.right];
  far.normal = a.normal + b.normal;
  far.area = a.area + b.area;
  const double share = far.area > 0 ? a.area / far.area : 0.5;
  far.centre = share * a.centre + (1 - share) * b.centre;
  far.moment = a.moment + b.moment + (a.centre - far.centre) * a.normal.transpose() +
               (b.centre - far.centre) * b.normal.transpose();
  const Eigen::Vector3d farthest = (far.centre - node.low).cwiseMax(node.high - far.centre);
  const double of_balls =
      std::max((a.centre - far.centre).norm() + a.radius, (b.centre - far.centre).norm() + b.radius);
  far.radius = std::min(farthest.norm(), of_balls);
}

double TriangleTree::winding_number(const Eigen::Vector3d& point) const {
  if (nodes_.empty()) return 0;
  double sum = 0;
  std::uint32_t stack[64];
  int height = 0;
  stack[height++] = 0;
  while (height > 0) {
    const std::uint32_t at = stack[--height];
    const Node& node = nodes_[at];
    const Far& far = far_[at];
    const Eigen::Vector3d r = far.centre - point;
    const double squared = r.squaredNorm();
    if (squared > kBeta * kBeta * far.radius * far.radius) {
      const double distance = std::sqrt(squared), cubed = squared * distance;
      sum += (r.dot(far.normal) + far.moment.trace() - 3 * r.dot(far.moment * r) / squared) /
             (4 * std::numbers::pi * cubed);
    } else if (node.right != 0) {
      stack[height++] = node.right;
      stack[height++] = at + 1;
    } else {
      for (std::uint32_t i = node.begin; i < node.end; ++i) {
        const std::uint32_t t = order_[i];
        sum += solid_angle(corner(t, 0) - point, corner(t, 1) - point, corner(t, 2) - point);
      }
    }
  }
  return sum;
}

SurfacePoint TriangleTree::closest(const Eigen::Vector3d& point, double within) const {
  SurfacePoint best;
  best.squared_distance = within;
  if (nodes_.empty()) return best;
  const auto distance_to = [&](const Node& node) {
    return (point - point.cwiseMax(node.low).cwiseMin(node.high)).squaredNorm();
  };
  std::uint32_t stack[64];
  int height = 0;
  stack[height++] = 0;
  while (height > 0) {
    const std::uint32_t at = stack[--height];
    const Node& node = nodes_[at];
    if (distance_to(node) >= best.squared_distance) continue;
    if (node.right == 0) {
      for (std::uint32_t i = node.begin; i < node.end; ++i) {
        const std::uint32_t t = order_[i];
        const Eigen::Vector3d a = corner(t, 0) - point, b = corner(t, 1) - point, c = corner(t, 2) - point;
        const Eigen::Vector3d shares = closest_shares(a, b, c);
        const double squared = (shares[0] * a + shares[1] * b + shares[2] * c).squaredNorm();
        if (squared < best.squared_distance) best = {t, squared, shares};
      }
      continue;
    }
    const bool left_first = distance_to(nodes_[at + 1]) <= distance_to(nodes_[node.right]);
    stack[height++] = left_first ? node.right : at + 1;
    stack[height++] = left_first ? at + 1 : node.right;
  }
  return best;
}

void TriangleTree::in_box(const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                          std::vector<std::uint32_t>& found) const {
  if (nodes_.empty()) return;
  const auto meets = [&](const Eigen::Vector3d& least, const Eigen::Vector3d& most) {
    return (least.array() <= high.array()).all() && (most.array() >= low.array()).all();
  };
  std::uint32_t stack[64];
  int height = 0;
  stack[height++] = 0;
  while (height > 0) {
    const std::uint32_t at = stack[--height];
    const Node& node = nodes_[at];
    if (!meets(node.low, node.high)) continue;
    if (node.right != 0) {
      stack[height++] = node.right;
      stack[height++] = at + 1;
      continue;
    }
    for (std::uint32_t i = node.begin; i < node.end; ++i) {
      const Eigen::Vector3d a = corner(order_[i], 0), b = corner(order_[i], 1), c = corner(order_[i], 2);
      if (meets(a.cwiseMin(b).cwiseMin(c), a.cwiseMax(b).cwiseMax(c))) found.push_back(order_[i]);
    }
  }
}

}  // namespace sinew
