// Shared by the kernels that move points. Included once for each instruction set.
#if defined(SINEW_KERNELS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SINEW_KERNELS_INL_H
#undef SINEW_KERNELS_INL_H
#else
#define SINEW_KERNELS_INL_H
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <cstring>

#include "skinning/kernels.h"

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::CappedTag<float, kBlock>;
using Floats = hn::Vec<Tag>;

constexpr Tag kTag;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kTag));

// How far ahead of their use numbers are fetched: enough to hide memory latency, few enough to stay in
// L1. Every cache line is fetched: fetching only some of them costs more than fetching none, since it
// misleads the hardware prefetcher (2.4, 2.0 and 1.6 ns per vertex of a large mesh for one line per
// block, none and all).
constexpr std::size_t kPrefetchFloats = 1024;

/// Fetches the cache line kPrefetchFloats ahead of `in`, which belongs to group n, unless group n - 1
/// has fetched it.
HWY_INLINE void fetch_ahead(const float* in, int n) {
  if (n * kLanes % kBlock == 0) hwy::Prefetch(in + kPrefetchFloats);
}

/// One group of kLanes vertices: the start of its x (y and z follow kBlock apart), the start of its
/// first joint's weights (those of the others follow kBlock apart), and where its positions are written.
struct Group {
  const float* points;
  const float* weights;
  float* out;
};

/// Turns three registers with vertex i in lane 3 i mod kLanes into x y z x y z ... and back.
class Interleaver {
 public:
  Interleaver() {
    HWY_ALIGN int32_t by_one[kLanes];
    HWY_ALIGN int32_t by_two[kLanes];
    HWY_ALIGN int32_t back_by_one[kLanes];
    HWY_ALIGN int32_t back_by_two[kLanes];
    for (int lane = 0; lane < kLanes; ++lane) {
      by_one[lane] = (lane + kLanes - 1) % kLanes;
      by_two[lane] = (lane + kLanes - 2) % kLanes;
      back_by_one[lane] = (lane + 1) % kLanes;
      back_by_two[lane] = (lane + 2) % kLanes;
    }
    HWY_ALIGN float every_third[3][kLanes];
    for (int rest = 0; rest < 3; ++rest) {
      for (int lane = 0; lane < kLanes; ++lane) every_third[rest][lane] = lane % 3 == rest;
    }
    by_one_ = hn::SetTableIndices(kTag, by_one);
    by_two_ = hn::SetTableIndices(kTag, by_two);
    back_by_one_ = hn::SetTableIndices(kTag, back_by_one);
    back_by_two_ = hn::SetTableIndices(kTag, back_by_two);
    for (int rest = 0; rest < 3; ++rest) {
      third_[rest] = hn::Gt(hn::Load(kTag, every_third[rest]), hn::Zero(kTag));
    }
  }

  HWY_INLINE void store(Floats x, Floats y, Floats z, float* out) const {
    y = hn::TableLookupLanes(y, by_one_);
    z = hn::TableLookupLanes(z, by_two_);
    // Output number f is coordinate f mod 3; a register begins at a multiple of kLanes.
    store_third<0>(x, y, z, out);
    store_third<1>(x, y, z, out);
    store_third<2>(x, y, z, out);
  }

  /// x, y and z of a group.
  HWY_INLINE void load(const float* in, Floats& x, Floats& y, Floats& z) const {
    Floats parts[3];
    for (int part = 0; part < 3; ++part) parts[part] = hn::LoadU(kTag, in + part * kLanes);
    x = coordinate<0>(parts);
    y = hn::TableLookupLanes(coordinate<1>(parts), back_by_one_);
    z = hn::TableLookupLanes(coordinate<2>(parts), back_by_two_);
  }

 private:
  /// Lane l of register p is coordinate (p kLanes + l) mod 3 of its vertex.
  template <int axis>
  HWY_INLINE Floats coordinate(const Floats* parts) const {
    constexpr int kRest = kLanes % 3;
    const Floats later = pick_third<(axis + 3 - kRest) % 3>(parts[1], parts[2]);
    return pick_third<axis>(parts[0], later);
  }

  template <int part>
  HWY_INLINE void store_third(Floats x, Floats y, Floats z, float* out) const {
    constexpr int phase = part * kLanes % 3;
    const Floats yz = pick_third<(4 - phase) % 3>(y, z);
    hn::StoreU(pick_third<(3 - phase) % 3>(x, yz), kTag, out + part * kLanes);
  }

  /// Lanes whose number is `rest` mod 3 from a, the others from b.
  template <int rest>
  HWY_INLINE Floats pick_third(Floats a, Floats b) const {
#if HWY_TARGET == HWY_AVX2
    // With the mask in the instruction, any of four pipes can run it, not only those that multiply.
    return Floats{_mm256_blend_ps(b.raw, a.raw, 0b01001001 << rest & 0xff)};
#else
    return hn::IfThenElse(third_[rest], a, b);
#endif
  }

  using Indices = decltype(hn::SetTableIndices(kTag, static_cast<const int32_t*>(nullptr)));
  Indices by_one_;
  Indices by_two_;
  Indices back_by_one_;
  Indices back_by_two_;
  hn::Mask<Tag> third_[3];
};

