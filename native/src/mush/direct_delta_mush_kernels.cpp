// Highway compiles this file once for each instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mush/direct_delta_mush_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes first.
#include <hwy/highway.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstring>

#include "mush/direct_delta_mush_kernels.h"
#include "mush/nearest_rotation.h"

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

using Tag = hn::CappedTag<float, kBlock>;
using Floats = hn::Vec<Tag>;
using Mask = hn::Mask<Tag>;
constexpr Tag kTag;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kTag));

/// One group of kLanes vertices of a block.
struct Group {
  const float* vertices;  ///< Packed::vertices, kBlock apart
  const float* omega;     ///< Packed::omega, kBlock apart
  const std::uint32_t* joints;
  std::uint32_t joint_count;
};

/// Sums over the joints of a group. Points are relative to the center as moved by the first joint, so that motion that
/// all joints share costs no precision.
template <int variant>
struct Sums {
  static constexpr bool kFull = variant < 2, kColumn = variant < 4, kMatrix = variant == 3 || variant == 5;
  static constexpr int kWidth = kFull ? 10 : kColumn ? 4 : 1;

  HWY_INLINE Sums(const Group& group, const MatrixRows* palette, const DualQuaternion* rotations) {
    for (int axis = 0; axis < 3; ++axis) {
      center[axis] = hn::Load(kTag, group.vertices + axis * kBlock);
      place[axis] = first[axis] = hn::Zero(kTag);
    }
    for (auto& entry : matrix) entry = hn::Zero(kTag);
    for (int axis = 0; axis < 3; ++axis) origin[axis] = moved(palette[group.joints[0]].row[axis]);
    const float* omega = group.omega;
    for (std::uint32_t k = 0; k < group.joint_count; ++k, omega += kWidth * kBlock) {
      const std::uint32_t joint = group.joints[k];
      add(palette[joint], omega);
      if constexpr (variant == 2 || variant == 4) add_rotation(rotations[joint], omega);
    }
    const Floats scale = kFull ? hn::Load(kTag, group.vertices + 3 * kBlock) : hn::Set(kTag, 1.0f);
    for (int axis = 0; axis < 3; ++axis) {
      place[axis] = hn::MulAdd(scale, first[axis], hn::Add(origin[axis], place[axis]));
    }
  }

  Floats center[3];
  Floats place[3];   ///< q
  Floats matrix[9];  ///< A - q p^T, up to a factor; or the blended matrices or quaternions (w x y z) of the joints

 private:
  HWY_INLINE Floats moved(const float* row) const {
    return hn::MulAdd(hn::Set(kTag, row[0]), center[0],
                      hn::MulAdd(hn::Set(kTag, row[1]), center[1],
                                 hn::MulAdd(hn::Set(kTag, row[2]), center[2], hn::Set(kTag, row[3]))));
  }

  HWY_INLINE void add(const MatrixRows& joint, const float* omega) {
    const auto number = [&](int n) HWY_ATTR { return hn::Load(kTag, omega + n * kBlock); };
    constexpr int kFirst = kWidth - 4;
    const Floats share = number(kWidth - 1);
    for (int axis = 0; axis < 3; ++axis) {
      const float* row = joint.row[axis];
      const Floats off = hn::Sub(moved(row), origin[axis]);
      place[axis] = hn::MulAdd(share, off, place[axis]);
      const Floats m0 = hn::Set(kTag, row[0]), m1 = hn::Set(kTag, row[1]), m2 = hn::Set(kTag, row[2]);
      const auto product = [&](Floats sum, int x, int y, int z) HWY_ATTR {
        return hn::MulAdd(m0, number(x), hn::MulAdd(m1, number(y), hn::MulAdd(m2, number(z), sum)));
      };
      if constexpr (kColumn) first[axis] = product(first[axis], kFirst, kFirst + 1, kFirst + 2);
      Floats* const out = matrix + 3 * axis;
      if constexpr (kFull) {
        out[0] = hn::MulAdd(off, number(6), product(out[0], 0, 1, 2));
        out[1] = hn::MulAdd(off, number(7), product(out[1], 1, 3, 4));
        out[2] = hn::MulAdd(off, number(8), product(out[2], 2, 4, 5));
      } else if constexpr (kMatrix) {
        out[0] = hn::MulAdd(share, m0, out[0]);
        out[1] = hn::MulAdd(share, m1, out[1]);
        out[2] = hn::MulAdd(share, m2, out[2]);
      }
    }
  }

  /// Adds a rotation with the sign that puts it on the same side as the sum so far.
  HWY_INLINE void add_rotation(const DualQuaternion& joint, const float* omega) {
    Floats parts[4], dot = hn::Zero(kTag);
    for (int i = 0; i < 4; ++i) {
      parts[i] = hn::Set(kTag, joint.real[i]);
      dot = hn::MulAdd(parts[i], matrix[i], dot);
    }
    const Floats share = hn::Load(kTag, omega + (kWidth - 1) * kBlock);
    const Floats weight = hn::IfThenElse(hn::Lt(dot, hn::Zero(kTag)), hn::Neg(share), share);
    for (int i = 0; i < 4; ++i) matrix[i] = hn::MulAdd(weight, parts[i], matrix[i]);
  }

