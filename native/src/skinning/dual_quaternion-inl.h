// Blends and applies dual quaternions. Included once for each instruction set.
#if defined(SINEW_DUAL_QUATERNION_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SINEW_DUAL_QUATERNION_INL_H
#undef SINEW_DUAL_QUATERNION_INL_H
#else
#define SINEW_DUAL_QUATERNION_INL_H
#endif

#include "skinning/kernels-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

// Dividing by less than this gives no usable result.
constexpr float kLeastNormal = 1.17549435e-38f;

/// Calls add(joint, weight) for each joint of a group.
template <bool fetch, class Add>
HWY_INLINE void for_joints(const Group& group, const std::uint32_t* joints, JointSet set, const Add& add) {
  if (set.is_rigid) return add(joints[0], hn::Set(kTag, 1.0f));
  const float* weights = group.weights;
  for (std::uint32_t k = 0; k < set.count; ++k, weights += kBlock) {
    if (fetch) fetch_ahead(weights, 0);
    add(joints[k], hn::Load(kTag, weights));
  }
}

/// Sums the joints' dual quaternions: real part, then dual part, each w x y z.
template <bool fetch>
HWY_INLINE void sum_quaternions(const Group& group, const std::uint32_t* joints, JointSet set,
                                const DualQuaternion* palette, Floats* sum) {
  for (int part = 0; part < 8; ++part) sum[part] = hn::Zero(kTag);
  for_joints<fetch>(group, joints, set, [&](std::uint32_t joint, Floats weight) HWY_ATTR {
    const DualQuaternion& own = palette[joint];
    for (int part = 0; part < 4; ++part) sum[part] = hn::MulAdd(weight, hn::Set(kTag, own.real[part]), sum[part]);
    for (int part = 0; part < 4; ++part) {
      sum[4 + part] = hn::MulAdd(weight, hn::Set(kTag, own.dual[part]), sum[4 + part]);
    }
  });
}

/// Likewise, but each joint moves the point that it has stretched itself.
template <bool fetch>
HWY_INLINE void sum_stretching_quaternions(const Points<1>& point, const Group& group, const std::uint32_t* joints,
                                           JointSet set, const QuaternionJoints& palette, Floats* sum) {
  for (int part = 0; part < 8; ++part) sum[part] = hn::Zero(kTag);
  for_joints<fetch>(group, joints, set, [&](std::uint32_t joint, Floats weight) HWY_ATTR {
    const float* const real = palette.joints[joint].real;
    for (int part = 0; part < 4; ++part) sum[part] = hn::MulAdd(weight, hn::Set(kTag, real[part]), sum[part]);
    for (int part = 0; part < 4; ++part) {
      Floats dual;
      transform<1>(palette.dual_parts[joint].row[part], point, &dual);
      sum[4 + part] = hn::MulAdd(weight, dual, sum[4 + part]);
    }
  });
}

/// Moves points, or directions, by the mean of the displacements by the joints' stretches.
template <bool are_points, bool fetch>
HWY_INLINE void stretch(const Group& group, const std::uint32_t* joints, JointSet set, const MatrixRows* displacements,
                        Points<1>& points) {
  Floats sum[3] = {hn::Zero(kTag), hn::Zero(kTag), hn::Zero(kTag)};
  Floats weights = hn::Zero(kTag);
  for_joints<fetch>(group, joints, set, [&](std::uint32_t joint, Floats weight) HWY_ATTR {
    weights = hn::Add(weights, weight);
    for (int axis = 0; axis < 3; ++axis) {
      const float* const row = displacements[joint].row[axis];
      Floats moved = are_points ? hn::Set(kTag, row[3]) : hn::Zero(kTag);
      moved = hn::MulAdd(hn::Set(kTag, row[2]), points.z[0], moved);
      moved = hn::MulAdd(hn::Set(kTag, row[1]), points.y[0], moved);
      moved = hn::MulAdd(hn::Set(kTag, row[0]), points.x[0], moved);
      sum[axis] = hn::MulAdd(weight, moved, sum[axis]);
    }
  });
  const auto usable = hn::Ge(weights, hn::Set(kTag, kLeastNormal));
  const Floats scale = hn::IfThenElseZero(usable, hn::Div(hn::Set(kTag, 1.0f), weights));
  points.x[0] = hn::MulAdd(scale, sum[0], points.x[0]);
  points.y[0] = hn::MulAdd(scale, sum[1], points.y[0]);
  points.z[0] = hn::MulAdd(scale, sum[2], points.z[0]);
}

