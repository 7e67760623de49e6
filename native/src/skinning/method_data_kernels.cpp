// Highway compiles this file once for each instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "skinning/method_data_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes first.
#include <hwy/highway.h>

#include "skinning/dual_quaternion-inl.h"
#include "skinning/kernels-inl.h"
#include "skinning/method_data_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

/// Loads one number per vertex into the vertices' lanes.
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

HWY_INLINE bool are_between_0_and_1(Floats shares) {
  return hn::AllTrue(kTag, hn::And(hn::Gt(shares, hn::Zero(kTag)), hn::Lt(shares, hn::Set(kTag, 1.0f))));
}

/// from + share (to - from). to_the_bit: exactly `to` where share is 1, exactly `from` where it is 0.
template <bool to_the_bit>
HWY_INLINE Floats between(Floats from, Floats to, Floats share) {
  const Floats mixed = hn::MulAdd(share, hn::Sub(to, from), from);
  if constexpr (!to_the_bit) return mixed;
  const Floats low = hn::IfThenElse(hn::Gt(share, hn::Zero(kTag)), mixed, from);
  return hn::IfThenElse(hn::Eq(share, hn::Set(kTag, 1.0f)), to, low);
}

// How many groups of a block are moved together; they share the loads of a joint's matrix.
constexpr int kAtOnce = kLanes == kBlock ? 1 : 2;

/// Calls move<stretching>(groups, joints, set, vertex) for all groups, kAtOnce at a time; vertex: the first vertex of
/// the first group, counted from the tile's first.
template <class Move>
HWY_INLINE void for_groups(const BlockedSkin& skin, const Tile& tile, const QuaternionJoints& quaternions,
                           const Move& move) {
  for (std::size_t b = tile.begin; b < tile.end; ++b) {
    const std::uint32_t joint_set = skin.blocks[b].joint_set;
    const JointSet set = skin.sets[joint_set];
    std::size_t vertex = (b - tile.begin) * kBlock;
    with_stretching(quaternions.ways[joint_set], quaternions, [&]<Stretching stretching>() HWY_ATTR {
      run_block<kAtOnce>(skin, tile, b, 1, [&]<int>(const Group* groups) HWY_ATTR {
        move.template operator()<stretching>(groups, skin.joints.data() + set.begin, set, vertex);
        vertex += kAtOnce * kLanes;
      });
    });
  }
}

/// Moves points linearly and sums real parts, in one pass over the weights.
template <int N>
HWY_INLINE void move_and_sum(const Points<N>& points, const Group* groups, const std::uint32_t* joints, JointSet set,
                             const MatrixRows* matrices, const DualQuaternion* quaternions, Moved<N>& moved,
                             Floats real[N][4]) {
  const float* weights[N];
  for (int n = 0; n < N; ++n) {
    moved.x[n] = moved.y[n] = moved.z[n] = hn::Zero(kTag);
    for (int part = 0; part < 4; ++part) real[n][part] = hn::Zero(kTag);
    weights[n] = groups[n].weights;
  }
  for (std::uint32_t k = 0; k < set.count; ++k) {
    const MatrixRows& matrix = matrices[joints[k]];
    add_transformed<N>(matrix.row[0], points, weights, moved.x);
    add_transformed<N>(matrix.row[1], points, weights, moved.y);
    add_transformed<N>(matrix.row[2], points, weights, moved.z);
    for (int part = 0; part < 4; ++part) {
      const Floats own = hn::Set(kTag, quaternions[joints[k]].real[part]);
      for (int n = 0; n < N; ++n) real[n][part] = hn::MulAdd(hn::Load(kTag, weights[n]), own, real[n][part]);
    }
    for (int n = 0; n < N; ++n) {
      fetch_ahead(weights[n], n);
      weights[n] += kBlock;
    }
  }
}

