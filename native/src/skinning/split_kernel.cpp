// Highway compiles this file once for each instruction set, and CMakeLists.txt has it compiled without fused
// multiply-adds. The rotation of a joint that is scaled to 0 along an axis, or mirrored, depends on rounding; and
// whether a joint is rigid, and which rotation to use if its axes are not quite orthogonal, is Blender's choice, too. To
// get the same results, these steps are its steps in float32, with sums in the same order.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "skinning/split_kernel.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes first.
#include <hwy/highway.h>

#include <numbers>

#include "base/vectors-inl.h"
#include "skinning/split_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

using Wide = hn::CappedTag<double, kSplitTogether>;
using Narrow = hn::Rebind<float, Wide>;  // as many lanes
using Doubles = hn::Vec<Wide>;
using Floats = hn::Vec<Narrow>;
using Mask = hn::Mask<Narrow>;

constexpr Wide kWide;
constexpr Narrow kNarrow;

constexpr float kExcessTolerance = 1e-8f;  // squared, of the lengths of a posed frame's axes; Blender's
constexpr float kUnitTolerance = 0.0006f;  // quaternions whose squared length is nearer to 1 stay; Blender's
constexpr float kShortest = 1e-35f;        // squared: shorter vectors have no direction

/// A 3x3 matrix in each lane.
template <class V>
struct Matrices {
  VectorsOf<V> x, y, z;  // columns
};

/// w x y z in each lane.
template <class V>
struct Quaternions {
  V w;
  VectorsOf<V> v;
};

HWY_INLINE Floats number(float value) { return hn::Set(kNarrow, value); }

HWY_INLINE Doubles wide(Floats a) { return hn::PromoteTo(kWide, a); }
HWY_INLINE Floats narrow(Doubles a) { return hn::DemoteTo(kNarrow, a); }
HWY_INLINE VectorsOf<Doubles> wide(const VectorsOf<Floats>& a) { return {wide(a.x), wide(a.y), wide(a.z)}; }
HWY_INLINE VectorsOf<Floats> narrow(const VectorsOf<Doubles>& a) { return {narrow(a.x), narrow(a.y), narrow(a.z)}; }

HWY_INLINE Matrices<Doubles> wide(const Matrices<Floats>& m) { return {wide(m.x), wide(m.y), wide(m.z)}; }
HWY_INLINE Matrices<Floats> narrow(const Matrices<Doubles>& m) { return {narrow(m.x), narrow(m.y), narrow(m.z)}; }

template <class V>
HWY_INLINE VectorsOf<V> operator*(const Matrices<V>& m, const VectorsOf<V>& v) {
  return (m.x * v.x + m.y * v.y) + m.z * v.z;
}

template <class V>
HWY_INLINE Matrices<V> operator*(const Matrices<V>& a, const Matrices<V>& b) {
  return {a * b.x, a * b.y, a * b.z};
}

/// Returns m v + translation.
template <class V>
HWY_INLINE VectorsOf<V> moved(const Matrices<V>& m, const VectorsOf<V>& translation, const VectorsOf<V>& v) {
  return (m.x * v.x + m.y * v.y) + (m.z * v.z + translation);
}

template <class V>
HWY_INLINE Matrices<V> choose(Mask mask, const Matrices<V>& yes, const Matrices<V>& no) {
  return {choose(mask, yes.x, no.x), choose(mask, yes.y, no.y), choose(mask, yes.z, no.z)};
}

/// Of a matrix that has one.
HWY_INLINE Matrices<Doubles> inverse(const Matrices<Doubles>& m) {
  const VectorsOf<Doubles> a = cross(m.y, m.z), b = cross(m.z, m.x),
                           c = cross(m.x, m.y);  // rows, times the determinant
  const Doubles share = hn::Div(hn::Set(kWide, 1), dot(m.x, a));
  return {{hn::Mul(a.x, share), hn::Mul(b.x, share), hn::Mul(c.x, share)},
          {hn::Mul(a.y, share), hn::Mul(b.y, share), hn::Mul(c.y, share)},
          {hn::Mul(a.z, share), hn::Mul(b.z, share), hn::Mul(c.z, share)}};
}

