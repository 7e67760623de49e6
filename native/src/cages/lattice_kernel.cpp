// Highway compiles this file once for each instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cages/lattice_kernel.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes first.
#include <hwy/highway.h>

#include <algorithm>

#include "cages/lattice_kernel.h"

// CMakeLists.txt has this file compiled without fused multiply-adds, where it does not ask for them: the cell of a place
// has to be Blender's.

HWY_BEFORE_NAMESPACE();
namespace sinew {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kNumbers = LatticeField::kNumbers, kMost = LatticeField::kMost, kVertices = 16;

using Several = hn::CappedTag<float, kVertices>;
using Row = hn::CappedTag<float, kMost * kNumbers>;
using Point = hn::CappedTag<float, kNumbers>;

/// Where vertices are along an axis.
struct Along {
  alignas(64) std::int32_t cells[kVertices];
  alignas(64) float weights[kMost][kVertices];  // of the points around
};

HWY_INLINE void find_cells(const LatticeField::Axis& axis, const float (*HWY_RESTRICT points)[kVertices],
                           Along& along) {
  constexpr Several d;
  constexpr hn::Rebind<std::int32_t, Several> integers;
  const auto lowest = hn::Set(d, axis.lowest), highest = hn::Set(d, axis.highest);
  for (std::size_t i = 0; i < kVertices; i += hn::MaxLanes(d)) {
    auto place = hn::Add(hn::Mul(hn::Load(d, points[0] + i), hn::Set(d, axis.from_mesh[0])),
                         hn::Mul(hn::Load(d, points[1] + i), hn::Set(d, axis.from_mesh[1])));
    place = hn::Add(place, hn::Mul(hn::Set(d, axis.from_mesh[2]), hn::Load(d, points[2] + i)));
    place = hn::Add(place, hn::Set(d, axis.from_mesh[3]));
    auto steps = hn::Div(hn::Sub(place, hn::Set(d, axis.first)), hn::Set(d, axis.step));
    steps = hn::IfThenElse(hn::Ge(steps, lowest), steps, lowest);  // also what is not a number
    steps = hn::IfThenElse(hn::Gt(steps, highest), highest, steps);
    const auto cell = hn::Floor(steps);
    const auto t = hn::Sub(steps, cell);
    hn::Store(hn::ConvertTo(integers, cell), integers, along.cells + i);
    for (std::size_t k = 0; k < axis.taps; ++k) {
      auto weight = hn::Set(d, axis.weights[3][k]);
      for (int power = 2; power >= 0; --power) {
        weight = hn::Add(hn::Set(d, axis.weights[power][k]), hn::Mul(t, weight));
      }
      hn::Store(weight, d, along.weights[k] + i);
    }
  }
}

/// Sums over rows of so many registers. points: the first that has an effect; sum: kNumbers floats.
template <std::size_t registers>
HWY_INLINE void sum_around(const LatticeField& field, const float* HWY_RESTRICT points, const Along* along,
                           std::size_t i, float* HWY_RESTRICT sum) {
  constexpr Row d;
  constexpr std::size_t kLanes = hn::MaxLanes(d);
  const auto& [u, v, w] = field.axes;
  hn::Vec<Row> totals[registers];
  for (auto& total : totals) total = hn::Zero(d);
  for (std::size_t k = 0; k < w.taps; ++k) {
    hn::Vec<Row> layer[registers];
    for (auto& part : layer) part = hn::Zero(d);
    for (std::size_t j = 0; j < v.taps; ++j) {
      const float* row = points + k * w.stride + j * v.stride;
      const auto weight = hn::Set(d, along[1].weights[j][i]);
      for (std::size_t r = 0; r < registers; ++r) {
        layer[r] = hn::MulAdd(weight, hn::LoadU(d, row + r * kLanes), layer[r]);
      }
    }
    const auto weight = hn::Set(d, along[2].weights[k][i]);
    for (std::size_t r = 0; r < registers; ++r) totals[r] = hn::MulAdd(weight, layer[r], totals[r]);
  }
  alignas(64) float of_points[kMost * kNumbers] = {};
  for (std::size_t r = 0; r < registers; ++r) hn::Store(totals[r], d, of_points + r * kLanes);
  constexpr Point point;
  for (std::size_t n = 0; n < kNumbers; n += hn::MaxLanes(point)) {
    auto total = hn::Zero(point);
    for (std::size_t k = 0; k < u.taps; ++k) {
      total = hn::MulAdd(hn::Set(point, along[0].weights[k][i]), hn::Load(point, of_points + k * kNumbers + n), total);
    }
    hn::Store(total, point, sum + n);
  }
}

template <std::size_t registers>
void move_with(const LatticeField& field, std::span<const std::uint32_t> vertices, const float* HWY_RESTRICT weights,
               float strength, float* HWY_RESTRICT positions) {
  alignas(64) float points[3][kVertices] = {};
  Along along[3];
  for (std::size_t begin = 0; begin < vertices.size(); begin += kVertices) {
    const std::size_t count = std::min(kVertices, vertices.size() - begin);
    for (std::size_t i = 0; i < count; ++i) {
      const float* position = positions + 3 * std::size_t{vertices[begin + i]};
      for (std::size_t axis = 0; axis < 3; ++axis) points[axis][i] = position[axis];
    }
    for (std::size_t axis = 0; axis < 3; ++axis) find_cells(field.axes[axis], points, along[axis]);
    for (std::size_t i = 0; i < count; ++i) {
      const float* first = field.points.data();
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const LatticeField::Axis& own = field.axes[axis];
        first += (along[axis].cells[i] - own.before) * static_cast<std::ptrdiff_t>(own.stride);
      }
      alignas(64) float sum[kNumbers];
      sum_around<registers>(field, first, along, i, sum);
      const float share = weights[begin + i] * strength;
      float* position = positions + 3 * std::size_t{vertices[begin + i]};
      const float kept = sum[3] * share;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const float moved = position[axis] + sum[axis] * share;
        position[axis] = field.has_weights ? (1 - kept) * position[axis] + kept * moved : moved;
      }
    }
  }
}

void move(const LatticeField& field, std::span<const std::uint32_t> vertices, const float* weights, float strength,
          float* positions) {
  constexpr std::size_t kLanes = hn::MaxLanes(Row());
  switch ((field.axes[0].taps * kNumbers + kLanes - 1) / kLanes) {
    case 1:
      return move_with<1>(field, vertices, weights, strength, positions);
    case 2:
      return move_with<std::min<std::size_t>(2, kMost * kNumbers / kLanes)>(field, vertices, weights, strength,
                                                                            positions);
    default:
      return move_with<kMost * kNumbers / kLanes>(field, vertices, weights, strength, positions);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace sinew
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sinew {

HWY_EXPORT(move);

void move_vertices(const LatticeField& field, std::span<const std::uint32_t> vertices, const float* weights,
                   float strength, float* positions) {
  HWY_DYNAMIC_DISPATCH(move)(field, vertices, weights, strength, positions);
}

}  // namespace sinew
#endif
