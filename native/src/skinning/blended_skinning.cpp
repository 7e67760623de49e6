#include "skinning/blended_skinning.h"

#include "skinning/dual_quaternion_skinning.h"
#include "skinning/linear_skinning.h"
#include "skinning/method_data_kernels.h"

namespace sinew {
namespace {

/// out = out + share (dual_quaternion - out), to the bit where share is 0 or 1.
void blend(const float* dual_quaternion, float share, float* out) {
  for (int axis = 0; axis < 3 && share > 0; ++axis) {
    const float part = share * (dual_quaternion[axis] - out[axis]);
    out[axis] = share == 1 ? dual_quaternion[axis] : out[axis] + part;
  }
}

enum class Way { linear, dual_quaternion, kernel, one_by_one };

}  // namespace

void run_blended(const BlockedSkin& skin, const Palette& palette, const Tile& tile) {
  const auto& data = static_cast<const BlendShares&>(*tile.data);
  const auto way_of = [&](std::size_t b) {
    const SkinningMethod method = data.method_of_block(b);
    if (method == SkinningMethod::linear) return Way::linear;
    if (method == SkinningMethod::dual_quaternion) return Way::dual_quaternion;
    return palette.ways[skin.blocks[b].joint_set] == SetWay::one_by_one ? Way::one_by_one : Way::kernel;
  };
  for_runs(tile, way_of, [&](Way way, const Tile& part) {
    const float* const shares = data.of_block(part.begin);
    if (way == Way::dual_quaternion) return run_dual_quaternion(skin, palette, part);
    if (way == Way::kernel) {
      return blended_blocks(skin, part, palette.matrices.data(), palette.quaternion_joints(), shares);
    }
    run_linear(skin, palette, part);
    if (way == Way::linear) return;
    const std::size_t first = part.begin * kBlock;
    for (std::size_t v = first; v < skin.vertex_after(part.end); ++v) {
      const std::size_t i = v - first;
      if (shares[i] == 0) continue;
      float other[3];
      dual_quaternion_vertex(skin.influences_of(v), palette, part.rest + 3 * i, other);
      blend(other, shares[i], part.positions + 3 * i);
    }
  });
}

void blended_vertex(const Influences& influences, const Palette& palette, float share, const float* rest, float* out) {
  linear_vertex(influences, rest, palette.matrices.data(), out);
  if (share == 0) return;
  float other[3];
  dual_quaternion_vertex(influences, palette, rest, other);
  blend(other, share, out);
}

}  // namespace sinew
