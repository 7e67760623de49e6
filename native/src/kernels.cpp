// Highway compiles this file once for each instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes first.
#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cstring>

#include "check.h"
#include "kernels.h"
#include "sinew/instruction_set.h"

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::CappedTag<float, kBlock>;
using Floats = hn::Vec<Tag>;

constexpr Tag kTag;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kTag));

// How far ahead of their use numbers are fetched: enough to hide memory, few enough to stay in L1.
// Every line is asked for: fetching some of them costs more than none, since it misleads the
// machine's own prefetcher (2.4, 2.0 and 1.6 ns a vertex of a large mesh for one line a block, none
// and all).
constexpr std::size_t kPrefetchFloats = 1024;

/// Fetches the line of memory that lies kPrefetchFloats ahead of `in`, of group n, unless group
/// n - 1 has fetched it.
HWY_INLINE void fetch_ahead(const float* in, int n) {
  if (n * kLanes % kBlock == 0) hwy::Prefetch(in + kPrefetchFloats);
}

/// One group of kLanes vertices: where its x begin (y and z follow kBlock apart), where the weights
/// of its first joint do (those of the others follow kBlock apart), and where its positions go.
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
    // Number f of the output is coordinate f mod 3; a register begins at a multiple of kLanes.
    store_third<0>(x, y, z, out);
    store_third<1>(x, y, z, out);
    store_third<2>(x, y, z, out);
  }

  /// x, y and z of a group to points, kBlock apart.
  HWY_INLINE void take_apart(const float* in, float* points) const {
    Floats parts[3];
    for (int part = 0; part < 3; ++part) parts[part] = hn::LoadU(kTag, in + part * kLanes);
    hn::Store(coordinate<0>(parts), kTag, points);
    hn::Store(hn::TableLookupLanes(coordinate<1>(parts), back_by_one_), kTag, points + kBlock);
    hn::Store(hn::TableLookupLanes(coordinate<2>(parts), back_by_two_), kTag, points + 2 * kBlock);
  }

 private:
  /// Lane l of register p is coordinate (p kLanes + l) mod 3 of its vertex.
  template <int axis>
  HWY_INLINE Floats coordinate(const Floats* parts) const {
    constexpr int kRest = kLanes % 3;
    const Floats later = take_third<(axis + 3 - kRest) % 3>(parts[1], parts[2]);
    return take_third<axis>(parts[0], later);
  }

  template <int part>
  HWY_INLINE void store_third(Floats x, Floats y, Floats z, float* out) const {
    constexpr int phase = part * kLanes % 3;
    const Floats yz = take_third<(4 - phase) % 3>(y, z);
    hn::StoreU(take_third<(3 - phase) % 3>(x, yz), kTag, out + part * kLanes);
  }

  /// Lanes whose number is `rest` mod 3 from a, the others from b.
  template <int rest>
  HWY_INLINE Floats take_third(Floats a, Floats b) const {
#if HWY_TARGET == HWY_AVX2
    // With the mask in the instruction any of four pipes can run it, not just those that multiply.
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
  HWY_INLINE explicit Points(const Group* groups) {
    for (int n = 0; n < N; ++n) {
      x[n] = hn::Load(kTag, groups[n].points);
      y[n] = hn::Load(kTag, groups[n].points + kBlock);
      z[n] = hn::Load(kTag, groups[n].points + 2 * kBlock);
      for (int axis = 0; axis < 3; ++axis) fetch_ahead(groups[n].points + axis * kBlock, n);
    }
  }
  Floats x[N], y[N], z[N];
};

/// moved = row . (x y z 1). One number of the row is in a register at a time: with two groups of
/// AVX2 and their sums all sixteen registers are taken.
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