void blended_blocks(const BlockedSkin& skin, const Tile& tile, const MatrixRows* matrices,
                    const QuaternionJoints& quaternions, const float* shares) {
  const Interleaver interleaver;
  const Lanes lanes;
  const auto move = [&]<Stretching stretching>(const Group* groups, const std::uint32_t* joints, JointSet set,
                                               std::size_t vertex) HWY_ATTR {
    const Points<kAtOnce> points(groups);
    Moved<kAtOnce> moved;
    move_linearly<kAtOnce>(points, groups, joints, set, matrices, moved);
    for (int n = 0; n < kAtOnce; ++n) {
      Floats x, y, z;
      move_by_dual_quaternions<stretching, false>(points.of(n), groups[n], joints, set, quaternions, x, y, z);
      const Floats share = lanes.load(shares + vertex + n * kLanes);
      if (are_between_0_and_1(share)) {
        moved.x[n] = between<false>(moved.x[n], x, share);
        moved.y[n] = between<false>(moved.y[n], y, share);
        moved.z[n] = between<false>(moved.z[n], z, share);
      } else {
        moved.x[n] = between<true>(moved.x[n], x, share);
        moved.y[n] = between<true>(moved.y[n], y, share);
        moved.z[n] = between<true>(moved.z[n], z, share);
      }
    }
    moved.store(groups, interleaver);
  };
  for_groups(skin, tile, quaternions, move);
}

void rotation_center_blocks(const BlockedSkin& skin, const Tile& tile, const MatrixRows* matrices,
                            const QuaternionJoints& quaternions, const float* centers) {
  const Interleaver interleaver;
  const auto move = [&]<Stretching stretching>(const Group* groups, const std::uint32_t* joints, JointSet set,
                                               std::size_t vertex) HWY_ATTR {
    const Points<kAtOnce> points(groups);
    Points<kAtOnce> from;
    for (int at = 0; at < 3 * kAtOnce * kLanes; at += kBlock) fetch_ahead(centers + 3 * vertex + at, 0);
    for (int n = 0; n < kAtOnce; ++n) {
      interleaver.load(centers + 3 * (vertex + n * kLanes), from.x[n], from.y[n], from.z[n]);
      const auto has = hn::Eq(from.x[n], from.x[n]);
      from.x[n] = hn::IfThenElse(has, from.x[n], points.x[n]);
      from.y[n] = hn::IfThenElse(has, from.y[n], points.y[n]);
      from.z[n] = hn::IfThenElse(has, from.z[n], points.z[n]);
    }
    Moved<kAtOnce> moved;
    Floats reals[kAtOnce][4];
    move_and_sum<kAtOnce>(from, groups, joints, set, matrices, quaternions.joints, moved, reals);
    for (int n = 0; n < kAtOnce; ++n) {
      const Floats* const r = reals[n];
      const Floats scale = two_over_norm2(r);
      Points<1> arm;
      arm.x[0] = hn::Sub(points.x[n], from.x[n]);
      arm.y[0] = hn::Sub(points.y[n], from.y[n]);
      arm.z[0] = hn::Sub(points.z[n], from.z[n]);
      if constexpr (stretching != Stretching::none) {
        stretch<false, false>(groups[n], joints, set, quaternions.displacements, arm);
      }
      const Floats dx = arm.x[0], dy = arm.y[0], dz = arm.z[0];
      // d + 2 / |r|^2 r x (r x d + w d); without a center d is 0.
      const Floats tx = hn::MulAdd(r[0], dx, cross(r[2], dy, r[3], dz));
      const Floats ty = hn::MulAdd(r[0], dy, cross(r[3], dz, r[1], dx));
      const Floats tz = hn::MulAdd(r[0], dz, cross(r[1], dx, r[2], dy));
      moved.x[n] = hn::Add(moved.x[n], hn::MulAdd(scale, cross(r[2], ty, r[3], tz), dx));
      moved.y[n] = hn::Add(moved.y[n], hn::MulAdd(scale, cross(r[3], tz, r[1], tx), dy));
      moved.z[n] = hn::Add(moved.z[n], hn::MulAdd(scale, cross(r[1], tx, r[2], ty), dz));
    }
    moved.store(groups, interleaver);
  };
  for_groups(skin, tile, quaternions, move);
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
                    const QuaternionJoints& quaternions, const float* shares) {
  HWY_DYNAMIC_DISPATCH(blended_blocks)(skin, tile, matrices, quaternions, shares);
}

void rotation_center_blocks(const BlockedSkin& skin, const Tile& tile, const MatrixRows* matrices,
                            const QuaternionJoints& quaternions, const float* centers) {
  HWY_DYNAMIC_DISPATCH(rotation_center_blocks)(skin, tile, matrices, quaternions, centers);
}

}  // namespace sinew
#endif
