/// The rotation nearest to a matrix, for several matrices at once. To be included by what Highway compiles for each
/// instruction set, inside of its namespace: no include guard of the usual kind.
#if defined(SINEW_NEAREST_ROTATION_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SINEW_NEAREST_ROTATION_H
#undef SINEW_NEAREST_ROTATION_H
#else
#define SINEW_NEAREST_ROTATION_H
#endif
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// w x y z per lane.
template <class V>
struct Quaternions {
  V w, x, y, z;
};

template <class V>
HWY_INLINE V sum_of_products(V a, V b, V c, V d, V e, V f) {
  return hn::MulAdd(a, b, hn::MulAdd(c, d, hn::Mul(e, f)));
}

template <class V>
HWY_INLINE V difference_of_products(V a, V b, V c, V d) {  // a b - c d
  return hn::MulSub(a, b, hn::Mul(c, d));
}

/// Computes the cofactors of a, row by row: adj(a) transposed.
template <class V>
HWY_INLINE void cofactors(const V* a, V* out) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      out[3 * i + j] = difference_of_products(a[3 * i1 + j1], a[3 * i2 + j2], a[3 * i1 + j2], a[3 * i2 + j1]);
    }
  }
}

/// Turns a vector t by a unit quaternion q: t + 2 (w r x t + r x (r x t)).
template <class V>
HWY_INLINE void turn(const Quaternions<V>& q, const V* t, V* out) {
  const V ux = difference_of_products(q.y, t[2], q.z, t[1]), uy = difference_of_products(q.z, t[0], q.x, t[2]),
          uz = difference_of_products(q.x, t[1], q.y, t[0]);
  const V dx = hn::MulAdd(q.w, ux, difference_of_products(q.y, uz, q.z, uy));
  const V dy = hn::MulAdd(q.w, uy, difference_of_products(q.z, ux, q.x, uz));
  const V dz = hn::MulAdd(q.w, uz, difference_of_products(q.x, uy, q.y, ux));
  out[0] = hn::Add(t[0], hn::Add(dx, dx));
  out[1] = hn::Add(t[1], hn::Add(dy, dy));
  out[2] = hn::Add(t[2], hn::Add(dz, dz));
}

template <class D, class V>
HWY_INLINE Quaternions<V> normalized(D d, const Quaternions<V>& q) {
  const V norm2 = hn::MulAdd(q.w, q.w, sum_of_products(q.x, q.x, q.y, q.y, q.z, q.z));
  const V scale = hn::Div(hn::Set(d, 1.0f), hn::Sqrt(norm2));
  return {hn::Mul(q.w, scale), hn::Mul(q.x, scale), hn::Mul(q.y, scale), hn::Mul(q.z, scale)};
}

/// Returns the largest root of the characteristic polynomial of Horn's matrix, for a with norm 1: the trace of R^T a.
/// Uses Newton's iteration from above, which cannot miss it.
template <class D, class V>
HWY_INLINE V largest_trace(D d, const V* a) {
  V c[9];
  cofactors(a, c);
  V squares = hn::Zero(d);
  for (int i = 0; i < 9; ++i) squares = hn::MulAdd(c[i], c[i], squares);
  const V eight_det = hn::Mul(hn::Set(d, 8.0f), sum_of_products(a[0], c[0], a[1], c[1], a[2], c[2]));
  const V one = hn::Set(d, 1.0f), two = hn::Set(d, 2.0f), four = hn::Set(d, 4.0f);
  const V constant = hn::NegMulAdd(four, squares, one);
  // (s1 + s2 + s3)^2 <= 1 + 2 sqrt(3 (s1^2 s2^2 + s1^2 s3^2 + s2^2 s3^2)), s the singular values.
  V root = hn::Sqrt(hn::MulAdd(two, hn::Sqrt(hn::Mul(hn::Set(d, 3.0f), squares)), one));
  root = hn::Mul(root, hn::Set(d, 1.000001f));
  for (int i = 0; i < 4; ++i) {
    const V square = hn::Mul(root, root), less = hn::Sub(square, two);  // x^4 - 2 x^2 - 8 det x + constant
    const V value = hn::Add(hn::MulSub(square, less, hn::Mul(eight_det, root)), constant);
    const V slope = hn::MulSub(hn::Mul(four, root), hn::Sub(square, one), eight_det);
    const V step = hn::Div(value, slope);
    // At a double root the slope is 0, and so is the value.
    root = hn::Sub(root, hn::IfThenElseZero(hn::Gt(slope, hn::Set(d, 1e-6f)), step));
  }
  return root;
}

