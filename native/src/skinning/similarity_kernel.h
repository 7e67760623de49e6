/// The inner loop of SimilarTriangles, compiled for several instruction sets.
#pragma once

#include <array>
#include <cstddef>

namespace sinew {

/// Rows of cells are padded to a multiple of this.
constexpr std::size_t kCellLanes = 16;

/// sum over cells of exp(-(x Y - y X)^2) (m, moment), in float32.
/// x, y    weights of a vertex.
/// cells   six rows of `length` numbers: X, Y, m, and the moment's x, y and z.
std::array<float, 4> similar_sum(float x, float y, const float* cells, std::size_t length);

}  // namespace sinew