HWY_INLINE VectorsOf<Floats> lengths_of_columns(const Matrices<Floats>& m) {
  return {hn::Sqrt(dot(m.x, m.x)), hn::Sqrt(dot(m.y, m.y)), hn::Sqrt(dot(m.z, m.z))};
}

HWY_INLINE Mask is_near(Floats a, float value) {
  return hn::Le(hn::Abs(hn::Sub(a, number(value))), number(kRigidTolerance));
}

HWY_INLINE Mask is_rotation(const Matrices<Floats>& m) {
  const Mask lengths =
      hn::And(hn::And(is_near(dot(m.x, m.x), 1), is_near(dot(m.y, m.y), 1)), is_near(dot(m.z, m.z), 1));
  const Mask angles = hn::And(hn::And(is_near(dot(m.y, m.x), 0), is_near(dot(m.z, m.x), 0)), is_near(dot(m.z, m.y), 0));
  return hn::And(hn::And(lengths, angles), hn::Gt(dot(m.x, cross(m.y, m.z)), hn::Zero(kNarrow)));
}

/// Returns orthogonal axes as long as the given ones; Y keeps its direction. The two comparisons use
/// numbers that are not normalised; they are Blender's, and so is the choice that follows.
HWY_INLINE Matrices<Floats> axes_along_y(const Matrices<Floats>& m) {
  const auto direction = [](const VectorsOf<Floats>& v) HWY_ATTR { return directions(kNarrow, v, kShortest); };
  const VectorsOf<Floats> y = direction(m.y);
  const VectorsOf<Floats> z_of_x = direction(cross(m.x, y)), x_of_x = cross(y, z_of_x);
  const Mask z_serves = hn::Lt(dot(m.x, m.z), number(1));
  const VectorsOf<Floats> turned{y.y, y.z, y.x};
  const VectorsOf<Floats> x_of_z = direction(cross(y, choose(z_serves, m.z, turned))), z_of_z = cross(x_of_z, y);
  const Mask x_serves = hn::Lt(dot(y, m.x), number(1));
  const VectorsOf<Floats> lengths = lengths_of_columns(m);
  return {choose(x_serves, x_of_x, x_of_z) * lengths.x, y * lengths.y, choose(x_serves, z_of_x, z_of_z) * lengths.z};
}

