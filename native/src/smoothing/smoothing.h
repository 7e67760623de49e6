/// Shared by the smoothing stages: points in, iterations in pieces, points out.
#pragma once

#include <algorithm>

#include "base/kept.h"
#include "base/parallel.h"
#include "smoothing/neighbourhood.h"

namespace sinew {

/// One frame's smoothing of one mesh.
class Smoothing {
 public:
  /// microseconds  the approximate time of all of it on one thread.
  Smoothing(const Neighbourhood& around, double microseconds, Kept<SmoothingSpace>& spaces)
      : around_(around),
        threads_(threads_pay(microseconds)),
        space_(spaces.borrow([&] { return std::make_unique<SmoothingSpace>(around.point_count()); })),
        from_(space_->from.get()),
        to_(space_->to.get()) {}

  /// positions  V x 3.
  void load(const float* positions) {
    load_by([&](std::size_t begin, std::size_t end, float* points) { around_.gather(positions, begin, end, points); });
  }

  /// points  of the neighbourhood.
  void load_points(const float* points) {
    load_by([&](std::size_t begin, std::size_t end, float* own) {
      std::copy(points + 4 * begin, points + 4 * end, own + 4 * begin);
    });
  }

  /// Calls step(first block, end, from, to) for pieces, iteration by iteration.
  template <class Step>
  void iterate(int iterations, const Step& step) {
    for (int k = 0; k < iterations; ++k) {
      each_piece([&](std::size_t begin, std::size_t end) { step(begin, end, from_, to_); });
      std::swap(from_, to_);
    }
  }

  /// Calls body(first block, end) for pieces.
  template <class Body>
  void each_piece(const Body& body) const {
    parallel_for(around_.block_count(), threads_ ? kBlocksPerPiece : around_.block_count(), body);
  }

  const float* points() const { return from_; }
  /// Not in use between iterations.
  float* other_points() const { return to_; }

  void store(float* positions) const {
    each_piece([&](std::size_t begin, std::size_t end) { around_.scatter(from_, begin, end, positions); });
  }

 private:
  template <class Load>
  void load_by(const Load& load) {
    const std::size_t points = around_.point_count(), lanes = around_.block_count() * kBlock;
    parallel_for(points, threads_ ? kBlocksPerPiece * kBlock : points, [&](std::size_t begin, std::size_t end) {
      load(begin, end, from_);
      if (end > lanes) load(std::max(begin, lanes), end, to_);
    });
  }

  const Neighbourhood& around_;
  bool threads_;
  Kept<SmoothingSpace>::Loan space_;
  float* from_;
  float* to_;
};

}  // namespace sinew