/// The rest positions of N groups.
template <int N>
struct Points {
  Points() = default;
  HWY_INLINE explicit Points(const Group* groups) {
    for (int n = 0; n < N; ++n) {
      x[n] = hn::Load(kTag, groups[n].points);
      y[n] = hn::Load(kTag, groups[n].points + kBlock);
      z[n] = hn::Load(kTag, groups[n].points + 2 * kBlock);
      for (int axis = 0; axis < 3; ++axis) fetch_ahead(groups[n].points + axis * kBlock, n);
    }
  }
  /// Those of group n only.
  HWY_INLINE Points<1> of(int n) const {
    Points<1> one;
    one.x[0] = x[n];
    one.y[0] = y[n];
    one.z[0] = z[n];
    return one;
  }
  Floats x[N], y[N], z[N];
};

/// The moved points of N groups.
template <int N>
struct Moved {
  HWY_INLINE void store(const Group* groups, const Interleaver& interleaver) const {
    for (int n = 0; n < N; ++n) interleaver.store(x[n], y[n], z[n], groups[n].out);
  }
  Floats x[N], y[N], z[N];
};

/// moved = row . (x y z 1). Only one number of the row is in a register at a time: with two groups on
/// AVX2, the points and their sums take all sixteen registers.
template <int N>
HWY_INLINE void transform(const float* row, const Points<N>& points, Floats* moved) {
  for (int n = 0; n < N; ++n) moved[n] = hn::Set(kTag, row[3]);
  const Floats c = hn::Set(kTag, row[2]);
  for (int n = 0; n < N; ++n) moved[n] = hn::MulAdd(c, points.z[n], moved[n]);
  const Floats b = hn::Set(kTag, row[1]);
  for (int n = 0; n < N; ++n) moved[n] = hn::MulAdd(b, points.y[n], moved[n]);
  const Floats a = hn::Set(kTag, row[0]);
  for (int n = 0; n < N; ++n) moved[n] = hn::MulAdd(a, points.x[n], moved[n]);
}

/// sum += weight * (row . (x y z 1)).
template <int N>
HWY_INLINE void add_transformed(const float* row, const Points<N>& points, const float* const* weight, Floats* sum) {
  Floats moved[N];
  transform<N>(row, points, moved);
  for (int n = 0; n < N; ++n) sum[n] = hn::MulAdd(moved[n], hn::Load(kTag, weight[n]), sum[n]);
}

/// Moves N groups with the same joints linearly: transforms by each joint, then blends; 12 multiply-adds per joint.
template <int N>
HWY_INLINE void move_linearly(const Points<N>& points, const Group* groups, const std::uint32_t* joints, JointSet set,
                              const MatrixRows* palette, Moved<N>& moved) {
  if (set.is_rigid) {
    const MatrixRows& matrix = palette[joints[0]];
    transform<N>(matrix.row[0], points, moved.x);
    transform<N>(matrix.row[1], points, moved.y);
    transform<N>(matrix.row[2], points, moved.z);
    return;
  }
  const float* weight[N];
  for (int n = 0; n < N; ++n) {
    moved.x[n] = moved.y[n] = moved.z[n] = hn::Zero(kTag);
    weight[n] = groups[n].weights;
  }
  for (std::uint32_t k = 0; k < set.count; ++k) {
    const MatrixRows& matrix = palette[joints[k]];
    add_transformed<N>(matrix.row[0], points, weight, moved.x);
    add_transformed<N>(matrix.row[1], points, weight, moved.y);
    add_transformed<N>(matrix.row[2], points, weight, moved.z);
    for (int n = 0; n < N; ++n) {
      fetch_ahead(weight[n], n);
      weight[n] += kBlock;
    }
  }
}

/// Calls run<groups_at_once>(groups) for one block, b, or for two with the same joints. They write
/// directly into the tile's positions, except for the last block of a mesh if it is not full.
template <int groups_at_once, class Run>
HWY_INLINE void run_block(const BlockedSkin& skin, const Tile& tile, std::size_t b, int blocks, const Run& run) {
  constexpr int kGroups = kBlock / kLanes;
  Group groups[2 * kGroups];
  HWY_ALIGN float buffer[kBlockFloats];
  float* partial = nullptr;  // destination of the block that is not full
  for (int i = 0; i < blocks; ++i) {
    const std::size_t at = (b + i - tile.begin) * kBlockFloats;
    float* out = tile.positions + at;
    if ((b + i + 1) * kBlock > skin.vertex_count()) {
      partial = out;
      out = buffer;
    }
    const float* weights = skin.packed_weights.get() + skin.blocks[b + i].weights;
    for (int g = 0; g < kGroups; ++g) {
      groups[i * kGroups + g] = {tile.points + at + g * kLanes, weights + g * kLanes, out + 3 * g * kLanes};
    }
  }
  for (int g = 0; g < blocks * kGroups; g += groups_at_once) {
    run.template operator()<groups_at_once>(groups + g);
  }
  if (partial) std::memcpy(partial, buffer, skin.vertex_count() % kBlock * 3 * sizeof(float));
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew
HWY_AFTER_NAMESPACE();
#endif