/// N groups with the same joints: transform by each joint, then blend; 12 multiply-adds a joint.
template <int N>
HWY_INLINE void linear_groups(const Group* groups, const std::uint32_t* joints, std::uint32_t count,
                              const MatrixRows* palette, const Interleaver& interleaver) {
  const Points<N> points(groups);
  Floats sum_x[N], sum_y[N], sum_z[N];
  const float* weight[N];
  for (int n = 0; n < N; ++n) {
    sum_x[n] = sum_y[n] = sum_z[n] = hn::Zero(kTag);
    weight[n] = groups[n].weights;
  }
  for (std::uint32_t k = 0; k < count; ++k) {
    const MatrixRows& matrix = palette[joints[k]];
    add_transformed<N>(matrix.row[0], points, weight, sum_x);
    add_transformed<N>(matrix.row[1], points, weight, sum_y);
    add_transformed<N>(matrix.row[2], points, weight, sum_z);
    for (int n = 0; n < N; ++n) {
      fetch_ahead(weight[n], n);
      weight[n] += kBlock;
    }
  }
  for (int n = 0; n < N; ++n) {
    interleaver.store(sum_x[n], sum_y[n], sum_z[n], groups[n].out);
  }
}

/// N groups that one joint moves with weight 1: there is nothing to blend.
template <int N>
HWY_INLINE void rigid_groups(const Group* groups, const MatrixRows& matrix, const Interleaver& interleaver) {
  const Points<N> points(groups);
  Floats x[N], y[N], z[N];
  transform<N>(matrix.row[0], points, x);
  transform<N>(matrix.row[1], points, y);
  transform<N>(matrix.row[2], points, z);
  for (int n = 0; n < N; ++n) interleaver.store(x[n], y[n], z[n], groups[n].out);
}

HWY_INLINE void linear_vertex(const Influences& influences, const float* p, const MatrixRows* palette, float* out) {
  if (influences.joints.empty()) {
    std::memcpy(out, p, 3 * sizeof(float));
    return;
  }
  float blended[12] = {};
  for (std::size_t i = 0; i < influences.joints.size(); ++i) {
    const float* matrix = &palette[influences.joints[i]].row[0][0];
    for (int e = 0; e < 12; ++e) blended[e] += influences.weights[i] * matrix[e];
  }
  for (int axis = 0; axis < 3; ++axis) {
    const float* row = blended + 4 * axis;
    out[axis] = row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
  }
}