/// Returns the eigenvector of Horn's matrix: the longest column of the adjugate of the matrix minus the eigenvalue.
template <class D, class V>
HWY_INLINE Quaternions<V> eigenvector(D d, const V* a, V value) {
  const V n00 = hn::Sub(hn::Add(a[0], hn::Add(a[4], a[8])), value);
  const V n11 = hn::Sub(hn::Sub(a[0], hn::Add(a[4], a[8])), value);
  const V n22 = hn::Sub(hn::Sub(a[4], hn::Add(a[0], a[8])), value);
  const V n33 = hn::Sub(hn::Sub(a[8], hn::Add(a[0], a[4])), value);
  const V n01 = hn::Sub(a[7], a[5]), n02 = hn::Sub(a[2], a[6]), n03 = hn::Sub(a[3], a[1]);
  const V n12 = hn::Add(a[1], a[3]), n13 = hn::Add(a[2], a[6]), n23 = hn::Add(a[5], a[7]);
  const auto two_by_two = [](V p, V q, V r, V s) HWY_ATTR { return difference_of_products(p, q, r, s); };
  const V s0 = two_by_two(n00, n11, n01, n01), s1 = two_by_two(n00, n12, n01, n02);
  const V s2 = two_by_two(n00, n13, n01, n03), s3 = two_by_two(n01, n12, n11, n02);
  const V s4 = two_by_two(n01, n13, n11, n03), s5 = two_by_two(n02, n13, n12, n03);
  const V c5 = two_by_two(n22, n33, n23, n23), c4 = two_by_two(n12, n33, n13, n23);
  const V c3 = two_by_two(n12, n23, n13, n22), c2 = two_by_two(n02, n33, n03, n23);
  const V c1 = two_by_two(n02, n23, n03, n22);
  const auto expand = [](V p, V q, V r, V s, V t, V u) HWY_ATTR {  // p q - r s + t u
    return hn::MulAdd(p, q, difference_of_products(t, u, r, s));
  };
  const V zero = hn::Zero(d);
  const V b00 = expand(n11, c5, n12, c4, n13, c3), b01 = hn::Sub(zero, expand(n01, c5, n02, c4, n03, c3));
  const V b02 = expand(n13, s5, n23, s4, n33, s3), b03 = hn::Sub(zero, expand(n12, s5, n22, s4, n23, s3));
  const V b11 = expand(n00, c5, n02, c2, n03, c1), b12 = hn::Sub(zero, expand(n03, s5, n23, s2, n33, s1));
  const V b13 = expand(n02, s5, n22, s2, n23, s1), b22 = expand(n03, s4, n13, s2, n33, s0);
  const V b23 = hn::Sub(zero, expand(n02, s4, n12, s2, n23, s0)), b33 = expand(n02, s3, n12, s1, n22, s0);
  Quaternions<V> q{b00, b01, b02, b03};
  V longest = hn::Abs(b00);
  const auto keep_longer = [&](V diagonal, const Quaternions<V>& other) HWY_ATTR {
    const auto longer = hn::Gt(hn::Abs(diagonal), longest);
    longest = hn::IfThenElse(longer, hn::Abs(diagonal), longest);
    q = {hn::IfThenElse(longer, other.w, q.w), hn::IfThenElse(longer, other.x, q.x),
         hn::IfThenElse(longer, other.y, q.y), hn::IfThenElse(longer, other.z, q.z)};
  };
  keep_longer(b11, {b01, b11, b12, b13});
  keep_longer(b22, {b02, b12, b22, b23});
  keep_longer(b33, {b03, b13, b23, b33});
  // Scaled so that the squared length does not underflow, however near the eigenvalues are.
  const V scale = hn::Div(hn::Set(d, 1.0f), hn::Max(longest, hn::Set(d, 1e-30f)));
  return normalized(d,
                    Quaternions<V>{hn::Mul(q.w, scale), hn::Mul(q.x, scale), hn::Mul(q.y, scale), hn::Mul(q.z, scale)});
}

