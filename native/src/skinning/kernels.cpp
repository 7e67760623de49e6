// Highway compiles this file once for each instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "skinning/kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes first.
#include <hwy/highway.h>

#include <algorithm>
#include <cstring>

#include "skinning/dual_quaternion-inl.h"
#include "skinning/kernels-inl.h"
#include "skinning/kernels.h"

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

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
      Moved<N> moved;
      move_linearly<N>(Points<N>(groups), groups, joints, set, palette, moved);
      moved.store(groups, interleaver);
    };
    // Two blocks with the same joints need half the loads per block, and AVX-512 has enough registers:
    // 0.79 ns per vertex in cache with pairs of neighbours, 0.89 without. Sorting blocks by their
    // joints, as was done before, took 0.74; but then memory was read out of order, and out of cache
    // it took 1.35 instead of 1.06, where AVX2 takes 1.15.
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

void dual_quaternion_blocks(const BlockedSkin& skin, const Tile& tile, const QuaternionJoints& joints) {
  const Interleaver interleaver;
  for (std::size_t b = tile.begin; b < tile.end; ++b) {
    const std::uint32_t joint_set = skin.blocks[b].joint_set;
    const SetWay way = joints.ways[joint_set];
    if (way == SetWay::one_by_one) continue;
    const JointSet set = skin.sets[joint_set];
    with_stretching(way, joints, [&]<Stretching stretching>() HWY_ATTR {
      run_block<1>(skin, tile, b, 1, [&]<int>(const Group* group) HWY_ATTR {
        Moved<1> moved;
        move_by_dual_quaternions<stretching, true>(Points<1>(group), *group, skin.joints.data() + set.begin, set,
                                                   joints, moved.x[0], moved.y[0], moved.z[0]);
        moved.store(group, interleaver);
      });
    });
  }
}

void pack_points(const float* positions, std::size_t vertices, float* points) {
  const Interleaver interleaver;
  const auto pack = [&](const float* in, float* out) HWY_ATTR {
    for (int lane = 0; lane < kBlock; lane += kLanes) {
      Floats x, y, z;
      interleaver.load(in + 3 * lane, x, y, z);
      hn::Store(x, kTag, out + lane);
      hn::Store(y, kTag, out + lane + kBlock);
      hn::Store(z, kTag, out + lane + 2 * kBlock);
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
HWY_EXPORT(kernel_lanes);
HWY_EXPORT(kernel_target);
HWY_EXPORT(pack_points);
HWY_EXPORT(linear_blocks);
HWY_EXPORT(linear_vertex);
HWY_EXPORT(dual_quaternion_blocks);

int kernel_lanes() { return HWY_DYNAMIC_DISPATCH(kernel_lanes)(); }

const char* kernel_target() { return HWY_DYNAMIC_DISPATCH(kernel_target)(); }

void pack_points(const float* positions, std::size_t vertices, float* points) {
  HWY_DYNAMIC_DISPATCH(pack_points)(positions, vertices, points);
}

void linear_blocks(const BlockedSkin& skin, const Tile& tile, const MatrixRows* palette) {
  HWY_DYNAMIC_DISPATCH(linear_blocks)(skin, tile, palette);
}

void linear_vertex(const Influences& influences, const float* p, const MatrixRows* palette, float* out) {
  HWY_DYNAMIC_DISPATCH(linear_vertex)(influences, p, palette, out);
}

void dual_quaternion_blocks(const BlockedSkin& skin, const Tile& tile, const QuaternionJoints& joints) {
  HWY_DYNAMIC_DISPATCH(dual_quaternion_blocks)(skin, tile, joints);
}

}  // namespace sinew
#endif
