// Highway compiles this file once for each instruction set, and CMakeLists.txt has it compiled
// without fused multiply-adds: Blender rounds in between.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smoothing/smoothing_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes first.
#include <hwy/highway.h>

#include "base/vectors-inl.h"
#include "smoothing/smoothing_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

using Tag = hn::CappedTag<float, kBlock>;
using Floats = hn::Vec<Tag>;
using Mask = hn::Mask<Tag>;

constexpr Tag kTag;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kTag));

// Blender's limits: a vector with a squared length below kShortest has no direction; sides that differ by
// less than kEpsilon are straight, and sums of lengths below it count as 0.
constexpr float kShortest = 1e-35f, kEpsilon = 1.1920929e-6f;

// How many corners of a vertex are kept between summing their angles and using them. For vertices with
// more, the others are computed twice.
constexpr std::size_t kKeptCorners = 12;

using Vectors = VectorsOf<Floats>;

HWY_INLINE Floats number(float value) { return hn::Set(kTag, value); }

HWY_INLINE Vectors nothing() { return zeros(kTag); }

HWY_INLINE Vectors normalized(const Vectors& a) { return directions(kTag, a, kShortest); }

#if HWY_TARGET == HWY_SCALAR
/// Returns the point at a place.
HWY_INLINE Vectors points_at(const float* points, const std::uint32_t* places) {
  const float* point = points + places[0];
  return {number(point[0]), number(point[1]), number(point[2])};
}
#else
/// Loads four floats at every fourth of the places.
template <class D>
HWY_INLINE hn::Vec<D> every_fourth(D d, const float* points, const std::uint32_t* places) {
  if constexpr (hn::MaxLanes(d) == 4) {
    return hn::Load(d, points + places[0]);
  } else {
    constexpr hn::Half<D> half;
    return hn::Combine(d, every_fourth(half, points, places + hn::MaxLanes(half)), every_fourth(half, points, places));
  }
}

/// Returns the points at kLanes places.
HWY_INLINE Vectors points_at(const float* points, const std::uint32_t* places) {
  const Floats p0 = every_fourth(kTag, points, places);
  const Floats p1 = every_fourth(kTag, points, places + 1);
  const Floats p2 = every_fourth(kTag, points, places + 2);
  const Floats p3 = every_fourth(kTag, points, places + 3);
  const Floats xy02 = hn::InterleaveLower(kTag, p0, p2), z02 = hn::InterleaveUpper(kTag, p0, p2);
  const Floats xy13 = hn::InterleaveLower(kTag, p1, p3), z13 = hn::InterleaveUpper(kTag, p1, p3);
  return {hn::InterleaveLower(kTag, xy02, xy13), hn::InterleaveUpper(kTag, xy02, xy13),
          hn::InterleaveLower(kTag, z02, z13)};
}

#endif

/// Loads consecutive points.
HWY_INLINE Vectors points_from(const float* points) {
  Vectors result;
  Floats fourth;
  hn::LoadInterleaved4(kTag, points, result.x, result.y, result.z, fourth);
  return result;
}

HWY_INLINE void store(const Vectors& vectors, float* points) {
  hn::StoreInterleaved4(vectors.x, vectors.y, vectors.z, hn::Zero(kTag), kTag, points);
}

HWY_INLINE Vectors load_apart(const float* numbers, int stride) {
  return {hn::Load(kTag, numbers), hn::Load(kTag, numbers + stride), hn::Load(kTag, numbers + 2 * stride)};
}

HWY_INLINE void store_apart(const Vectors& vectors, float* numbers, int stride) {
  hn::Store(vectors.x, kTag, numbers);
  hn::Store(vectors.y, kTag, numbers + stride);
  hn::Store(vectors.z, kTag, numbers + 2 * stride);
}

/// Calls run(block, number of the first of kLanes lanes, counted over all blocks).
template <class Run>
HWY_INLINE void each_group(std::size_t begin, std::size_t end, const Run& run) {
  for (std::size_t i = begin * kBlock; i < end * kBlock; i += kLanes) run(i / kBlock, i);
}

