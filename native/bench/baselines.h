/// What the library is measured against.
#pragma once

#include <span>

#include "characters.h"
#include "skinning/blocked_skin.h"

namespace sinew::bench {

/// The student report's skinning: every joint for every vertex, zero weight or not, in double, by
/// 4x4 products. positions (V, 3) out. With `threads` > 0 as its parallel version: vertices dealt
/// by tbb::parallel_for.
void report_skin(const Character& character, std::ptrdiff_t frame, Eigen::MatrixXd& positions, int threads);

/// Moves the bytes that skinning has to move and computes nothing: reads all of the packed skin,
/// writes V x 3 numbers made of what was read (not zeros: memory of zeros is faster). No skinning
/// of this packed form can be faster where memory is the limit.
/// stream  write past the caches; `positions` is then aligned to 16 bytes.
void move_bytes(const BlockedSkin& skin, bool stream, int threads, float* positions);

/// Reads all of `in`, in order, writes all of `out` and computes nothing but sums of 16 numbers.
void move_numbers(std::span<const float> in, std::span<float> out, int threads);

}  // namespace sinew::bench
