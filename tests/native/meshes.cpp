#include "meshes.h"

namespace sinew::meshes {

Mesh sheet(rigs::Random& random, std::int32_t rows, std::int32_t columns) {
  std::vector<std::int32_t> names(rows * columns);
  std::iota(names.begin(), names.end(), 0);
  for (std::size_t i = names.size(); i > 1; --i) std::swap(names[i - 1], names[random() % i]);
  Mesh mesh;
  const auto at = [&](std::int32_t row, std::int32_t column) { return names[row * columns + column]; };
  for (std::int32_t r = 0; r + 1 < rows; ++r) {
    for (std::int32_t c = 0; c + 1 < columns; ++c) {
      const std::int32_t a = at(r, c), b = at(r, c + 1), d = at(r + 1, c + 1), e = at(r + 1, c);
      if (random() % 9 == 0) continue;  // a hole
      if (random() % 2 == 0) {
        mesh.add_face({a, b, d, e});
      } else {
        mesh.add_face({a, b, d});
        mesh.add_face({a, d, e});
      }
    }
  }
  mesh.vertices = rows * columns;
  const std::int32_t hub = mesh.vertices++, spokes = 40;
  for (std::int32_t k = 0; k < spokes; ++k) {
    mesh.add_face({hub, hub + 1 + k, hub + 1 + (k + 1) % spokes});
  }
  mesh.vertices += spokes;
  mesh.edges.insert(mesh.edges.end(), {hub, mesh.vertices, mesh.vertices, mesh.vertices + 1});
  mesh.vertices += 3;  // two of the wire and one alone
  return mesh;
}

Floats random_positions(rigs::Random& random, std::int32_t vertices) {
  Floats positions;
  for (std::int32_t i = 0; i < 3 * vertices; ++i) {
    positions.push_back(static_cast<float>(rigs::uniform(random, -1, 1)));
  }
  return positions;
}

Floats some_weights(rigs::Random& random, std::int32_t vertices) {
  Floats weights;
  for (std::int32_t v = 0; v < vertices; ++v) {
    weights.push_back(random() % 3 == 0 ? 0 : static_cast<float>(rigs::uniform(random, 0, 1)));
  }
  return weights;
}

Points points_of(const Floats& positions) {
  Points points;
  for (std::size_t i = 0; i < positions.size(); i += 3) {
    points.push_back(Eigen::Map<const Eigen::Vector3f>(&positions[i]).cast<double>());
  }
  return points;
}

double largest_difference(const Floats& positions, const Points& points) {
  double most = 0;
  for (std::size_t v = 0; v < points.size(); ++v) {
    const Eigen::Vector3d own = Eigen::Map<const Eigen::Vector3f>(&positions[3 * v]).cast<double>();
    most = std::max(most, (own - points[v]).cwiseAbs().maxCoeff());
  }
  return most;
}

Floats pinned(const Mesh& mesh, Floats weights) {
  for (std::size_t i = 0; i < mesh.edges.size(); i += 2) {
    int faces = 0;
    for (const auto& face : mesh.faces) {
      for (std::size_t k = 0; k < face.size(); ++k) {
        const auto a = face[k], b = face[(k + 1) % face.size()];
        faces += std::minmax(a, b) == std::minmax(mesh.edges[i], mesh.edges[i + 1]);
      }
    }
    if (faces == 1) weights[mesh.edges[i]] = weights[mesh.edges[i + 1]] = 0;
  }
  return weights;
}

Points smoothed(const Mesh& mesh, Points x, const Floats& weights, const CorrectiveSmooth::Settings& settings) {
  const bool simple = settings.type == SmoothType::simple;
  for (int k = 0; k < settings.iterations; ++k) {
    Points sums(x.size(), Eigen::Vector3d::Zero());
    std::vector<double> counts(x.size()), lengths(x.size());
    for (std::size_t i = 0; i < mesh.edges.size(); i += 2) {
      const std::int32_t a = mesh.edges[i], b = mesh.edges[i + 1];
      const Eigen::Vector3d side = x[b] - x[a];
      const double length = side.norm();
      sums[a] += simple ? side : Eigen::Vector3d(side * length);
      sums[b] -= simple ? side : Eigen::Vector3d(side * length);
      for (const std::int32_t end : {a, b}) {
        counts[end] += 1;
        lengths[end] += length;
      }
    }
    for (std::size_t v = 0; v < x.size(); ++v) {
      const double divisor = simple ? std::max(counts[v], 1.0) : lengths[v] * counts[v] / 2;
      if (divisor > 0) x[v] += sums[v] * settings.factor * weights[v] / divisor;
    }
  }
  return x;
}

Eigen::Vector3d direction(const Eigen::Vector3d& v) {
  return v.norm() > 0 ? Eigen::Vector3d(v.normalized()) : Eigen::Vector3d::Zero();
}

std::vector<Corner> corners(const Mesh& mesh, const Points& x) {
  std::vector<Corner> result;
  for (const auto& face : mesh.faces) {
    for (std::size_t k = 0; k < face.size(); ++k) {
      const auto before = face[(k + face.size() - 1) % face.size()];
      const Eigen::Vector3d in = direction(x[before] - x[face[k]]);
      const Eigen::Vector3d out = direction(x[face[k]] - x[face[(k + 1) % face.size()]]);
      Corner corner{face[k], Eigen::Matrix3d::Identity(), 0};
      if ((in - out).cwiseAbs().maxCoeff() > 1.2e-6) {
        const Eigen::Vector3d z = direction(in.cross(out)), across = direction(in + out);
        corner.frame << across, z.cross(across), z;
        corner.angle = std::acos(std::clamp(in.dot(out), -1.0, 1.0));
      }
      result.push_back(corner);
    }
  }
  return result;
}

Points corrected(const Mesh& mesh, const Points& rest, const Points& x, const Floats& weights,
                 const CorrectiveSmooth::Settings& settings) {
  const Points smooth_rest = smoothed(mesh, rest, weights, settings);
  const Points smooth = smoothed(mesh, x, weights, settings);
  const auto rest_corners = corners(mesh, smooth_rest), own_corners = corners(mesh, smooth);
  std::vector<double> angles(x.size());
  for (const Corner& corner : own_corners) angles[corner.vertex] += corner.angle;
  Points result = smooth;
  for (std::size_t c = 0; c < own_corners.size(); ++c) {
    const std::int32_t v = own_corners[c].vertex;
    if (!(own_corners[c].angle > 0)) continue;
    const Eigen::Matrix3d& frame = rest_corners[c].frame;
    const Eigen::Vector3d lost = rest[v] - smooth_rest[v];
    const Eigen::Vector3d loss =
        frame.determinant() != 0 ? Eigen::Vector3d(frame.inverse() * lost) : Eigen::Vector3d(frame.transpose() * lost);
    result[v] += own_corners[c].frame * loss * (own_corners[c].angle / angles[v] * settings.scale);
  }
  return result;
}

Points meant(const Mesh& mesh, Points x, const Floats& weights, const Smooth::Settings& settings) {
  const bool moves[] = {settings.x, settings.y, settings.z};
  for (int k = 0; k < settings.iterations; ++k) {
    Points sums(x.size(), Eigen::Vector3d::Zero());
    std::vector<double> counts(x.size());
    for (std::size_t i = 0; i < mesh.edges.size(); i += 2) {
      for (const std::int32_t end : {mesh.edges[i], mesh.edges[i + 1]}) {
        sums[end] += (x[mesh.edges[i]] + x[mesh.edges[i + 1]]) / 2;
        counts[end] += 1;
      }
    }
    for (std::size_t v = 0; v < x.size(); ++v) {
      if (weights[v] <= 0) continue;
      const double part = double{weights[v]} * settings.factor;
      const Eigen::Vector3d mean = sums[v] / std::max(counts[v], 1.0);
      for (int axis = 0; axis < 3; ++axis) {
        if (moves[axis]) x[v][axis] = (1 - part) * x[v][axis] + part * mean[axis];
      }
    }
  }
  return x;
}

}  // namespace sinew::meshes
