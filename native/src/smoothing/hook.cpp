#include "sinew/hook.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/parallel.h"
#include "base/vertex_numbers.h"

// CMakeLists.txt has this file compiled without fused multiply-adds: Blender rounds in between.

namespace sinew {
namespace {

// The approximate cost of a vertex on one thread.
constexpr double kMicrosecondsToHook = 6e-3;

constexpr std::size_t kHookPiece = 4096;

/// Returns m * p, summed in Blender's order.
Eigen::Vector3f times(const Eigen::Ref<const Eigen::Matrix3f>& m, const float* p) {
  Eigen::Vector3f result;
  for (int row = 0; row < 3; ++row) {
    result[row] = m(row, 0) * p[0] + m(row, 1) * p[1] + m(row, 2) * p[2];
  }
  return result;
}

float fallen(Falloff falloff, float radius, float squared_distance) {
  const float squared_radius = radius * radius;
  if (squared_distance > squared_radius) return 0;
  if (!(squared_distance > 0) || falloff == Falloff::constant) return 1;
  if (falloff == Falloff::inverse_square) return 1 - squared_distance / squared_radius;
  const float f = 1 - std::sqrt(squared_distance) / radius;
  switch (falloff) {
    case Falloff::smooth:
      return 3 * f * f - 2 * f * f * f;
    case Falloff::sharp:
      return f * f;
    case Falloff::root:
      return std::sqrt(f);
    case Falloff::sphere:
      return std::sqrt(2 * f - f * f);
    default:
      return f;
  }
}

/// A hook's settings, prepared for use on each vertex.
struct Pull {
  explicit Pull(const Hook::Settings& own)
      : settings(own),
        radius(own.falloff == Falloff::none ? 0 : own.radius),
        center(own.uniform ? times(*own.uniform, own.center.data()) : own.center) {}

  void move(float weight, float* p) const {
    float part = settings.strength;
    if (radius * radius != 0) part *= fallen(settings.falloff, radius, squared_distance(p));
    part *= weight;
    if (part == 0) return;
    const auto& m = settings.matrix;
    float moved[3];
    for (int row = 0; row < 3; ++row) {
      moved[row] = p[0] * m(row, 0) + p[1] * m(row, 1) + m(row, 2) * p[2] + m(row, 3);
    }
    for (int axis = 0; axis < 3; ++axis) p[axis] = (1 - part) * p[axis] + part * moved[axis];
  }

 private:
  float squared_distance(const float* p) const {
    const Eigen::Vector3f there = settings.uniform ? times(*settings.uniform, p) : Eigen::Vector3f(p[0], p[1], p[2]);
    const Eigen::Vector3f way = there - center;
    return way.x() * way.x() + way.y() * way.y() + way.z() * way.z();
  }

  const Hook::Settings& settings;
  float radius;
  Eigen::Vector3f center;
};

}  // namespace

Hook::Hook(std::ptrdiff_t vertex_count, std::optional<std::span<const std::int32_t>> vertices, const VertexGroup& group)
    : vertex_count_(vertex_count) {
  check_vertex_count(vertex_count);
  const std::vector<float> weights = weights_of(group, vertex_count);
  std::vector<std::int32_t> hooked;
  if (vertices) {
    hooked.assign(vertices->begin(), vertices->end());
  } else if (group.weights) {
    hooked.resize(static_cast<std::size_t>(vertex_count));
    std::iota(hooked.begin(), hooked.end(), 0);
  }
  std::vector<bool> is_named(static_cast<std::size_t>(vertex_count));
  for (const std::int32_t v : hooked) {
    if (v < 0 || v >= vertex_count) {
      fail("vertices names vertex ", v, "; the mesh has ", plural(vertex_count, "vertex"));
    }
    if (weights[v] == 0) continue;
    names_twice_ |= is_named[v];
    is_named[v] = true;
    vertices_.push_back(static_cast<std::uint32_t>(v));
    weights_.push_back(weights[v]);
  }
}

void Hook::check(const Settings& settings) const {
  check_setting("strength", settings.strength);
  check_setting("radius", settings.radius);
  if (!settings.matrix.allFinite()) fail("matrix is not finite");
  if (!settings.center.allFinite()) fail("center is not finite");
  if (settings.uniform && !settings.uniform->allFinite()) fail("uniform is not finite");
}

double Hook::microseconds(const Settings& settings) const {
  return settings.strength == 0 ? 0 : kMicrosecondsToHook * static_cast<double>(vertices_.size());
}

void Hook::apply(const Settings& settings, std::span<float> positions) const {
  check_position_count("positions", positions, vertex_count());
  check(settings);
  if (settings.strength == 0) return;
  const Pull pull(settings);
  const bool threads = !names_twice_ && threads_pay(microseconds(settings));
  parallel_for(vertices_.size(), threads ? kHookPiece : vertices_.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      pull.move(weights_[i], positions.data() + 3 * std::size_t{vertices_[i]});
    }
  });
}

}  // namespace sinew
