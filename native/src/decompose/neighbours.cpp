#include "decompose/neighbours.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/cancelled.h"
#include "base/disjoint_sets.h"
#include "base/parallel.h"
#include "mesh/adjacency.h"

namespace sinew {
namespace {

using Pair = std::pair<std::uint32_t, std::uint32_t>;
constexpr std::uint32_t kSeveral = 0xffffffff;

std::vector<std::uint32_t> roots_of(DisjointSets& parts, std::size_t count) {
  std::vector<std::uint32_t> roots(count);
  for (std::uint32_t i = 0; i < count; ++i) roots[i] = parts.root(i);
  return roots;
}

/// Finds the nearest point of another part.
class PointTree {
 public:
  explicit PointTree(std::span<const Eigen::Vector4d> points) : points_(points), order_(points.size()) {
    std::iota(order_.begin(), order_.end(), 0u);
    nodes_.reserve(points.size() / 4 + 2);
    build(0, static_cast<std::uint32_t>(points.size()));
  }

  void set_parts(std::vector<std::uint32_t> parts) {
    parts_ = std::move(parts);
    for (std::size_t n = nodes_.size(); n-- > 0;) {
      Node& node = nodes_[n];
      if (node.right) {
        const std::uint32_t left = nodes_[n + 1].part, right = nodes_[node.right].part;
        node.part = left == right ? left : kSeveral;
      } else {
        node.part = parts_[order_[node.begin]];
        for (std::uint32_t i = node.begin; i < node.end; ++i) {
          if (parts_[order_[i]] != node.part) node.part = kSeveral;
        }
      }
    }
  }
  const std::vector<std::uint32_t>& parts() const { return parts_; }

  /// Returns the nearest point of another part and the squared distance, or the point itself if none is within it.
  std::pair<std::uint32_t, double> nearest_foreign(std::uint32_t point, double within) const {
    std::pair<std::uint32_t, double> best(point, within);
    search(0, point, best);
    return best;
  }

 private:
  struct Node {
    Eigen::Array3d low, high;
    std::uint32_t begin, end, right = 0, part = kSeveral;
  };

  Eigen::Array3d place(std::uint32_t point) const { return points_[point].head<3>().array(); }

  void build(std::uint32_t begin, std::uint32_t end) {
    const std::size_t own = nodes_.size();
    Eigen::Array3d low = place(order_[begin]), high = low;
    for (std::uint32_t i = begin; i < end; ++i) {
      low = low.min(place(order_[i]));
      high = high.max(place(order_[i]));
    }
    nodes_.push_back({low, high, begin, end});
    if (end - begin <= 8) return;
    Eigen::Index axis;
    (high - low).maxCoeff(&axis);
    const std::uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](std::uint32_t a, std::uint32_t b) {
                       return std::pair(points_[a][axis], a) < std::pair(points_[b][axis], b);
                     });
    build(begin, middle);
    nodes_[own].right = static_cast<std::uint32_t>(nodes_.size());
    build(middle, end);
  }

  double distance_to(const Node& node, const Eigen::Array3d& from) const {
    return (node.low - from).max(from - node.high).max(0.0).square().sum();
  }

  void search(std::size_t n, std::uint32_t point, std::pair<std::uint32_t, double>& best) const {
    const Node& node = nodes_[n];
    if (node.part == parts_[point]) return;
    if (!node.right) {
      for (std::uint32_t i = node.begin; i < node.end; ++i) {
        const std::uint32_t other = order_[i];
        if (parts_[other] == parts_[point]) continue;
        const double distance = (place(other) - place(point)).square().sum();
        if (distance < best.second || (distance == best.second && (best.first == point || other < best.first))) {
          best = {other, distance};
        }
      }
      return;
    }
    std::size_t near = n + 1, far = node.right;
    double near_distance = distance_to(nodes_[near], place(point));
    double far_distance = distance_to(nodes_[far], place(point));
    if (far_distance < near_distance) std::swap(near, far), std::swap(near_distance, far_distance);
    if (near_distance <= best.second) search(near, point, best);
    if (far_distance <= best.second) search(far, point, best);
  }

  std::span<const Eigen::Vector4d> points_;
  std::vector<std::uint32_t> order_, parts_;
  std::vector<Node> nodes_;
};

std::vector<std::pair<std::uint32_t, double>> nearest_foreign(const PointTree& tree, double within,
                                                              const Progress* progress) {
  std::vector<std::pair<std::uint32_t, double>> nearest(tree.parts().size());
  parallel_for(nearest.size(), 512, [&](std::size_t begin, std::size_t end) {
    stop_if_cancelled(progress);
    for (std::size_t p = begin; p < end; ++p) nearest[p] = tree.nearest_foreign(static_cast<std::uint32_t>(p), within);
  });
  return nearest;
}