/// Calls visit(points of neighbour k of these lanes, k).
template <class Visit>
HWY_INLINE void each_neighbour(const Neighbourhood& around, std::size_t b, std::size_t i, const float* from,
                               const Visit& visit) {
  const std::size_t first = around.neighbour_begin[b];
  const auto count = static_cast<int>(around.neighbour_begin[b + 1] - first);
  for (int k = 0; k < count; ++k) {
    visit(points_at(from, around.neighbours[first + k] + i % kBlock), k);
  }
}

void simple_step(const Neighbourhood& around, std::size_t begin, std::size_t end, float factor, const float* from,
                 float* to) {
  each_group(begin, end, [&](std::size_t b, std::size_t i) HWY_ATTR {
    const Vectors own = points_from(from + 4 * i);
    Vectors sum = nothing();
    each_neighbour(around, b, i, from, [&](const Vectors& other, int) HWY_ATTR { sum = sum + (other - own); });
    const Floats count = hn::LoadU(kTag, around.counts.data() + i);
    const Floats share = hn::Div(number(1), hn::Max(count, number(1)));
    const Floats weight = hn::LoadU(kTag, around.weights.data() + i);
    store(own + sum * hn::Mul(hn::Mul(weight, number(factor)), share), to + 4 * i);
  });
}

void length_step(const Neighbourhood& around, std::size_t begin, std::size_t end, float factor, const float* from,
                 float* to) {
  each_group(begin, end, [&](std::size_t b, std::size_t i) HWY_ATTR {
    const Vectors own = points_from(from + 4 * i);
    Vectors sum = nothing();
    Floats lengths = hn::Zero(kTag);
    each_neighbour(around, b, i, from, [&](const Vectors& other, int) HWY_ATTR {
      const Vectors side = other - own;
      const Floats length = hn::Sqrt(dot(side, side));
      sum = sum + side * length;
      lengths = hn::Add(lengths, length);
    });
    const Floats divisor = hn::Mul(lengths, hn::LoadU(kTag, around.counts.data() + i));
    const Floats weight = hn::LoadU(kTag, around.weights.data() + i);
    const Floats part = hn::Div(hn::Mul(number(2 * factor), weight), divisor);
    const Mask far = hn::Gt(divisor, number(kEpsilon));
    store(choose(far, own + sum * part, own), to + 4 * i);
  });
}

void mean_step(const Neighbourhood& around, std::size_t begin, std::size_t end, const Smooth::Settings& settings,
               const float* from, float* to) {
  each_group(begin, end, [&](std::size_t b, std::size_t i) HWY_ATTR {
    const Vectors own = points_from(from + 4 * i);
    const Floats count = hn::LoadU(kTag, around.counts.data() + i);
    Vectors sum = nothing();
    each_neighbour(around, b, i, from, [&](const Vectors& other, int k) HWY_ATTR {
      const Mask is_one = hn::Lt(number(static_cast<float>(k)), count);
      sum = choose(is_one, sum + (own + other) * number(0.5f), sum);
    });
    const Vectors mean = sum * hn::Div(number(1), hn::Max(count, number(1)));
    const Floats weight = hn::LoadU(kTag, around.weights.data() + i);
    const Floats part = hn::Mul(weight, number(settings.factor));
    const Vectors moved = own * hn::Sub(number(1), part) + mean * part;
    store({settings.x ? moved.x : own.x, settings.y ? moved.y : own.y, settings.z ? moved.z : own.z}, to + 4 * i);
  });
}

/// A corner: the frame of its two sides, both of which point backwards along the face. Straight
/// corners have no frame.
struct Corners {
  Vectors side_in, side_out;
  Vectors x, y, z;
  Mask straight;

  HWY_INLINE Corners(const Neighbourhood::CornerEntry& entry, std::size_t lane, const Vectors& own, const float* points)
      : side_in(normalized(points_at(points, entry.previous + lane) - own)),
        side_out(normalized(own - points_at(points, entry.next + lane))) {
    const Vectors difference = side_in - side_out;
    const Floats epsilon = number(kEpsilon);
    straight = hn::And(hn::And(hn::Le(hn::Abs(difference.x), epsilon), hn::Le(hn::Abs(difference.y), epsilon)),
                       hn::Le(hn::Abs(difference.z), epsilon));
    z = normalized(cross(side_in, side_out));
    x = normalized(side_in + side_out);
    y = cross(z, x);
  }
};

