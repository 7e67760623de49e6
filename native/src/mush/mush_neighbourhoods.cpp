#include "mush/mush_neighbourhoods.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sinew {
namespace {

// A smoothed field fades out with the distance; below this it is cut off.
constexpr double kFaded = 1e-9;

Eigen::Vector3d point_of(const Skin& skin, std::size_t v) {
  return Eigen::Map<const Eigen::Vector3f>(skin.rest_positions().data() + 3 * v).cast<double>();
}

}  // namespace

Moments Moments::moved_to(const Eigen::Vector3d& about) const {
  const Eigen::Matrix3d mixed = first * about.transpose();
  return {second - mixed - mixed.transpose() + weight * about * about.transpose(), first - weight * about, weight,
          smoothed_weight};
}

Moments MushNeighbourhoods::Smoothed::at(std::size_t i) const {
  const double* f = fields + i * kFields;
  Moments moments;
  moments.second << f[0], f[1], f[2], f[1], f[3], f[4], f[2], f[4], f[5];
  moments.first << f[6], f[7], f[8];
  moments.weight = f[9];
  moments.smoothed_weight = f[kFirstWeightField];
  return moments;
}

MushNeighbourhoods::MushNeighbourhoods(const Skin& skin, const Laplacian& laplacian, const MushSettings& settings)
    : skin_(skin),
      laplacian_(laplacian),
      shape_(smoothing_polynomial(settings.smoothing, settings.iterations, laplacian.largest)),
      weights_(smoothing_polynomial(settings.weight_smoothing, settings.iterations, laplacian.largest)) {
  // Smoothing is a random walk of this many steps; it reaches a few times the square root of their number.
  const double steps = std::max(settings.smoothing, settings.weight_smoothing) * settings.iterations;
  rings_ = static_cast<std::size_t>(8 + 5 * std::sqrt(steps));
}

/// Collects the vertices of the field and `rings` rings of neighbours. Returns false if there are no more beyond.
bool MushNeighbourhoods::grow(Space& space, const WeightField& field, std::size_t rings) const {
  auto& found = space.vertices;
  found = field.vertices;
  for (const std::uint32_t v : found) space.number_of[v] = 0;
  std::size_t first = 0, outermost = 0;
  for (std::size_t ring = 0; ring < rings; ++ring) {
    const std::size_t end = found.size();
    if (ring * 4 >= rings * 3 && outermost == 0) outermost = end;
    for (std::size_t i = first; i < end; ++i) {
      for (std::uint32_t at = laplacian_.begin[found[i]]; at < laplacian_.begin[found[i] + 1]; ++at) {
        const std::uint32_t v = laplacian_.columns[at];
        if (space.number_of[v] >= 0) continue;
        space.number_of[v] = 0;
        found.push_back(v);
      }
    }
    first = end;
  }
  const bool more = first < found.size();
  space.outermost.assign(found.begin() + static_cast<std::ptrdiff_t>(outermost), found.end());
  std::ranges::sort(found);
  for (std::size_t i = 0; i < found.size(); ++i) space.number_of[found[i]] = static_cast<std::int32_t>(i);
  return more;
}

Eigen::Vector3d MushNeighbourhoods::fill(Space& space, const WeightField& field) const {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  for (const std::uint32_t v : field.vertices) origin += point_of(skin_, v);
  origin /= static_cast<double>(std::max<std::size_t>(field.vertices.size(), 1));
  space.panels.fields.assign(space.vertices.size() * kFields, 0);
  for (std::size_t i = 0; i < field.vertices.size(); ++i) {
    const Eigen::Vector3d x = point_of(skin_, field.vertices[i]) - origin;
    const double w = field.weights[i];
    const double own[kFields] = {w * x[0] * x[0],
                                 w * x[0] * x[1],
                                 w * x[0] * x[2],
                                 w * x[1] * x[1],
                                 w * x[1] * x[2],
                                 w * x[2] * x[2],
                                 w * x[0],
                                 w * x[1],
                                 w * x[2],
                                 w,
                                 w,
                                 0};
    std::copy_n(own, kFields, &space.panels.fields[std::size_t(space.number_of[field.vertices[i]]) * kFields]);
  }
  return origin;
}

MushNeighbourhoods::Smoothed MushNeighbourhoods::smooth_in(Space& space, const WeightField& field,
                                                           Progress* progress) const {
  const auto forget = [&] {
    for (const std::uint32_t v : space.vertices) space.number_of[v] = -1;
  };
  const auto is_faded = [&](std::uint32_t v) {
    const double* own = &space.panels.now[std::size_t(space.number_of[v]) * kFields];
    return std::abs(own[9]) < kFaded && std::abs(own[kFirstWeightField]) < kFaded;
  };
  std::int64_t steps = std::ssize(field.vertices);
  for (std::size_t rings = rings_;; rings *= 2) {
    const bool more = grow(space, field, rings);
    const Eigen::Vector3d origin = fill(space, field);
    space.rows.assign(laplacian_, space.vertices, space.number_of);
    try {
      smooth_fields(space.rows, shape_, weights_, space.panels, progress, std::exchange(steps, 0));
    } catch (...) {
      forget();
      throw;
    }
    const bool done = !more || std::ranges::all_of(space.outermost, is_faded);
    forget();
    if (done) return {space.vertices, origin, space.panels.now.data()};
  }
}

}  // namespace sinew
