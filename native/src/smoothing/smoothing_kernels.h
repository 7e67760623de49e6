/// The inner loops of smoothing, compiled for several instruction sets. None of them fuses
/// multiplications with additions, so they all give the same bits.
///
/// All of them process the blocks begin up to end of a neighbourhood, whose points they read and write.
#pragma once

#include <cstddef>

#include "sinew/corrective_smooth.h"
#include "sinew/smooth.h"
#include "smoothing/neighbourhood.h"

namespace sinew {

/// to = from + (sum of neighbours - from) weight factor / (number of neighbours).
void simple_step(const Neighbourhood& around, std::size_t begin, std::size_t end, float factor, const float* from,
                 float* to);

/// The same, with each difference multiplied by its length and divided by the mean length and the number.
void length_step(const Neighbourhood& around, std::size_t begin, std::size_t end, float factor, const float* from,
                 float* to);

/// One iteration of Blender's Smooth.
void mean_step(const Neighbourhood& around, std::size_t begin, std::size_t end, const Smooth::Settings& settings,
               const float* from, float* to);

/// Computes rest - smooth in the frames of the corners of `smooth`.
/// losses  out, x y z of kBlock lanes, one after the other, for each of the neighbourhood's corner
///         entries.
void measure_losses(const Neighbourhood& around, std::size_t begin, std::size_t end, const float* rest,
                    const float* smooth, float* losses);

/// to = smooth + scale times the losses, which are in the frames of smooth's corners and weighted by
/// their angles.
void restore_losses(const Neighbourhood& around, std::size_t begin, std::size_t end, const float* smooth,
                    const float* losses, float scale, CornerAngle angle, float* to);

}  // namespace sinew
