#include "sinew/surface_deform.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/offsets.h"
#include "base/parallel.h"
#include "base/vertex_numbers.h"

// CMakeLists.txt has this file compiled without fused multiply-adds: Blender rounds in between.

namespace sinew {
namespace {

// The approximate costs on one thread: of a term, and of a corner of a normal.
constexpr double kMicrosecondsPerTerm = 1.5e-3, kMicrosecondsPerCorner = 3e-3;

constexpr std::size_t kPiece = 1024;

using Four = Eigen::Array4f;

}  // namespace

SurfaceDeform::SurfaceDeform(std::ptrdiff_t vertex_count, const Binding& binding, const VertexGroup& group)
    : vertex_count_(vertex_count) {
  check_vertex_count(vertex_count);
  const std::vector<float> weights = weights_of(group, vertex_count);
  const std::ptrdiff_t count = std::ssize(binding.attachments);
  check_offsets("offsets", binding.offsets, count, "attachments", std::ssize(binding.vertices), "vertices");
  check_offsets("corner_offsets", binding.corner_offsets, std::ssize(binding.corners), "corners", count, "attachments");
  check_vertex_numbers("distances", binding.distances, count, "the binding");
  check_vertex_numbers("influences", binding.influences, count, "the binding");
  check_vertex_numbers("weights", binding.weights, std::ssize(binding.weights), "the binding");
  for (const std::int32_t corner : binding.corners) {
    if (corner < 0) fail("corners names vertex ", corner, " of the target");
    least_target_count_ = std::max(least_target_count_, std::ptrdiff_t{corner} + 1);
  }
  std::vector<std::ptrdiff_t> first_weight(count + 1);
  for (std::ptrdiff_t n = 0; n < count; ++n) {
    const std::int32_t kind = binding.attachments[n], size = binding.corner_offsets[n + 1] - binding.corner_offsets[n];
    if (kind < 0 || kind > 2) fail("attachments holds ", kind, "; expected 0, 1 or 2");
    if (size < 3) fail("attachment ", n, " is to a face with ", plural(size, "corner"));
    first_weight[n + 1] = first_weight[n] + (static_cast<Attachment>(kind) == Attachment::polygon ? size : 3);
  }
  if (first_weight[count] != std::ssize(binding.weights)) {
    fail("weights has ", plural(std::ssize(binding.weights), "number"), "; the attachments have ", first_weight[count]);
  }
  // A face is numbered once for each order in which its corners are listed, because its normal is rounded differently.
  std::map<std::vector<std::int32_t>, std::uint32_t> faces;
  std::map<std::uint32_t, double> points, normals;
  first_.push_back(0);
  first_corner_.push_back(0);
  for (std::ptrdiff_t b = 0; b < std::ssize(binding.vertices); ++b) {
    const std::int32_t v = binding.vertices[b];
    if (v < 0 || v >= vertex_count)
      fail("vertices names vertex ", v, "; the mesh has ", plural(vertex_count, "vertex"));
    if (weights[v] == 0) continue;
    points.clear();
    normals.clear();
    for (std::int32_t n = binding.offsets[b]; n < binding.offsets[b + 1]; ++n) {
      const auto corners =
          binding.corners.subspan(binding.corner_offsets[n], binding.corner_offsets[n + 1] - binding.corner_offsets[n]);
      const float* const own = binding.weights.data() + first_weight[n];
      const double influence = binding.influences[n];
      const auto kind = static_cast<Attachment>(binding.attachments[n]);
      const std::size_t listed = kind == Attachment::polygon ? corners.size() : kind == Attachment::centroid ? 2 : 3;
      for (std::size_t k = 0; k < listed; ++k) points[corners[k]] += influence * own[k];
      for (std::size_t k = 0; kind == Attachment::centroid && k < corners.size(); ++k) {
        points[corners[k]] += influence * own[2] / static_cast<double>(corners.size());
      }
      const auto [face, is_new] = faces.try_emplace({corners.begin(), corners.end()}, faces.size());
      if (is_new) {
        corners_.insert(corners_.end(), corners.begin(), corners.end());
        first_corner_.push_back(corners_.size());
      }
      normals[face->second] += influence * binding.distances[n];
    }
    vertices_.push_back(static_cast<std::uint32_t>(v));
    weights_.push_back(weights[v]);
    points_.push_back(static_cast<std::uint32_t>(points.size()));
    for (const auto& sums : {points, normals}) {
      for (const auto& [index, weight] : sums) terms_.push_back({index, static_cast<float>(weight)});
    }
    first_.push_back(terms_.size());
  }
}

std::shared_ptr<const SurfaceDeform::Shape> SurfaceDeform::shape_of(std::span<const float> target,
                                                                    const Matrix4<float>& mesh_from_target) const {
  const std::ptrdiff_t count = std::ssize(target) / 3;
  check_position_count("target", target, count);
  if (count < least_target_count_) {
    fail("the target has ", plural(count, "vertex"), "; the mesh was bound to ", least_target_count_);
  }
  auto shape = std::make_shared<Shape>();
  shape->points.resize(4 * static_cast<std::size_t>(count));
  const auto& m = mesh_from_target;
  for (std::ptrdiff_t t = 0; t < count; ++t) {
    const float* const p = target.data() + 3 * t;
    for (int row = 0; row < 3; ++row) {
      shape->points[4 * t + row] = p[0] * m(row, 0) + p[1] * m(row, 1) + m(row, 2) * p[2] + m(row, 3);
    }
  }
  const std::size_t faces = first_corner_.size() - 1;
  shape->normals.resize(4 * faces);
  const bool threads = threads_pay(kMicrosecondsPerCorner * static_cast<double>(corners_.size()));
  parallel_for(faces, threads ? kPiece : faces, [&](std::size_t begin, std::size_t end) {
    const auto point = [&](std::size_t corner) { return shape->points.data() + 4 * std::size_t{corners_[corner]}; };
    for (std::size_t f = begin; f < end; ++f) {
      Eigen::Vector3f normal(0, 0, 0);  // Newell's
      const float* before = point(first_corner_[f + 1] - 1);
      for (std::size_t c = first_corner_[f]; c < first_corner_[f + 1]; ++c) {
        const float* const own = point(c);
        for (int axis = 0; axis < 3; ++axis) {
          const int next = (axis + 1) % 3, last = (axis + 2) % 3;
          normal[axis] += (before[next] - own[next]) * (before[last] + own[last]);
        }
        before = own;
      }
      const float squared = normal.x() * normal.x() + normal.y() * normal.y() + normal.z() * normal.z();
      const float scale = squared > 1e-35f ? 1 / std::sqrt(squared) : 0;
      for (int axis = 0; axis < 3; ++axis) shape->normals[4 * f + axis] = normal[axis] * scale;
    }
  });
  return shape;
}

void SurfaceDeform::check(const Settings& settings) const {
  check_setting("strength", settings.strength);
  if (!settings.shape) fail("the target has no shape");
  if (std::ssize(settings.shape->points) < 4 * least_target_count_ ||
      settings.shape->normals.size() != 4 * (first_corner_.size() - 1)) {
    fail("the shape is not one of this object's");
  }
}

double SurfaceDeform::microseconds(const Settings& settings) const {
  return settings.strength == 0 ? 0 : kMicrosecondsPerTerm * static_cast<double>(terms_.size());
}

void SurfaceDeform::apply(const Settings& settings, std::span<float> positions) const {
  check_position_count("positions", positions, vertex_count());
  check(settings);
  if (settings.strength == 0) return;
  const Shape& shape = *settings.shape;
  const bool threads = threads_pay(microseconds(settings));
  parallel_for(vertices_.size(), threads ? kPiece : vertices_.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Term* term = terms_.data() + first_[i];
      const Term* const middle = term + points_[i];
      const Term* const last = terms_.data() + first_[i + 1];
      Four place = Four::Zero(), offset = Four::Zero();
      for (; term != middle; ++term) {
        place += term->weight * Eigen::Map<const Four>(shape.points.data() + 4 * std::size_t{term->index});
      }
      for (; term != last; ++term) {
        offset += term->weight * Eigen::Map<const Four>(shape.normals.data() + 4 * std::size_t{term->index});
      }
      const float part = settings.strength * weights_[i];
      float* const point = positions.data() + 3 * std::size_t{vertices_[i]};
      for (int axis = 0; axis < 3; ++axis) point[axis] += (place[axis] + offset[axis] - point[axis]) * part;
    }
  });
}

}  // namespace sinew