  Floats origin[3], first[3];
};

/// Computes the lanes that are not sure, one by one.
HWY_INLINE void turn_slowly(Mask sure, const Floats* matrix, const Floats* vector, Floats* out) {
  HWY_ALIGN float matrices[9 * kLanes];
  HWY_ALIGN float vectors[3 * kLanes];
  HWY_ALIGN float results[3 * kLanes];
  HWY_ALIGN float is_sure[kLanes];
  for (int i = 0; i < 9; ++i) hn::Store(matrix[i], kTag, matrices + i * kLanes);
  for (int i = 0; i < 3; ++i) {
    hn::Store(vector[i], kTag, vectors + i * kLanes);
    hn::Store(out[i], kTag, results + i * kLanes);
  }
  hn::Store(hn::IfThenElseZero(sure, hn::Set(kTag, 1.0f)), kTag, is_sure);
  for (int lane = 0; lane < kLanes; ++lane) {
    if (is_sure[lane] != 0) continue;
    float own[9], from[3], to[3];
    for (int i = 0; i < 9; ++i) own[i] = matrices[i * kLanes + lane];
    for (int i = 0; i < 3; ++i) from[i] = vectors[i * kLanes + lane];
    turn_by_nearest_rotation(own, from, to);
    for (int i = 0; i < 3; ++i) results[i * kLanes + lane] = to[i];
  }
  for (int i = 0; i < 3; ++i) out[i] = hn::Load(kTag, results + i * kLanes);
}

/// x^(-1/3) of x > 0.
HWY_INLINE Floats inverse_cube_root(Floats x) {
  const hn::RebindToSigned<Tag> ints;
  const Floats third = hn::Mul(hn::ConvertTo(kTag, hn::BitCast(ints, x)), hn::Set(kTag, 1.0f / 3));
  Floats y = hn::BitCast(kTag, hn::Sub(hn::Set(ints, 0x54a2fa8c), hn::ConvertTo(ints, third)));
  for (int i = 0; i < 4; ++i) {
    const Floats cube = hn::Mul(hn::Mul(y, y), hn::Mul(y, x));
    y = hn::Mul(y, hn::MulAdd(cube, hn::Set(kTag, -1.0f / 3), hn::Set(kTag, 4.0f / 3)));
  }
  return y;
}

HWY_INLINE Floats product(const Floats* row, const Floats* vector) {
  return sum_of_products(row[0], vector[0], row[1], vector[1], row[2], vector[2]);
}

/// The inverse transpose of a = F C, times C, with determinant 1: cof(a) C (det(a)^2 det(C))^(-1/3).
HWY_INLINE Mask turn_by_inverse_transpose(const Floats* matrix, const float* vertices, const Floats* vector,
                                          Floats* out) {
  Floats a[9], of_a[9], of_c[9], c[6];
  Floats squares = hn::Zero(kTag);
  for (int i = 0; i < 9; ++i) squares = hn::MulAdd(matrix[i], matrix[i], squares);
  const Floats scale = hn::Div(hn::Set(kTag, 1.0f), hn::Sqrt(squares));
  for (int i = 0; i < 9; ++i) a[i] = hn::Mul(matrix[i], scale);
  for (int i = 0; i < 6; ++i) c[i] = hn::Load(kTag, vertices + (4 + i) * kBlock);
  const Floats full[9] = {c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5]};
  cofactors(a, of_a);
  cofactors(full, of_c);
  const Floats det_a = product(a, of_a), det_c = product(full, of_c);
  const Floats size = hn::Mul(hn::Mul(det_a, det_a), det_c);
  const Floats root = inverse_cube_root(size);
  const Floats in_c[3] = {product(full, vector), product(full + 3, vector), product(full + 6, vector)};
  for (int axis = 0; axis < 3; ++axis) out[axis] = hn::Mul(root, product(of_a + 3 * axis, in_c));
  return hn::And(hn::Gt(size, hn::Set(kTag, 1e-24f)), hn::Gt(squares, hn::Set(kTag, 1e-30f)));
}

