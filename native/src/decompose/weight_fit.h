/// Fits weights to a clip, with the motions of the joints fixed.
#pragma once

#include <cstdint>
#include <vector>

#include "decompose/motions.h"
#include "decompose/neighbours.h"

namespace sinew {

struct WeightFitSettings {
  std::size_t max_influences;
  std::size_t candidates;  ///< of a point, if local
  double smoothing;
  int sweeps;
  bool local;  ///< only joints with some smooth weight are tried
};

class WeightFit {
 public:
  /// Keeps references.
  WeightFit(const Clip& clip, const Neighbours& neighbours, const WeightFitSettings& settings)
      : clip_(clip), neighbours_(neighbours), settings_(settings) {}

  /// Replaces the weights. Those of before say which joints are tried at each point, and how smooth they are to be; rows of
  /// free places: all joints, and smooth as they come.
  /// Returns the sum of squared distances that is left.
  double improve(const Motions& motions, WeightRows& weights, const Progress* progress) const;

 private:
  const Clip& clip_;
  const Neighbours& neighbours_;
  WeightFitSettings settings_;
};

}  // namespace sinew
