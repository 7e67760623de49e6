// Highway compiles this file once for each instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "method_data_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes first.
#include <hwy/highway.h>

#include "kernels-inl.h"
#include "method_data_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

/// One number a vertex into the lanes in which the vertices lie.
class Lanes {
 public:
  Lanes() {
    HWY_ALIGN int32_t vertex[kLanes];
    for (int v = 0; v < kLanes; ++v) vertex[3 * v % kLanes] = v;
    vertex_ = hn::SetTableIndices(kTag, vertex);
  }
  HWY_INLINE Floats load(const float* numbers) const { return hn::TableLookupLanes(hn::LoadU(kTag, numbers), vertex_); }

 private:
  decltype(hn::SetTableIndices(kTag, static_cast<const int32_t*>(nullptr))) vertex_;
};

/// to where share is 1, from where it is 0, both to the bit.
HWY_INLINE Floats between(Floats from, Floats to, Floats share) {
  const Floats mixed = hn::MulAdd(share, hn::Sub(to, from), from);
  const Floats low = hn::IfThenElse(hn::Gt(share, hn::Zero(kTag)), mixed, from);
  return hn::IfThenElse(hn::Eq(share, hn::Set(kTag, 1.0f)), to, low);
}

/// Calls move(group, joints, set, vertex) for all groups; vertex: the group's first one, counted from the
/// tile's.
template <class Move>
HWY_INLINE void for_groups(const BlockedSkin& skin, const Tile& tile, const Move& move) {
  for (std::size_t b = tile.begin; b < tile.end; ++b) {
    const JointSet set = skin.sets[skin.blocks[b].joint_set];
    std::size_t vertex = (b - tile.begin) * kBlock;
    run_block<1>(skin, tile, b, 1, [&]<int>(const Group* group) HWY_ATTR {
      move(*group, skin.joints.data() + set.begin, set, vertex);
      vertex += kLanes;
    });
  }
}

void blended_blocks(const BlockedSkin& skin, const Tile& tile, const MatrixRows* matrices,
                    const DualQuaternion* quaternions, const float* shares) {
  const Interleaver interleaver;
  const Lanes lanes;
  for_groups(skin, tile,
             [&](const Group& group, const std::uint32_t* joints, JointSet set, std::size_t vertex) HWY_ATTR {
               const Points<1> points(&group);
               Moved<1> moved, turned;
               move_linearly<1>(points, &group, joints, set, matrices, moved);
               Floats sum[8];
               sum_quaternions<8>(group, joints, set, quaternions, sum);
               move_by_dual_quaternions(sum, points, turned);
               const Floats share = lanes.load(shares + vertex);
               moved.x[0] = between(moved.x[0], turned.x[0], share);
               moved.y[0] = between(moved.y[0], turned.y[0], share);
               moved.z[0] = between(moved.z[0], turned.z[0], share);
               moved.store(&group, interleaver);
             });
}

void rotation_center_blocks(const BlockedSkin& skin, const Tile& tile, const MatrixRows* matrices,
                            const DualQuaternion* quaternions, const float* centers) {
  const Interleaver interleaver;
  for_groups(skin, tile,
             [&](const Group& group, const std::uint32_t* joints, JointSet set, std::size_t vertex) HWY_ATTR {
               const Points<1> points(&group);
               Points<1> from;
               interleaver.take_apart(centers + 3 * vertex, from.x[0], from.y[0], from.z[0]);
               const auto has = hn::Eq(from.x[0], from.x[0]);
               from.x[0] = hn::IfThenElse(has, from.x[0], points.x[0]);
               from.y[0] = hn::IfThenElse(has, from.y[0], points.y[0]);
               from.z[0] = hn::IfThenElse(has, from.z[0], points.z[0]);
               Moved<1> moved;
               move_linearly<1>(from, &group, joints, set, matrices, moved);
               Floats r[4];
               sum_quaternions<4>(group, joints, set, quaternions, r);
               const Floats scale = hn::IfThenElseZero(has, two_over_norm2(r));
               const Floats dx = hn::Sub(points.x[0], from.x[0]);
               const Floats dy = hn::Sub(points.y[0], from.y[0]);
               const Floats dz = hn::Sub(points.z[0], from.z[0]);
               // d + 2 / |r|^2 r x (r x d + w d)
               const Floats tx = hn::MulAdd(r[0], dx, cross(r[2], dy, r[3], dz));
               const Floats ty = hn::MulAdd(r[0], dy, cross(r[3], dz, r[1], dx));
               const Floats tz = hn::MulAdd(r[0], dz, cross(r[1], dx, r[2], dy));
               moved.x[0] = hn::Add(moved.x[0], hn::MulAdd(scale, cross(r[2], ty, r[3], tz), dx));
               moved.y[0] = hn::Add(moved.y[0], hn::MulAdd(scale, cross(r[3], tz, r[1], tx), dy));
               moved.z[0] = hn::Add(moved.z[0], hn::MulAdd(scale, cross(r[1], tx, r[2], ty), dz));
               moved.store(&group, interleaver);
             });
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sinew {

HWY_EXPORT(blended_blocks);
HWY_EXPORT(rotation_center_blocks);

void blended_blocks(const BlockedSkin& skin, const Tile& tile, const MatrixRows* matrices,
                    const DualQuaternion* quaternions, const float* shares) {
  HWY_DYNAMIC_DISPATCH(blended_blocks)(skin, tile, matrices, quaternions, shares);
}

void rotation_center_blocks(const BlockedSkin& skin, const Tile& tile, const MatrixRows* matrices,
                            const DualQuaternion* quaternions, const float* centers) {
  HWY_DYNAMIC_DISPATCH(rotation_center_blocks)(skin, tile, matrices, quaternions, centers);
}

}  // namespace sinew
#endif