/// Does one step of Newton's iteration for the largest trace of R^T a, on the tangent space of the rotations. Lanes are
/// sure if the step was small, so that its square is left as the error, and if R^T a is at a maximum, of which there is
/// only one.
template <class D, class V>
HWY_INLINE hn::Mask<D> refine(D d, const V* a, float small, Quaternions<V>& q) {
  V s[9];  // R^T a, column by column: q conjugated turns each column of a
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const Quaternions<V> back{q.w, hn::Sub(zero, q.x), hn::Sub(zero, q.y), hn::Sub(zero, q.z)};
  for (int column = 0; column < 3; ++column) {
    const V of_a[3] = {a[column], a[3 + column], a[6 + column]};
    turn(back, of_a, s + 3 * column);
  }
  const auto at = [&](int row, int column) HWY_ATTR { return s[3 * column + row]; };
  const V gx = hn::Sub(at(2, 1), at(1, 2)), gy = hn::Sub(at(0, 2), at(2, 0)), gz = hn::Sub(at(1, 0), at(0, 1));
  const V half = hn::Set(d, -0.5f);
  const V h00 = hn::Add(at(1, 1), at(2, 2)), h11 = hn::Add(at(0, 0), at(2, 2)), h22 = hn::Add(at(0, 0), at(1, 1));
  const V h01 = hn::Mul(half, hn::Add(at(0, 1), at(1, 0))), h02 = hn::Mul(half, hn::Add(at(0, 2), at(2, 0)));
  const V h12 = hn::Mul(half, hn::Add(at(1, 2), at(2, 1)));
  const V i00 = difference_of_products(h11, h22, h12, h12), i01 = difference_of_products(h02, h12, h01, h22);
  const V i02 = difference_of_products(h01, h12, h02, h11), i11 = difference_of_products(h00, h22, h02, h02);
  const V i12 = difference_of_products(h01, h02, h00, h12), i22 = difference_of_products(h00, h11, h01, h01);
  const V det = sum_of_products(h00, i00, h01, i01, h02, i02);
  const V scale = hn::Div(hn::Set(d, 0.5f), det);
  const V x = hn::Mul(scale, sum_of_products(i00, gx, i01, gy, i02, gz));
  const V y = hn::Mul(scale, sum_of_products(i01, gx, i11, gy, i12, gz));
  const V z = hn::Mul(scale, sum_of_products(i02, gx, i12, gy, i22, gz));
  const V step2 = sum_of_products(x, x, y, y, z, z);
  const Quaternions<V> old = q;
  const auto minus = [](V p, V r, V t) HWY_ATTR { return hn::NegMulAdd(p, r, t); };
  q.w = minus(old.x, x, minus(old.y, y, minus(old.z, z, old.w)));
  q.x = hn::MulAdd(old.w, x, hn::MulAdd(old.y, z, minus(old.z, y, old.x)));
  q.y = hn::MulAdd(old.w, y, hn::MulAdd(old.z, x, minus(old.x, z, old.y)));
  q.z = hn::MulAdd(old.w, z, hn::MulAdd(old.x, y, minus(old.y, x, old.z)));
  const V length = hn::Div(one, hn::Sqrt(hn::Add(one, step2)));
  q = {hn::Mul(q.w, length), hn::Mul(q.x, length), hn::Mul(q.y, length), hn::Mul(q.z, length)};
  const V some = hn::Set(d, 1e-5f);
  const auto positive =
      hn::And(hn::And(hn::Gt(h00, some), hn::Gt(i22, hn::Mul(some, some))), hn::Gt(det, hn::Mul(some, some)));
  return hn::And(positive, hn::Lt(step2, hn::Set(d, small)));
}

/// Computes q, the rotation nearest to a, 3 x 3, row by row. Lanes that are not sure have to be computed with more
/// digits: there a is nearly of rank one, nearly a reflection, or 0.
template <class D, class V>
HWY_INLINE hn::Mask<D> nearest_rotation(D d, const V* a, Quaternions<V>& q) {
  V squares = hn::Zero(d);
  for (int i = 0; i < 9; ++i) squares = hn::MulAdd(a[i], a[i], squares);
  const auto is_something = hn::Gt(squares, hn::Set(d, 1e-30f));
  const V scale = hn::Div(hn::Set(d, 1.0f), hn::Sqrt(squares));
  V own[9];
  for (int i = 0; i < 9; ++i) own[i] = hn::Mul(a[i], scale);
  q = eigenvector(d, own, largest_trace(d, own));
  const auto sure = hn::And(refine(d, own, 1e-8f, q), is_something);
  if (HWY_LIKELY(hn::AllTrue(d, sure))) return sure;
  return hn::And(refine(d, own, 1e-6f, q), is_something);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew
HWY_AFTER_NAMESPACE();
#endif
