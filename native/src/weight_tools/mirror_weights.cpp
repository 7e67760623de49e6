#include <algorithm>

#include "base/parallel.h"
#include "sinew/weight_tools.h"
#include "weight_tools/check_tables.h"
#include "weight_tools/weighted_surface.h"

namespace sinew {
namespace {

void check_pairs(std::span<const std::int32_t> pairs, std::ptrdiff_t bones) {
  if (std::ssize(pairs) != bones) {
    fail("pairs has ", plural(std::ssize(pairs), "number"), ", weights ", plural(bones, "column"));
  }
  for (std::ptrdiff_t j = 0; j < bones; ++j) {
    if (pairs[j] < 0 || pairs[j] >= bones) {
      fail("bone ", j, " has the pair ", pairs[j], "; expected 0 to ", bones - 1);
    }
    if (pairs[pairs[j]] != j) {
      fail("bone ", j, " has the pair ", pairs[j], ", which has the pair ", pairs[pairs[j]], "; expected ", j);
    }
  }
}

}  // namespace

std::vector<float> mirror_weights(const WeightTable& weights, std::span<const float> positions, const Faces& faces,
                                  std::span<const std::int32_t> pairs, const MirrorSettings& settings) {
  check_table("weights", weights);
  check_positions("positions", positions, weights.vertices);
  check_faces(faces, weights.vertices);
  check_pairs(pairs, weights.bones);
  check_mask(settings.mask, weights.vertices);
  check_range("axis", settings.axis, 0, 2);
  if (!std::isfinite(settings.origin)) fail("origin is ", settings.origin, "; expected a finite number");
  check_range("middle", settings.middle, 0, 1);

  const std::vector<double> exact(positions.begin(), positions.end());
  std::vector<float> made(weights.numbers.begin(), weights.numbers.end());
  if (exact.empty()) return made;
  const UnitFrame frame(exact);
  const double middle = settings.middle * frame.size(), sign = settings.from_positive ? 1 : -1;
  /// How far a vertex is on the side that is copied.
  const auto side = [&](std::size_t v) { return sign * (exact[3 * v + settings.axis] - settings.origin); };
  std::vector<Triangle> triangles = triangles_of(faces);
  std::erase_if(triangles, [&](const Triangle& own) {
    return std::all_of(own.begin(), own.end(), [&](std::uint32_t v) { return side(v) < -middle; });
  });
  bool is_written = false;
  for (std::size_t v = 0; v < exact.size() / 3; ++v) {
    is_written |= side(v) < -middle && (settings.mask.empty() || settings.mask[v] >= 0.5f);
  }
  if (is_written && triangles.empty()) {
    fail("there are no faces on the ", settings.from_positive ? "positive" : "negative",
         " side of the mirror; expected the surface to copy from there");
  }
  // With no vertex to write on the other side, any triangle will do.
  if (triangles.empty()) triangles.push_back({0, 0, 0});
  const WeightedSurface surface(points_in(frame, exact), std::move(triangles), weights);
  parallel_for(exact.size() / 3, 128, [&](std::size_t begin, std::size_t end) {
    std::vector<float> row(static_cast<std::size_t>(weights.bones));
    for (std::size_t v = begin; v < end; ++v) {
      if (side(v) > middle || (!settings.mask.empty() && settings.mask[v] < 0.5f)) continue;
      float* const own = made.data() + static_cast<std::ptrdiff_t>(v) * weights.bones;
      if (side(v) >= -middle) {
        const float* const before = weights.row(static_cast<std::ptrdiff_t>(v));
        for (std::ptrdiff_t j = 0; j < weights.bones; ++j) own[j] = 0.5f * (before[j] + before[pairs[j]]);
        continue;
      }
      double place[3];
      std::copy_n(exact.data() + 3 * v, 3, place);
      place[settings.axis] = 2 * settings.origin - place[settings.axis];
      surface.read(surface.tree().closest(frame(place)), row.data());
      for (std::ptrdiff_t j = 0; j < weights.bones; ++j) own[pairs[j]] = row[j];
    }
  });
  return made;
}

}  // namespace sinew
