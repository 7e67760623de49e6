#include "deformer/posed_layer.h"

#include <algorithm>

#include "base/per_thread.h"
#include "deformer/method.h"
#include "skinning/dual_quaternion_skinning.h"
#include "skinning/kernels.h"

// CMakeLists.txt has this file compiled without fused multiply-adds, so that mixing gives the same
// result on every machine.

namespace sinew {
namespace {

/// Transforms 3 x vertices numbers. out may be in.
void transform(const Matrix4<double>& matrix, const float* in, std::size_t vertices, float* out) {
  const Eigen::Matrix3d linear = matrix.topLeftCorner<3, 3>();
  const Eigen::Vector3d offset = matrix.topRightCorner<3, 1>();
  for (std::size_t v = 0; v < vertices; ++v) {
    const Eigen::Vector3d point = Eigen::Map<const Eigen::Vector3f>(in + 3 * v).cast<double>();
    Eigen::Map<Eigen::Vector3f>(out + 3 * v) = (linear * point + offset).cast<float>();
  }
}

}  // namespace

void mix(const float* from, const float* to, const float* part, std::size_t vertices, float* out) {
  for (std::size_t v = 0; v < vertices; ++v) {
    // A part of 0 keeps NaN in `to` out of the result.
    for (std::size_t i = 3 * v; i < 3 * v + 3; ++i)
      out[i] = part[v] == 0 ? from[i] : from[i] + part[v] * (to[i] - from[i]);
  }
}

void PosedLayer::pose(const Layer& own, const LayerPose& pose) {
  layer = &own;
  skin = &own.skin().blocked();
  space.reset();
  armature_from_mesh.reset();
  if (pose.mesh_from_armature) {
    space.emplace(*pose.mesh_from_armature);
    armature_from_mesh = space->back;
  }
  split_elsewhere = pose.mesh_from_armature != own.split_space();
  const MatrixStack<const float> stack = pose.matrices;
  if (space && is_carried(own.method(), *space)) {
    matrices.clear();
    for (std::ptrdiff_t j = 0; j < stack.joints; ++j) {
      const Matrix4<double> matrix = stack.at(0, j).cast<double>();
      matrices.emplace_back((space->forth * matrix * space->back).cast<float>());
    }
    const Carried carried{*space, MatrixStack<const float>::of(matrices.data(), 1, stack.joints)};
    prepare(*skin, own.method(), own.rule(), own.data(), stack, 0, palette, &carried);
    space.reset();
  } else {
    prepare(*skin, own.method(), own.rule(), own.data(), stack, 0, palette);
  }
  refuse_half_turns(own.bent_pairs(), palette);
  palette.from_mesh.reset();
  if (space) palette.from_mesh = space->back;
}

void PosedLayer::run(const TileInput& input, LayerScratch& scratch, float* own) const {
  const std::size_t blocks = (input.count + kBlock - 1) / kBlock;
  Tile tile{
      input.tile * kBlocksPerTile, input.tile * kBlocksPerTile + blocks, input.rest, input.points, own, layer->data()};
  if (space) {
    transform(space->back, input.rest, input.count, scratch.moved);
    pack_points(scratch.moved, input.count, scratch.moved_points);
    tile.rest = scratch.moved;
    tile.points = scratch.moved_points;
  }
  sinew::run(*skin, layer->method(), palette, tile);
  if (layer->bends()) bend(input, tile.rest, own);
  if (space) transform(space->forth, own, input.count, own);
  if (const auto& mask = layer->mask()) {
    mix(input.rest, own, mask->data() + input.tile * kTile, input.count, own);
  }
}

/// Skins the bends' vertices that have moved again, with their influences split at their current place.
/// rest  the input in the space in which the layer skins it: mesh or armature space.
/// own   out, in the same space.
void PosedLayer::bend(const TileInput& input, const float* rest, float* own) const {
  auto& split = per_thread<Bends::Split>();
  const bool all = input.moved.all || split_elsewhere;
  if (!all && !input.moved.touched) return;
  const Bends& bends = *layer->bends();
  const auto vertices = bends.vertices();
  const auto first = static_cast<std::int64_t>(input.tile * kTile);
  const auto end = first + static_cast<std::int64_t>(input.count);
  auto at = std::ranges::lower_bound(vertices, first);
  for (; at != vertices.end() && *at < end; ++at) {
    const auto v = static_cast<std::size_t>(*at - first);
    if (!all && !input.moved.touched[v]) continue;
    Eigen::Vector3d point = Eigen::Map<const Eigen::Vector3f>(input.rest + 3 * v).cast<double>();
    if (const auto& back = armature_from_mesh) {
      point = (back->topRows<3>() * point.homogeneous()).eval();
    }
    bends.split(static_cast<std::size_t>(at - vertices.begin()), point, split);
    run_vertex(static_cast<std::size_t>(*at), {split.joints, split.weights}, layer->method(), layer->data(), palette,
               rest + 3 * v, own + 3 * v);
  }
}

}  // namespace sinew
