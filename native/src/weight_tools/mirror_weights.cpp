#include <algorithm>

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

std::optional<WeightTable> mirror_weights(const WeightTable& weights, std::span<const float> positions,
                                          const Faces& faces, std::span<const std::int32_t> pairs,
                                          const MirrorSettings& settings, Progress* progress) {
  const auto vertices = static_cast<std::size_t>(weights.vertices());
  check_positions("positions", positions, weights.vertices());
  check_faces(faces, weights.vertices());
  check_pairs(pairs, weights.bones());
  check_mask(settings.mask, weights.vertices());
  check_range("axis", settings.axis, 0, 2);
  if (!std::isfinite(settings.origin)) fail("origin is ", settings.origin, "; expected a finite number");
  check_range("middle", settings.middle, 0, 1);
  if (vertices == 0) return weights;

  const std::vector<double> exact(positions.begin(), positions.end());
  const UnitFrame frame(exact);
  const double middle = settings.middle * frame.size(), sign = settings.from_positive ? 1 : -1;
  /// How far a vertex is on the side that is copied.
  const auto side = [&](std::size_t v) { return sign * (exact[3 * v + settings.axis] - settings.origin); };
  const auto is_source = [&](std::uint32_t v) { return side(v) >= -middle; };
  const auto stays = [&](std::size_t v) {
    return side(v) > middle || (!settings.mask.empty() && settings.mask[v] < 0.5f);
  };
  std::vector<Triangle> triangles = triangles_of(faces);
  std::erase_if(triangles, [&](const Triangle& own) { return std::ranges::none_of(own, is_source); });
  bool is_written = false;
  for (std::uint32_t v = 0; v < vertices; ++v) is_written |= !is_source(v) && !stays(v);
  if (is_written && triangles.empty()) {
    fail("there are no faces on the ", settings.from_positive ? "positive" : "negative",
         " side of the mirror; expected the surface to copy from there");
  }
  // With no vertex to write on the other side, any triangle will do.
  if (triangles.empty()) triangles.push_back({0, 0, 0});

  const auto add_mirrored = [&](std::span<const BoneWeight> row, double factor, RowSum& sum) {
    for (const BoneWeight& own : row) sum.add(pairs[own.bone], factor * own.weight);
  };
  try {
    if (progress) progress->start(100);
    const auto bones = static_cast<std::size_t>(weights.bones());
    const WeightedSurface surface(points_in(frame, exact), std::move(triangles), weights, progress);
    return table_of_rows(vertices, weights.bones(), 128, progress, 100, [&](auto begin, auto end, auto& rows) {
      RowSum sum(bones);
      for (std::size_t v = begin; v < end; ++v) {
        if (stays(v)) {
          rows.add_row(weights.row(v));
          continue;
        }
        if (is_source(static_cast<std::uint32_t>(v))) {  // in the middle
          sum.add(weights.row(v), 0.5);
          add_mirrored(weights.row(v), 0.5, sum);
          rows.add_row(sum.take());
          continue;
        }
        double place[3];
        std::copy_n(exact.data() + 3 * v, 3, place);
        place[settings.axis] = 2 * settings.origin - place[settings.axis];
        const SurfacePoint hit = surface.tree().closest(frame(place));
        Eigen::Vector3d is_from, shares;
        for (int i = 0; i < 3; ++i) is_from[i] = is_source(surface.triangle(hit)[i]);
        shares = hit.shares.cwiseProduct(is_from);
        if (!(shares.sum() > 0)) shares = is_from;
        for (int i = 0; i < 3; ++i) {
          if (shares[i] > 0) add_mirrored(weights.row(surface.triangle(hit)[i]), shares[i] / shares.sum(), sum);
        }
        rows.add_row(sum.take());
      }
    });
  } catch (const Cancelled&) {
    return std::nullopt;
  }
}

}  // namespace sinew