/// Returns the rotation of axes, which are normalised here and may be zero; no rotation if all are. Day,
/// "Converting a rotation matrix to a quaternion", Insomniac Games: of the four possible sums, takes the
/// root of one that cannot be small.
HWY_INLINE Quaternions<Floats> quaternion_of(const Matrices<Floats>& axes) {
  const VectorsOf<Floats> x = directions(kNarrow, axes.x, kShortest), y = directions(kNarrow, axes.y, kShortest),
                          z = directions(kNarrow, axes.z, kShortest);
  const Floats one = number(1), none = hn::Zero(kNarrow);
  const Floats xx = x.x, yy = y.y, zz = z.z;
  const Floats yz = hn::Sub(y.z, z.y), zx = hn::Sub(z.x, x.z), xy = hn::Sub(x.y, y.x);
  const Floats xy2 = hn::Add(x.y, y.x), yz2 = hn::Add(y.z, z.y), zx2 = hn::Add(x.z, z.x);
  const Mask down = hn::Lt(zz, none);
  const Mask is_x = hn::And(down, hn::Gt(xx, yy)), is_y = hn::AndNot(is_x, down);
  const Mask is_z = hn::AndNot(down, hn::Lt(xx, hn::Neg(yy)));
  const auto plus = [](Mask mask, Floats sum, Floats part)
                        HWY_ATTR { return hn::IfThenElse(mask, hn::Add(sum, part), hn::Sub(sum, part)); };
  const auto of_four = [&](Floats of_x, Floats of_y, Floats of_z, Floats of_w) HWY_ATTR {
    return hn::IfThenElse(is_x, of_x, hn::IfThenElse(is_y, of_y, hn::IfThenElse(is_z, of_z, of_w)));
  };
  const Mask is_w = hn::Not(hn::Or(hn::Or(is_x, is_y), is_z));
  const Floats sum = plus(hn::Or(is_z, is_w), plus(hn::Or(is_y, is_w), plus(hn::Or(is_x, is_w), one, xx), yy), zz);
  const Floats root = hn::Mul(number(2), hn::Sqrt(sum));
  const Floats s = hn::IfThenElse(hn::Lt(of_four(yz, zx, xy, one), none), hn::Neg(root), root);
  const Floats t = hn::Div(one, s), quarter = hn::Mul(number(0.25f), s);
  const Floats by_yz = hn::Mul(yz, t), by_zx = hn::Mul(zx, t), by_xy = hn::Mul(xy, t);
  const Floats by_xy2 = hn::Mul(xy2, t), by_yz2 = hn::Mul(yz2, t), by_zx2 = hn::Mul(zx2, t);
  const Quaternions<Floats> q{of_four(by_yz, by_zx, by_xy, quarter),
                              {of_four(quarter, by_xy2, by_zx2, by_yz), of_four(by_xy2, quarter, by_yz2, by_zx),
                               of_four(by_zx2, by_yz2, quarter, by_xy)}};
  Floats squared = hn::Add(hn::Mul(q.w, q.w), hn::Mul(q.v.x, q.v.x));
  squared = hn::Add(hn::Add(squared, hn::Mul(q.v.y, q.v.y)), hn::Mul(q.v.z, q.v.z));
  const Mask is_off = hn::Ge(hn::Abs(hn::Sub(squared, one)), number(kUnitTolerance));
  const Floats share = hn::IfThenElse(is_off, hn::Div(one, hn::Sqrt(squared)), one);
  return {hn::Mul(q.w, share), q.v * share};
}

/// Returns the matrix of a rotation.
HWY_INLINE Matrices<Doubles> rotation_of(const Quaternions<Doubles>& q) {
  const Doubles one = hn::Set(kWide, 1), sqrt2 = hn::Set(kWide, std::numbers::sqrt2);
  const VectorsOf<Doubles> v = q.v * sqrt2;
  const VectorsOf<Doubles> by_w = v * hn::Mul(q.w, sqrt2), by_x = v * v.x, by_y = v * v.y;
  const Doubles zz = hn::Mul(v.z, v.z);
  return {{hn::Sub(hn::Sub(one, by_y.y), zz), hn::Add(by_w.z, by_x.y), hn::Sub(by_x.z, by_w.y)},
          {hn::Sub(by_x.y, by_w.z), hn::Sub(hn::Sub(one, by_x.x), zz), hn::Add(by_w.x, by_y.z)},
          {hn::Add(by_w.y, by_x.z), hn::Sub(by_y.z, by_w.x), hn::Sub(hn::Sub(one, by_x.x), by_y.y)}};
}

template <class D>
HWY_INLINE VectorsOf<hn::Vec<D>> load_column(D d, const OfEach<hn::TFromD<D>> (&rows)[3][4], int column,
                                             std::size_t first) {
  const auto load = [&](int row) HWY_ATTR { return hn::Load(d, rows[row][column].joint + first); };
  return {load(0), load(1), load(2)};
}

template <class D>
HWY_INLINE Matrices<hn::Vec<D>> load_linear(D d, const OfEach<hn::TFromD<D>> (&rows)[3][4], std::size_t first) {
  return {load_column(d, rows, 0, first), load_column(d, rows, 1, first), load_column(d, rows, 2, first)};
}

HWY_INLINE void store(const VectorsOf<Floats>& column, int number, std::size_t first, OfEach<float> (&rows)[3][4]) {
  hn::Store(column.x, kNarrow, rows[0][number].joint + first);
  hn::Store(column.y, kNarrow, rows[1][number].joint + first);
  hn::Store(column.z, kNarrow, rows[2][number].joint + first);
}

