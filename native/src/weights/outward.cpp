#include "weights/outward.h"

#include <algorithm>

#include "base/parallel.h"
#include "sinew/lists.h"

namespace sinew {
namespace {

constexpr std::size_t kSamples = 32;  // of a patch, at most
constexpr double kBeside = 1e-5;      // the distance from the surface at which both sides are looked at
// The winding numbers on both sides of a closed surface have the mean 1/2, of a single sheet 0.
constexpr double kSure = 0.15;

}  // namespace

std::vector<std::uint8_t> turn_outward(WeldedMesh& mesh, const TriangleTree& tree, const Progress* progress,
                                       bool& has_changed) {
  const Lists<std::uint32_t> of_patch(mesh.patch_count(), [&](const auto& add) {
    for (std::uint32_t t = 0; t < mesh.patch_of.size(); ++t) add(mesh.patch_of[t], t);
  });

  std::vector<double> mean(mesh.patch_count(), 0.5);
  parallel_for(mesh.patch_count(), 16, [&](std::size_t first, std::size_t end) {
    stop_if_cancelled(progress);
    for (std::size_t patch = first; patch < end; ++patch) {
      if (mesh.is_closed[patch]) continue;
      const std::size_t count = of_patch[patch].size(), samples = std::min(count, kSamples);
      double sum = 0;
      for (std::size_t s = 0; s < samples; ++s) {
        const Triangle& triangle = mesh.triangles[of_patch[patch][s * count / samples]];
        const auto& [a, b, c] = triangle;
        const Eigen::Vector3d centre = (mesh.points[a] + mesh.points[b] + mesh.points[c]) / 3;
        const Eigen::Vector3d beside = kBeside * doubled_area(mesh.points, triangle).stableNormalized();
        sum += (tree.winding_number(centre + beside) + tree.winding_number(centre - beside)) / 2;
      }
      mean[patch] = sum / static_cast<double>(samples);
    }
  });
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (mean[mesh.patch_of[t]] > -kSure) continue;
    mesh.flip(t);
    has_changed = true;
  }
  std::vector<std::uint8_t> is_two_sided(mesh.patch_count());
  for (std::size_t patch = 0; patch < is_two_sided.size(); ++patch) {
    is_two_sided[patch] = mean[patch] > -kSure && mean[patch] < kSure;
  }
  return is_two_sided;
}

std::vector<Place> places_of(const WeldedMesh& mesh, const std::vector<std::uint8_t>& is_two_sided) {
  std::vector<Place> places(mesh.points.size());
  for (std::size_t p = 0; p < places.size(); ++p) places[p] = {mesh.points[p], Eigen::Vector3d::Zero(), false};
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d normal = doubled_area(mesh.points, mesh.triangles[t]);
    for (const std::uint32_t corner : mesh.triangles[t]) {
      places[corner].normal += normal;
      places[corner].is_two_sided |= is_two_sided[mesh.patch_of[t]] != 0;
    }
  }
  for (Place& place : places) {
    const double length = place.normal.stableNorm();
    if (length > 0) place.normal /= length;
  }
  return places;
}

}  // namespace sinew