/// Applies the inverse of the frame, or its transpose if it has no inverse.
HWY_INLINE Vectors unframed(const Corners& corners, const Vectors& vector) {
  const Vectors a = cross(corners.y, corners.z), b = cross(corners.z, corners.x), c = cross(corners.x, corners.y);
  const Floats determinant =
      hn::Add(hn::Add(hn::Mul(corners.x.x, a.x), hn::Mul(corners.y.x, b.x)), hn::Mul(corners.z.x, c.x));
  const Mask has_none = hn::Eq(determinant, hn::Zero(kTag));
  const Floats inverse = hn::Div(number(1), determinant);
  const Vectors result{dot(choose(has_none, corners.x, a * inverse), vector),
                       dot(choose(has_none, corners.y, b * inverse), vector),
                       dot(choose(has_none, corners.z, c * inverse), vector)};
  return choose(corners.straight, vector, result);
}

/// Blender's polynomial approximation of the arc cosine.
HWY_INLINE Floats polynomial_angle(Floats cosine) {
  const Floats size = hn::Abs(cosine), one = number(1);
  const Floats most = hn::IfThenElse(hn::Lt(size, one), hn::Sub(one, hn::Sub(one, size)), one);
  Floats sum = hn::Add(number(0.077980478f), hn::Mul(most, number(-0.02164095f)));
  sum = hn::Add(number(-0.213300989f), hn::Mul(most, sum));
  sum = hn::Add(number(1.5707963267f), hn::Mul(most, sum));
  const Floats angle = hn::Mul(hn::Sqrt(hn::Sub(one, most)), sum);
  return hn::IfThenElse(hn::Lt(cosine, hn::Zero(kTag)), hn::Sub(number(3.14159265f), angle), angle);
}

/// Accurate to a few units in the last place; NaN beyond 1.
HWY_INLINE Floats arc_cosine(Floats cosine) {
  const Floats size = hn::Abs(cosine), one = number(1), half = number(0.5f);
  const Mask is_large = hn::Gt(size, half);
  // asin of a number up to 1/2: acos s = 2 asin sqrt((1 - s) / 2).
  const Floats squared = hn::IfThenElse(is_large, hn::Mul(half, hn::Sub(one, size)), hn::Mul(size, size));
  const Floats argument = hn::IfThenElse(is_large, hn::Sqrt(squared), size);
  Floats sum = number(0.03820645064115524f);  // fitted to (asin x / x - 1) / x^2: 9e-9 at most
  for (const float next : {0.026494277641177177f, 0.045010700821876526f, 0.07498808950185776f, 0.16666673123836517f}) {
    sum = hn::Add(number(next), hn::Mul(squared, sum));
  }
  const Floats arc = hn::Add(argument, hn::Mul(hn::Mul(argument, squared), sum));
  const Floats angle = hn::IfThenElse(is_large, hn::Add(arc, arc), hn::Sub(number(1.57079633f), arc));
  return hn::IfThenElse(hn::Lt(cosine, hn::Zero(kTag)), hn::Sub(number(3.14159265f), angle), angle);
}

void measure_losses(const Neighbourhood& around, std::size_t begin, std::size_t end, const float* rest,
                    const float* smooth, float* losses) {
  each_group(begin, end, [&](std::size_t b, std::size_t i) HWY_ATTR {
    const std::size_t lane = i % kBlock;
    const Vectors own = points_from(smooth + 4 * i);
    const Vectors lost = points_from(rest + 4 * i) - own;
    for (std::size_t k = around.corner_begin[b]; k < around.corner_begin[b + 1]; ++k) {
      const Corners corners(around.corners[k], lane, own, smooth);
      store_apart(unframed(corners, lost), losses + 3 * kBlock * k + lane, kBlock);
    }
  });
}

/// A corner's loss, turned with its frame, and its angle.
struct Restored {
  Vectors loss;
  Floats angle;
};