/// Returns 2 / |r|^2 for a real part w x y z that is not normalised; 0 where rotations cancel or
/// weights are nearly 0: then no direction is right, and nothing turns.
HWY_INLINE Floats two_over_norm2(const Floats* real) {
  const Floats norm2 = hn::MulAdd(
      real[0], real[0], hn::MulAdd(real[1], real[1], hn::MulAdd(real[2], real[2], hn::Mul(real[3], real[3]))));
  const auto usable = hn::Ge(norm2, hn::Set(kTag, kLeastNormal));
  return hn::IfThenElseZero(usable, hn::Div(hn::Set(kTag, 2.0f), norm2));
}

/// a d - c b
HWY_INLINE Floats cross(Floats a, Floats b, Floats c, Floats d) { return hn::NegMulAdd(c, b, hn::Mul(a, d)); }

/// Applies summed dual quaternions as in Kavan 2008, algorithm 1, with a real part that is not yet
/// normalised: p + 2 / |r|^2 (r x (r x p + w p + d) + w d - d_w r).
HWY_INLINE void apply_dual_quaternions(const Floats* sum, Floats px, Floats py, Floats pz, Floats& x, Floats& y,
                                       Floats& z) {
  const Floats rw = sum[0], rx = sum[1], ry = sum[2], rz = sum[3];
  const Floats dw = sum[4], dx = sum[5], dy = sum[6], dz = sum[7];
  const Floats scale = two_over_norm2(sum);
  const Floats tx = hn::Add(hn::MulAdd(rw, px, dx), cross(ry, py, rz, pz));
  const Floats ty = hn::Add(hn::MulAdd(rw, py, dy), cross(rz, pz, rx, px));
  const Floats tz = hn::Add(hn::MulAdd(rw, pz, dz), cross(rx, px, ry, py));
  const auto applied = [&](Floats p, Floats turned, Floats d, Floats r)
                           HWY_ATTR { return hn::MulAdd(scale, hn::MulAdd(rw, d, hn::NegMulAdd(dw, r, turned)), p); };
  x = applied(px, cross(ry, ty, rz, tz), dx, rx);
  y = applied(py, cross(rz, tz, rx, tx), dy, ry);
  z = applied(pz, cross(rx, tx, ry, ty), dz, rz);
}

/// Which joints stretch, and when.
enum class Stretching { none, first, each };

/// Calls run<stretching>() for a set whose vertices are not blended one by one. Each kind of stretching gets its own
/// loop, so that the loop for rigid joints keeps its registers.
template <class Run>
HWY_INLINE void with_stretching(SetWay way, const QuaternionJoints& palette, const Run& run) {
  if (way == SetWay::rigid) return run.template operator()<Stretching::none>();
  if (palette.dual_parts) return run.template operator()<Stretching::each>();
  run.template operator()<Stretching::first>();
}

/// Moves a group's points by the blended motions of its joints.
template <Stretching stretching, bool fetch>
HWY_INLINE void move_by_dual_quaternions(Points<1> points, const Group& group, const std::uint32_t* joints,
                                         JointSet set, const QuaternionJoints& palette, Floats& x, Floats& y,
                                         Floats& z) {
  Floats sum[8];
  if constexpr (stretching == Stretching::each) {
    sum_stretching_quaternions<fetch>(points, group, joints, set, palette, sum);
  } else {
    if constexpr (stretching == Stretching::first) {
      stretch<true, false>(group, joints, set, palette.displacements, points);
    }
    sum_quaternions<fetch>(group, joints, set, palette.joints, sum);
  }
  apply_dual_quaternions(sum, points.x[0], points.y[0], points.z[0], x, y, z);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew
HWY_AFTER_NAMESPACE();
#endif