/// rest, positions  kLanes points, x y z per vertex.
template <int variant>
HWY_INLINE void run_group(const Group& group, const MatrixRows* palette, const DualQuaternion* rotations,
                          const float* rest, float* positions) {
  const Sums<variant> sums(group, palette, rotations);
  Floats offset[3], turned[3];
  hn::LoadInterleaved3(kTag, rest, offset[0], offset[1], offset[2]);
  for (int axis = 0; axis < 3; ++axis) offset[axis] = hn::Sub(offset[axis], sums.center[axis]);
  if constexpr (variant < 2) {
    Mask sure;
    if constexpr (variant == 0) {
      Quaternions<Floats> q;
      sure = nearest_rotation(kTag, sums.matrix, q);
      turn(q, offset, turned);
    } else {
      sure = turn_by_inverse_transpose(sums.matrix, group.vertices, offset, turned);
    }
    if (HWY_UNLIKELY(!hn::AllTrue(kTag, sure))) turn_slowly(sure, sums.matrix, offset, turned);
  } else if constexpr (Sums<variant>::kMatrix) {
    for (int axis = 0; axis < 3; ++axis) turned[axis] = product(sums.matrix + 3 * axis, offset);
  } else {
    const Quaternions<Floats> q{sums.matrix[0], sums.matrix[1], sums.matrix[2], sums.matrix[3]};
    turn(normalized(kTag, q), offset, turned);
    // Where rotations cancel, no direction is right.
    const Floats norm2 = hn::MulAdd(q.w, q.w, sum_of_products(q.x, q.x, q.y, q.y, q.z, q.z));
    const Mask usable = hn::Gt(norm2, hn::Set(kTag, 1e-30f));
    for (int axis = 0; axis < 3; ++axis) turned[axis] = hn::IfThenElse(usable, turned[axis], offset[axis]);
  }
  for (int axis = 0; axis < 3; ++axis) turned[axis] = hn::Add(sums.place[axis], turned[axis]);
  hn::StoreInterleaved3(turned[0], turned[1], turned[2], kTag, positions);
}

template <int variant>
void run_blocks(const DirectDeltaMush::Packed& mush, const Tile& tile, const MatrixRows* palette,
                const DualQuaternion* rotations) {
  HWY_ALIGN float rest[kBlockFloats] = {};
  HWY_ALIGN float positions[kBlockFloats];
  for (std::size_t b = tile.begin; b < tile.end; ++b) {
    const auto& block = mush.blocks[b];
    const std::size_t at = (b - tile.begin) * kBlockFloats;
    const std::size_t left = static_cast<std::size_t>(mush.vertex_count) - b * kBlock;
    const bool full = left >= kBlock;
    const float* from = tile.rest + at;
    if (!full) {
      std::memcpy(rest, from, 3 * left * sizeof(float));
      from = rest;
    }
    float* const to = full ? tile.positions + at : positions;
    for (int lane = 0; lane < kBlock; lane += kLanes) {
      const Group group{mush.vertices.get() + b * mush.vertex_width() * kBlock + lane,
                        mush.omega.get() + block.omega + lane, mush.joints.data() + block.first_joint,
                        block.joint_count};
      run_group<variant>(group, palette, rotations, from + 3 * lane, to + 3 * lane);
    }
    if (!full) std::memcpy(tile.positions + at, positions, 3 * left * sizeof(float));
  }
}

void direct_delta_mush_blocks(const DirectDeltaMush::Packed& mush, const Tile& tile, const MatrixRows* palette,
                              const DualQuaternion* rotations) {
  switch (mush.variant) {
    case 0:
      return run_blocks<0>(mush, tile, palette, rotations);
    case 1:
      return run_blocks<1>(mush, tile, palette, rotations);
    case 2:
      return run_blocks<2>(mush, tile, palette, rotations);
    case 3:
      return run_blocks<3>(mush, tile, palette, rotations);
    case 4:
      return run_blocks<4>(mush, tile, palette, rotations);
    case 5:
      return run_blocks<5>(mush, tile, palette, rotations);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sinew {

HWY_EXPORT(direct_delta_mush_blocks);

void direct_delta_mush_blocks(const DirectDeltaMush::Packed& mush, const Tile& tile, const MatrixRows* palette,
                              const DualQuaternion* rotations) {
  HWY_DYNAMIC_DISPATCH(direct_delta_mush_blocks)(mush, tile, palette, rotations);
}

void turn_by_nearest_rotation(const float* matrix, const float* vector, float* out) {
  using RowMajor = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;
  Eigen::Matrix3d a = Eigen::Map<const RowMajor>(matrix).cast<double>();
  const double size = a.norm();
  const Eigen::Vector3d given = Eigen::Map<const Eigen::Vector3f>(vector).cast<double>();
  Eigen::Vector3d turned = given;
  if (size > 0 && std::isfinite(size)) {
    a /= size;
    // Horn, "Closed-form solution of absolute orientation using unit quaternions", JOSA A 4(4), 1987.
    Eigen::Matrix4d horn;
    horn << a(0, 0) + a(1, 1) + a(2, 2), a(2, 1) - a(1, 2), a(0, 2) - a(2, 0), a(1, 0) - a(0, 1),  //
        0, a(0, 0) - a(1, 1) - a(2, 2), a(0, 1) + a(1, 0), a(0, 2) + a(2, 0),                      //
        0, 0, a(1, 1) - a(0, 0) - a(2, 2), a(1, 2) + a(2, 1),                                      //
        0, 0, 0, a(2, 2) - a(0, 0) - a(1, 1);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(horn.transpose());  // which reads the lower half
    const Eigen::Vector4d q = solver.eigenvectors().col(3);
    turned = Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * given;
  }
  for (int axis = 0; axis < 3; ++axis) out[axis] = static_cast<float>(turned[axis]);
}

}  // namespace sinew
#endif