HWY_INLINE void store(const Quaternions<Floats>& q, std::size_t first, OfEach<float> (&parts)[4]) {
  hn::Store(q.w, kNarrow, parts[0].joint + first);
  hn::Store(q.v.x, kNarrow, parts[1].joint + first);
  hn::Store(q.v.y, kNarrow, parts[2].joint + first);
  hn::Store(q.v.z, kNarrow, parts[3].joint + first);
}

/// Returns the dual part of a motion: half of (0, translation) * rotation.
HWY_INLINE Quaternions<Floats> dual_of(const Quaternions<Floats>& rotation, const VectorsOf<Doubles>& translation) {
  const VectorsOf<Doubles> half = translation * hn::Set(kWide, 0.5), v = wide(rotation.v);
  return {narrow(hn::Neg(dot(half, v))), narrow(half * wide(rotation.w) + cross(half, v))};
}

/// Splits the joints from `first` on, as many as there are lanes.
HWY_INLINE void split_some(const MotionsToSplit& motions, std::size_t first, SplitMotions& split) {
  const Matrices<Floats> matrix = load_linear(kNarrow, motions.matrix, first);
  const VectorsOf<Floats> translation = load_column(kNarrow, motions.matrix, 3, first);
  const Matrices<Doubles> rest = load_linear(kWide, motions.rest, first);
  const VectorsOf<Doubles> origin = load_column(kWide, motions.rest, 3, first);
  const Matrices<Floats> base = narrow(rest);
  const VectorsOf<Floats> base_origin = narrow(origin);

  const Matrices<Floats> posed = matrix * base;
  const VectorsOf<Floats> posed_origin = moved(matrix, translation, base_origin);
  const VectorsOf<Floats> excess = lengths_of_columns(posed) - VectorsOf<Floats>{number(1), number(1), number(1)};
  const Mask is_rigid = hn::And(is_rotation(matrix), hn::Le(dot(excess, excess), number(kExcessTolerance)));

  const Quaternions<Floats> turn = quaternion_of(axes_along_y(posed));
  const Matrices<Floats> rigid = narrow(rotation_of({wide(turn.w), wide(turn.v)}));
  const Matrices<Doubles> stretch = rest * (inverse(wide(rigid)) * wide(posed)) * inverse(rest);
  const Doubles one = hn::Set(kWide, 1);
  const Matrices<Doubles> displacement{{hn::Sub(stretch.x.x, one), stretch.x.y, stretch.x.z},
                                       {stretch.y.x, hn::Sub(stretch.y.y, one), stretch.y.z},
                                       {stretch.z.x, stretch.z.y, hn::Sub(stretch.z.z, one)}};
  const VectorsOf<Floats> none = zeros(kNarrow);
  const Matrices<Floats> moves = choose(is_rigid, Matrices<Floats>{none, none, none}, narrow(displacement));
  store(moves.x, 0, first, split.displacement);
  store(moves.y, 1, first, split.displacement);
  store(moves.z, 2, first, split.displacement);
  store(choose(is_rigid, none, narrow(zeros(kWide) - displacement * origin)), 3, first, split.displacement);

  const VectorsOf<Floats> moved_by = moved(rigid, posed_origin, load_column(kNarrow, motions.from_rest, 3, first));
  const Matrices<Floats> moved_axes = rigid * load_linear(kNarrow, motions.from_rest, first);
  const Quaternions<Floats> real = quaternion_of(choose(is_rigid, matrix, moved_axes));
  const Quaternions<Floats> dual = dual_of(real, wide(choose(is_rigid, translation, moved_by)));
  store(real, first, split.real);
  store(dual, first, split.dual);
  hn::Store(hn::IfThenElseZero(is_rigid, number(1)), kNarrow, split.is_rigid.joint + first);
}

void split_motions(const MotionsToSplit& motions, SplitMotions& split) {
  for (std::size_t first = 0; first < kSplitTogether; first += hn::Lanes(kWide)) split_some(motions, first, split);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sinew {

HWY_EXPORT(split_motions);

void split_motions(const MotionsToSplit& motions, SplitMotions& split) {
  HWY_DYNAMIC_DISPATCH(split_motions)(motions, split);
}

}  // namespace sinew
#endif
