/// Meshes to smooth, and what smoothing makes of them: slow formulas in double, scattered edge by
/// edge and face by face.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "rigs.h"
#include "sinew/corrective_smooth.h"
#include "sinew/smooth.h"

namespace sinew::meshes {

using Floats = std::vector<float>;
using Points = std::vector<Eigen::Vector3d>;

struct Mesh {
  std::int32_t vertices = 0;
  std::vector<std::int32_t> edges;  // two each
  std::vector<std::vector<std::int32_t>> faces;

  /// With the edges around it that are not there yet.
  void add_face(const std::vector<std::int32_t>& corners) {
    faces.push_back(corners);
    for (std::size_t k = 0; k < corners.size(); ++k) {
      const auto side = std::minmax(corners[k], corners[(k + 1) % corners.size()]);
      if (!sides_.insert({side, 0}).second) continue;
      edges.insert(edges.end(), {corners[k], corners[(k + 1) % corners.size()]});
    }
  }

  std::shared_ptr<const Topology> topology() const {
    std::vector<std::int32_t> offsets{0}, corners;
    for (const auto& face : faces) {
      corners.insert(corners.end(), face.begin(), face.end());
      offsets.push_back(static_cast<std::int32_t>(corners.size()));
    }
    return std::make_shared<Topology>(vertices, edges, offsets, corners);
  }

 private:
  std::map<std::pair<std::int32_t, std::int32_t>, int> sides_;
};

/// A sheet of quads, triangles and pairs of triangles, its vertices numbered at random, with a fan
/// of many triangles, a wire, and a vertex that hangs on nothing.
Mesh sheet(rigs::Random& random, std::int32_t rows, std::int32_t columns);

Floats random_positions(rigs::Random& random, std::int32_t vertices);

/// 0 for some, otherwise anything up to 1.
Floats some_weights(rigs::Random& random, std::int32_t vertices);

Points points_of(const Floats& positions);

double largest_difference(const Floats& positions, const Points& points);

/// Weights of a mesh whose boundary is pinned: 0 on both ends of edges that one face has.
Floats pinned(const Mesh& mesh, Floats weights);

Points smoothed(const Mesh& mesh, Points x, const Floats& weights, const CorrectiveSmooth::Settings& settings);

struct Corner {
  std::int32_t vertex;
  Eigen::Matrix3d frame;
  double angle;
};

Eigen::Vector3d direction(const Eigen::Vector3d& v);

std::vector<Corner> corners(const Mesh& mesh, const Points& x);

/// settings' only_smooth is for the caller.
Points corrected(const Mesh& mesh, const Points& rest, const Points& x, const Floats& weights,
                 const CorrectiveSmooth::Settings& settings);

Points meant(const Mesh& mesh, Points x, const Floats& weights, const Smooth::Settings& settings);

}  // namespace sinew::meshes
