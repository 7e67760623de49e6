#include "skinning/rotation_center_skinning.h"

#include <limits>

#include "base/per_thread.h"
#include "skinning/dual_quaternion_skinning.h"
#include "skinning/linear_skinning.h"
#include "skinning/method_data_kernels.h"
#include "skinning/sum_rotations.h"

namespace sinew {
namespace {

using Point = Eigen::Vector3f;

/// R S (v - p) + sum_j w_j M(j) p, S the blended stretch; with a single joint this is M(j) v.
Point move_about(const Point& center, const Influences& influences, const Palette& palette, const Point& rest) {
  Point moved;
  linear_vertex(influences, center.data(), palette.matrices.data(), moved.data());
  const Point arm = rest - center;
  const Eigen::Vector4f direction(arm.x(), arm.y(), arm.z(), 0);
  Point stretched = Point::Zero();
  float weight_sum = 0;
  const Eigen::Vector4f real = sum_rotations(influences, palette, [&](std::int32_t j, float weight, float) {
    weight_sum += weight;
    if (palette.is_stretched[j]) stretched += weight * palette.displacement(j, direction);
  });
  const Point d = weight_sum != 0 ? Point(arm + stretched / weight_sum) : arm;
  const float norm2 = real.squaredNorm();
  if (norm2 < std::numeric_limits<float>::min()) return moved + d;
  const Point r = real.tail<3>();
  return moved + d + 2 / norm2 * r.cross(Point(r.cross(d) + real[0] * d));
}

/// Returns the center in the space in which the matrices move points.
Point center_of(const float* center, const Palette& palette) {
  const Point point = Eigen::Map<const Point>(center);
  if (!palette.from_mesh) return point;
  return (palette.from_mesh->topRows<3>() * point.cast<double>().homogeneous()).cast<float>();
}

/// A thread's memory for the centers of a tile.
struct MovedCenters {
  float points[3 * kTile];
};

/// Returns the centers of a tile, in the space in which the matrices move points.
const float* centers_of(const RotationCenters& data, const Palette& palette, const Tile& tile) {
  const float* const centers = data.centers().data() + tile.begin * kBlockFloats;
  if (!palette.from_mesh) return centers;
  auto& moved = per_thread<MovedCenters>();
  for (std::size_t i = 0; i < (tile.end - tile.begin) * kBlockFloats; i += 3) {
    Eigen::Map<Point>(moved.points + i) = center_of(centers + i, palette);
  }
  return moved.points;
}

enum class CenterWay { linear, kernel, one_by_one };

}  // namespace

void run_rotation_centers(const BlockedSkin& skin, const Palette& palette, const Tile& tile) {
  const auto& data = static_cast<const RotationCenters&>(*tile.data);
  const float* const centers = centers_of(data, palette, tile);
  const auto way_of = [&](std::size_t b) {
    const JointSet set = skin.sets[skin.blocks[b].joint_set];
    if (!data.block_has_centers(b) || set.is_rigid) return CenterWay::linear;
    return palette.ways[skin.blocks[b].joint_set] == SetWay::one_by_one ? CenterWay::one_by_one : CenterWay::kernel;
  };
  for_runs(tile, way_of, [&](CenterWay way, const Tile& part) {
    const float* const own = centers + (part.begin - tile.begin) * kBlockFloats;
    if (way == CenterWay::kernel) {
      rotation_center_blocks(skin, part, palette.matrices.data(), palette.quaternion_joints(), own);
      return;
    }
    run_linear(skin, palette, part);
    if (way == CenterWay::linear) return;
    const std::size_t first = part.begin * kBlock;
    for (std::size_t v = first; v < skin.vertex_after(part.end); ++v) {
      const std::size_t at = 3 * (v - first);
      if (!data.has_center(v)) continue;
      Eigen::Map<Point>(part.positions + at) = move_about(Eigen::Map<const Point>(own + at), skin.influences_of(v),
                                                          palette, Eigen::Map<const Point>(part.rest + at));
    }
  });
}

void rotation_center_vertex(std::size_t v, const Influences& influences, const RotationCenters& centers,
                            const Palette& palette, const float* rest, float* out) {
  if (!centers.has_center(v)) return linear_vertex(influences, rest, palette.matrices.data(), out);
  Eigen::Map<Point>{out} = move_about(center_of(centers.centers().data() + 3 * v, palette), influences, palette,
                                      Eigen::Map<const Point>(rest));
}

}  // namespace sinew