/// Calls run<groups_at_once>(groups) for one block, b, or for two with the same joints. They write
/// straight into the tile's positions, but for the last block of a mesh if it is not full.
template <int groups_at_once, class Run>
HWY_INLINE void run_block(const BlockedSkin& skin, const Tile& tile, std::size_t b, int blocks, const Run& run) {
  constexpr int kGroups = kBlock / kLanes;
  Group groups[2 * kGroups];
  HWY_ALIGN float buffer[kBlockFloats];
  float* partial = nullptr;  // where the block goes that is not full
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

void linear_blocks(const BlockedSkin& skin, const Tile& tile, const MatrixRows* palette) {
  const Interleaver interleaver;
  for (std::size_t b = tile.begin; b < tile.end;) {
    const Block* block = &skin.blocks[b];
    const JointSet set = skin.sets[block->joint_set];
    if (set.count == 0) {
      for (std::size_t v = b * kBlock; v < skin.vertex_after(b + 1); ++v) {
        const std::size_t at = 3 * (v - tile.begin * kBlock);
        HWY_NAMESPACE::linear_vertex(skin.influences_of(v), tile.rest + at, palette, tile.positions + at);
      }
      ++b;
      continue;
    }
    const std::uint32_t* joints = skin.joints.data() + set.begin;
    const auto run = [&]<int N>(const Group* groups) HWY_ATTR {
      if (set.is_rigid) {
        rigid_groups<N>(groups, palette[joints[0]], interleaver);
      } else {
        linear_groups<N>(groups, joints, set.count, palette, interleaver);
      }
    };
    // Two blocks with the same joints are half the loads a block, and AVX-512 has registers for
    // them: 0.79 ns a vertex in the caches with pairs of neighbours, 0.89 without. Sorting blocks
    // by their joints, as it was before, made it 0.74; but then memory was read in no order, and
    // out of the caches it took 1.35 in place of 1.06, where AVX2 takes 1.15.
    const bool pair = b + 1 < tile.end && block[1].joint_set == block->joint_set;
    if (kLanes == kBlock && !pair) {
      run_block<1>(skin, tile, b, 1, run);
      ++b;
    } else {
      const int blocks = kLanes == kBlock ? 2 : 1;
      run_block<2>(skin, tile, b, blocks, run);
      b += blocks;
    }
  }
}

/// Dual quaternions summed over the joints, then applied as Kavan 2008, algorithm 1, on a real part
/// that is not yet normalised: p + 2 / |r|^2 (r x (r x p + w p + d) + w d - d_w r).
HWY_INLINE void dual_quaternion_group(const Group& group, const std::uint32_t* joints, JointSet set,
                                      const DualQuaternion* palette, const Interleaver& interleaver) {
  Floats sum[8];
  for (int part = 0; part < 4; ++part) {
    sum[part] = set.is_rigid ? hn::Set(kTag, palette[joints[0]].real[part]) : hn::Zero(kTag);
    sum[4 + part] = set.is_rigid ? hn::Set(kTag, palette[joints[0]].dual[part]) : hn::Zero(kTag);
  }
  const float* weights = group.weights;
  for (std::uint32_t k = 0; k < set.count && !set.is_rigid; ++k, weights += kBlock) {
    const DualQuaternion& joint = palette[joints[k]];
    const Floats weight = hn::Load(kTag, weights);
    fetch_ahead(weights, 0);
    for (int part = 0; part < 4; ++part) {
      sum[part] = hn::MulAdd(weight, hn::Set(kTag, joint.real[part]), sum[part]);
      sum[4 + part] = hn::MulAdd(weight, hn::Set(kTag, joint.dual[part]), sum[4 + part]);
    }
  }
  const Floats rw = sum[0], rx = sum[1], ry = sum[2], rz = sum[3];
  const Floats dw = sum[4], dx = sum[5], dy = sum[6], dz = sum[7];
  const Points<1> points(&group);
  const Floats px = points.x[0], py = points.y[0], pz = points.z[0];

  const Floats norm2 = hn::MulAdd(rw, rw, hn::MulAdd(rx, rx, hn::MulAdd(ry, ry, hn::Mul(rz, rz))));
  // Rotations that cancel, or weights of nearly nothing: no direction is right, the vertex stays.
  const auto usable = hn::Ge(norm2, hn::Set(kTag, 1.17549435e-38f));
  const Floats scale = hn::IfThenElseZero(usable, hn::Div(hn::Set(kTag, 2.0f), norm2));

  const auto cross = [](Floats a, Floats b, Floats c, Floats d) HWY_ATTR {  // a d - c b
    return hn::NegMulAdd(c, b, hn::Mul(a, d));
  };
  const Floats tx = hn::Add(hn::MulAdd(rw, px, dx), cross(ry, py, rz, pz));
  const Floats ty = hn::Add(hn::MulAdd(rw, py, dy), cross(rz, pz, rx, px));
  const Floats tz = hn::Add(hn::MulAdd(rw, pz, dz), cross(rx, px, ry, py));
  const auto moved = [&](Floats p, Floats turned, Floats d, Floats r)
                         HWY_ATTR { return hn::MulAdd(scale, hn::MulAdd(rw, d, hn::NegMulAdd(dw, r, turned)), p); };
  interleaver.store(moved(px, cross(ry, ty, rz, tz), dx, rx), moved(py, cross(rz, tz, rx, tx), dy, ry),
                    moved(pz, cross(rx, tx, ry, ty), dz, rz), group.out);
}

void dual_quaternion_blocks(const BlockedSkin& skin, const Tile& tile, const DualQuaternion* palette,
                            const std::uint8_t* skip) {
  const Interleaver interleaver;
  for (std::size_t b = tile.begin; b < tile.end; ++b) {
    const std::uint32_t joint_set = skin.blocks[b].joint_set;
    const JointSet set = skin.sets[joint_set];
    if (set.count == 0 || skip[joint_set]) continue;
    run_block<1>(skin, tile, b, 1, [&]<int>(const Group* group) HWY_ATTR {
      dual_quaternion_group(*group, skin.joints.data() + set.begin, set, palette, interleaver);
    });
  }
}

void pack_points(const float* positions, std::size_t vertices, float* points) {
  const Interleaver interleaver;
  const auto pack = [&](const float* in, float* out) HWY_ATTR {
    for (int lane = 0; lane < kBlock; lane += kLanes) {
      interleaver.take_apart(in + 3 * lane, out + lane);
    }
  };
  const std::size_t full = vertices / kBlock, left = vertices % kBlock;
  for (std::size_t b = 0; b < full; ++b) {
    pack(positions + b * kBlockFloats, points + b * kBlockFloats);
  }
  if (left > 0) {
    float buffer[kBlockFloats] = {};
    std::memcpy(buffer, positions + full * kBlockFloats, 3 * left * sizeof(float));
    pack(buffer, points + full * kBlockFloats);
  }
}

int kernel_lanes() { return kLanes; }

const char* kernel_target() { return hwy::TargetName(HWY_TARGET); }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sinew {
namespace {
/// Those of the machine, whichever one is forced: nobody can force one before this has been called.
const std::vector<std::int64_t>& all_targets() {
  static const std::vector<std::int64_t> targets = hwy::SupportedAndGeneratedTargets();
  return targets;
}

}  // namespace

HWY_EXPORT(kernel_lanes);
HWY_EXPORT(kernel_target);
HWY_EXPORT(pack_points);
HWY_EXPORT(linear_blocks);
HWY_EXPORT(linear_vertex);
HWY_EXPORT(dual_quaternion_blocks);

std::vector<std::string> instruction_sets() {
  std::vector<std::string> names;
  for (const std::int64_t target : all_targets()) names.emplace_back(hwy::TargetName(target));
  return names;
}

std::string instruction_set() { return HWY_DYNAMIC_DISPATCH(kernel_target)(); }

void set_instruction_set(const std::string& name) {
  std::int64_t wanted = 0;
  std::string known;
  for (const std::int64_t target : all_targets()) {
    if (name == hwy::TargetName(target)) wanted = target;
    known += std::string(known.empty() ? "" : ", ") + hwy::TargetName(target);
  }
  if (wanted == 0 && name != "auto") {
    fail("this machine has no instruction set \"", name, "\"; expected auto or one of ", known);
  }
  hwy::SetSupportedTargetsForTest(wanted);  // 0: the best
  hwy::GetChosenTarget().DeInit();          // the next call looks again
}

int kernel_lanes() { return HWY_DYNAMIC_DISPATCH(kernel_lanes)(); }

void pack_points(const float* positions, std::size_t vertices, float* points) {
  HWY_DYNAMIC_DISPATCH(pack_points)(positions, vertices, points);
}

void linear_blocks(const BlockedSkin& skin, const Tile& tile, const MatrixRows* palette) {
  HWY_DYNAMIC_DISPATCH(linear_blocks)(skin, tile, palette);
}

void linear_vertex(const Influences& influences, const float* p, const MatrixRows* palette, float* out) {
  HWY_DYNAMIC_DISPATCH(linear_vertex)(influences, p, palette, out);
}

void dual_quaternion_blocks(const BlockedSkin& skin, const Tile& tile, const DualQuaternion* palette,
                            const std::uint8_t* skip) {
  HWY_DYNAMIC_DISPATCH(dual_quaternion_blocks)(skin, tile, palette, skip);
}

}  // namespace sinew
#endif
