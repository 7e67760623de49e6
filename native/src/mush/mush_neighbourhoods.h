/// The neighbourhoods over which direct delta mush smooths, joint by joint.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "base/kept.h"
#include "mush/implicit_smoothing.h"
#include "mush/laplacian.h"
#include "sinew/direct_delta_mush.h"
#include "sinew/skin.h"

namespace sinew {

/// A joint's share in a vertex's neighbourhood: the smoothed fields of weights w and of w u u^T.
struct Moments {
  Eigen::Matrix3d second;  ///< about the current origin
  Eigen::Vector3d first;
  double weight;           ///< by MushSettings::smoothing
  double smoothed_weight;  ///< by weight_smoothing

  /// Returns the moments about another origin. about  relative to the current origin.
  Moments moved_to(const Eigen::Vector3d& about) const;
};

/// Vertices and their weights.
struct WeightField {
  std::vector<std::uint32_t> vertices;  ///< ascending, each once
  std::vector<double> weights;
};

/// Smooths one field after the other; several threads may use one object at once.
class MushNeighbourhoods {
 public:
  MushNeighbourhoods(const Skin& skin, const Laplacian& laplacian, const MushSettings& settings);

  struct Smoothed {
    std::span<const std::uint32_t> vertices;  ///< ascending: those that the field reaches
    Eigen::Vector3d origin;
    const double* fields;  ///< kFields per vertex

    Moments at(std::size_t i) const;
  };

  /// Smooths a field and calls use(Smoothed) with the result.
  /// progress  advanced by one step per vertex of the field; or null.
  template <class Use>
  void smooth(const WeightField& field, Progress* progress, const Use& use) {
    const auto space = spaces_.borrow([&] { return std::make_unique<Space>(skin_.vertex_count()); });
    use(smooth_in(*space, field, progress));
  }

 private:
  /// The memory for one smoothing.
  struct Space {
    explicit Space(std::ptrdiff_t count) : number_of(static_cast<std::size_t>(count), -1) {}
    std::vector<std::int32_t> number_of;  ///< -1 between smoothings
    std::vector<std::uint32_t> vertices;
    std::vector<std::uint32_t> outermost;
    ScaledRows rows;
    SmoothingPanels panels;
  };

  Smoothed smooth_in(Space& space, const WeightField& field, Progress* progress) const;
  bool grow(Space& space, const WeightField& field, std::size_t rings) const;
  Eigen::Vector3d fill(Space& space, const WeightField& field) const;

  const Skin& skin_;
  const Laplacian& laplacian_;
  std::vector<double> shape_, weights_;  // the polynomials
  std::size_t rings_;
  Kept<Space> spaces_;
};

}  // namespace sinew