template <CornerAngle kind>
HWY_INLINE Restored restored(const Neighbourhood& around, std::size_t k, std::size_t lane, const Vectors& own,
                             const float* smooth, const float* losses) {
  const Corners corners(around.corners[k], lane, own, smooth);
  const Vectors loss = load_apart(losses + 3 * kBlock * k + lane, kBlock);
  const Floats cosine = dot(corners.side_out, corners.side_in);
  const Floats angle = kind == CornerAngle::polynomial ? polynomial_angle(cosine) : arc_cosine(cosine);
  return {corners.x * loss.x + corners.y * loss.y + corners.z * loss.z,
          hn::IfThenZeroElse(corners.straight, hn::Abs(angle))};
}

template <CornerAngle kind>
void restore(const Neighbourhood& around, std::size_t begin, std::size_t end, const float* smooth, const float* losses,
             float scale, float* to) {
  HWY_ALIGN float kept[kKeptCorners][4][kLanes];
  each_group(begin, end, [&](std::size_t b, std::size_t i) HWY_ATTR {
    const std::size_t lane = i % kBlock;
    const Vectors own = points_from(smooth + 4 * i);
    const std::size_t first = around.corner_begin[b], count = around.corner_begin[b + 1] - first;
    Floats angles = hn::Zero(kTag);
    for (std::size_t k = 0; k < count; ++k) {
      const Restored one = restored<kind>(around, first + k, lane, own, smooth, losses);
      angles = hn::Add(angles, one.angle);
      if (k >= kKeptCorners) continue;
      store_apart(one.loss, kept[k][0], kLanes);
      hn::Store(one.angle, kTag, kept[k][3]);
    }
    Vectors result = own;
    for (std::size_t k = 0; k < count; ++k) {
      const Restored one = k < kKeptCorners ? Restored{load_apart(kept[k][0], kLanes), hn::Load(kTag, kept[k][3])}
                                            : restored<kind>(around, first + k, lane, own, smooth, losses);
      const Floats part = hn::Div(one.angle, angles);
      // False for both 0 / 0 and NaN.
      const Mask counts = hn::Gt(part, hn::Zero(kTag));
      result = choose(counts, result + one.loss * part * number(scale), result);
    }
    store(result, to + 4 * i);
  });
}

void restore_losses(const Neighbourhood& around, std::size_t begin, std::size_t end, const float* smooth,
                    const float* losses, float scale, CornerAngle angle, float* to) {
  angle == CornerAngle::polynomial ? restore<CornerAngle::polynomial>(around, begin, end, smooth, losses, scale, to)
                                   : restore<CornerAngle::arc_cosine>(around, begin, end, smooth, losses, scale, to);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sinew {

HWY_EXPORT(simple_step);
HWY_EXPORT(length_step);
HWY_EXPORT(mean_step);
HWY_EXPORT(measure_losses);
HWY_EXPORT(restore_losses);

void simple_step(const Neighbourhood& around, std::size_t begin, std::size_t end, float factor, const float* from,
                 float* to) {
  HWY_DYNAMIC_DISPATCH(simple_step)(around, begin, end, factor, from, to);
}

void length_step(const Neighbourhood& around, std::size_t begin, std::size_t end, float factor, const float* from,
                 float* to) {
  HWY_DYNAMIC_DISPATCH(length_step)(around, begin, end, factor, from, to);
}

void mean_step(const Neighbourhood& around, std::size_t begin, std::size_t end, const Smooth::Settings& settings,
               const float* from, float* to) {
  HWY_DYNAMIC_DISPATCH(mean_step)(around, begin, end, settings, from, to);
}

void measure_losses(const Neighbourhood& around, std::size_t begin, std::size_t end, const float* rest,
                    const float* smooth, float* losses) {
  HWY_DYNAMIC_DISPATCH(measure_losses)(around, begin, end, rest, smooth, losses);
}

void restore_losses(const Neighbourhood& around, std::size_t begin, std::size_t end, const float* smooth,
                    const float* losses, float scale, CornerAngle angle, float* to) {
  HWY_DYNAMIC_DISPATCH(restore_losses)(around, begin, end, smooth, losses, scale, angle, to);
}

}  // namespace sinew
#endif
