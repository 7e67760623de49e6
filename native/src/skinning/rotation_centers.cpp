#include "sinew/rotation_centers.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/check.h"
#include "base/parallel.h"
#include "mesh/faces.h"
#include "skinning/similar_triangles.h"
#include "skinning/tile.h"

namespace sinew {
namespace {

constexpr std::size_t kVerticesPerTask = 64;
// In steps of Progress; a triangle is one step.
constexpr std::int64_t kStepsAVertex = 8;

}  // namespace

RotationCenters::RotationCenters(std::span<const float> centers, std::span<const std::uint8_t> has_center)
    : vertex_count_(std::ssize(has_center)) {
  if (centers.size() != 3 * has_center.size()) {
    fail("centers has ", plural(std::ssize(centers), "number"), "; expected ", grouped(3 * vertex_count_),
         ", three a vertex of has_center");
  }
  const std::size_t blocks = (has_center.size() + kBlock - 1) / kBlock;
  centers_.assign(blocks * kBlockFloats, std::numeric_limits<float>::quiet_NaN());
  block_has_centers_.assign(blocks, false);
  for (std::size_t v = 0; v < has_center.size(); ++v) {
    if (!has_center[v]) continue;
    for (std::size_t i = 3 * v; i < 3 * v + 3; ++i) {
      if (!std::isfinite(centers[i]))
        fail("the center of vertex ", grouped(static_cast<long long>(v)), " is not finite");
      centers_[i] = centers[i];
    }
    block_has_centers_[v / kBlock] = true;
    ++count_;
  }
}

std::shared_ptr<const RotationCenters> RotationCenters::compute(const Skin& skin,
                                                                std::span<const std::int32_t> face_offsets,
                                                                std::span<const std::int32_t> face_vertices,
                                                                double sigma, Progress* progress) {
  check_faces({face_offsets, face_vertices}, skin.vertex_count());
  if (!(sigma > 0 && std::isfinite(sigma))) fail("sigma is ", sigma, "; expected a number above 0");
  Progress unwatched;
  if (!progress) progress = &unwatched;
  const auto vertices = static_cast<std::size_t>(skin.vertex_count());
  const std::int64_t faces = std::max<std::int64_t>(0, std::ssize(face_offsets) - 1);
  progress->start(std::ssize(face_vertices) - 2 * faces + kStepsAVertex * skin.vertex_count());
  const WeightTable influences = merged_influences(skin);
  const SimilarTriangles similar(skin, influences, face_offsets, face_vertices, sigma, *progress);
  std::vector<float> centers(3 * vertices);
  std::vector<std::uint8_t> has_center(vertices);
  parallel_for(vertices, kVerticesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      if (progress->is_cancelled()) return;
      progress->advance(kStepsAVertex);
      const auto center = similar.center_of(influences.row(v));
      has_center[v] = center[0] == center[0];
      std::ranges::copy(center, centers.begin() + static_cast<std::ptrdiff_t>(3 * v));
    }
  });
  if (progress->is_cancelled()) return nullptr;
  return std::make_shared<const RotationCenters>(centers, has_center);
}

}  // namespace sinew