Pair sorted(std::uint32_t a, std::uint32_t b) { return {std::min(a, b), std::max(a, b)}; }

std::vector<Pair> edges_of_faces(const Clip& clip, std::span<const std::int32_t> offsets,
                                 std::span<const std::int32_t> vertices) {
  const auto joined = neighbours_by_sides({offsets, vertices}, clip.point_of, clip.rest.size());
  std::vector<Pair> edges;
  for (std::uint32_t a = 0; a < joined.size(); ++a) {
    for (const std::uint32_t b : joined[a]) {
      if (a < b) edges.emplace_back(a, b);
    }
  }
  return edges;
}

/// The root of the mean square change of the distance between two points.
double change_of_distance(const Clip& clip, const Pair& edge) {
  const float *a = clip.row(edge.first), *b = clip.row(edge.second);
  const double rest = (clip.rest[edge.first] - clip.rest[edge.second]).norm();
  double sum = 0;
  for (std::size_t i = 0; i < clip.numbers(); i += 3) {
    const Eigen::Vector3d between = (Eigen::Vector3f::Map(a + i) - Eigen::Vector3f::Map(b + i)).cast<double>();
    const double change = between.norm() - rest;
    sum += change * change;
  }
  return std::sqrt(sum / static_cast<double>(clip.frames));
}

}  // namespace

std::vector<Pair> ties_between_parts(std::span<const Eigen::Vector4d> points, std::span<const Pair> edges,
                                     const Progress* progress) {
  DisjointSets parts(points.size());
  double length = 0;
  for (const auto& [a, b] : edges) {
    parts.join(a, b);
    length += (points[a] - points[b]).norm();
  }
  std::vector<Pair> ties;
  PointTree tree(points);
  tree.set_parts(roots_of(parts, points.size()));
  const auto has_several = [&] {
    return std::any_of(tree.parts().begin(), tree.parts().end(), [](std::uint32_t part) { return part != 0; });
  };
  if (!has_several()) return ties;
  if (!edges.empty()) {
    const double near = 2 * length / static_cast<double>(edges.size());
    const auto nearest = nearest_foreign(tree, near * near, progress);
    for (std::uint32_t p = 0; p < nearest.size(); ++p) {
      if (nearest[p].first != p) ties.push_back(sorted(p, nearest[p].first));
    }
  }
  while (has_several()) {
    const auto nearest = nearest_foreign(tree, std::numeric_limits<double>::infinity(), progress);
    std::vector<std::uint32_t> best(points.size(), kSeveral);  // of each part: the point that is nearest to another
    for (std::uint32_t p = 0; p < nearest.size(); ++p) {
      std::uint32_t& own = best[tree.parts()[p]];
      if (own == kSeveral || nearest[p].second < nearest[own].second) own = p;
    }
    for (const std::uint32_t p : best) {
      if (p == kSeveral || parts.root(p) == parts.root(nearest[p].first)) continue;
      parts.join(p, nearest[p].first);
      ties.push_back(sorted(p, nearest[p].first));
    }
    tree.set_parts(roots_of(parts, points.size()));
  }
  return ties;
}

Neighbours neighbours_of(const Clip& clip, std::span<const std::int32_t> face_offsets,
                         std::span<const std::int32_t> face_vertices, const Progress* progress) {
  std::vector<Pair> edges = edges_of_faces(clip, face_offsets, face_vertices);
  const std::vector<Pair> ties = ties_between_parts(clip.rest, edges, progress);
  edges.insert(edges.end(), ties.begin(), ties.end());
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());

  std::vector<double> changes(edges.size());
  parallel_for(edges.size(), 256, [&](std::size_t begin, std::size_t end) {
    stop_if_cancelled(progress);
    for (std::size_t e = begin; e < end; ++e) changes[e] = change_of_distance(clip, edges[e]);
  });
  // So that edges that keep their length do not count for everything.
  const double mean = std::accumulate(changes.begin(), changes.end(), 0.0) / std::max<double>(1, changes.size());
  const double least = 0.1 * mean + 1e-6;

  Neighbours result(static_cast<std::size_t>(clip.point_count()), [&](const auto& add) {
    for (std::size_t e = 0; e < edges.size(); ++e) {
      const auto [a, b] = edges[e];
      const auto share = static_cast<float>(1 / (least + changes[e]));
      add(a, {b, share});
      add(b, {a, share});
    }
  });
  for (std::size_t p = 0; p < result.size(); ++p) {
    const auto own = std::span(result.items).subspan(result.begin[p], result[p].size());
    float sum = 0;
    for (const Neighbour& other : own) sum += other.share;
    for (Neighbour& other : own) other.share /= sum;
  }
  return result;
}

}  // namespace sinew
