/// Characters to measure on: the project's ogre and capsule, refined and re-weighted.
#pragma once

#include <filesystem>
#include <vector>

#include "sinew/rig.h"
#include "sinew/skin.h"

namespace sinew::bench {

/// A skin, given twice: sparse, as the library takes it, and dense, as the student report does; and
/// frames of a moving character.
struct Character {
  Skin skin;                                  ///< V vertices, J joints (columns of weights)
  Eigen::MatrixXd dense_weights;              ///< V x J; empty above kMostDense vertices
  Eigen::MatrixXd rest;                       ///< V x 3, as long as dense_weights is there
  std::vector<Matrix4<float>> matrices;       ///< F x J skinning matrices
  std::vector<Matrix4<float>> stretched;      ///< likewise, every other joint stretched by some per cent
  std::vector<Matrix4<double>> rest_frames;   ///< J, A(j)
  std::vector<Matrix4<double>> transforms;    ///< F x J, F(j)
  std::vector<Matrix4<double>> inverse_rest;  ///< J, A(j)^-1
  std::vector<std::int32_t> face_offsets;     ///< faces + 1
  std::vector<std::int32_t> face_vertices;    ///< around each face, face after face

  std::ptrdiff_t frame_count() const { return static_cast<std::ptrdiff_t>(matrices.size()) / skin.joint_count(); }
  /// One frame's skinning matrices.
  MatrixStack<const float> frame(std::ptrdiff_t f) const {
    return MatrixStack<const float>::of(matrices.data() + f * skin.joint_count(), 1, skin.joint_count());
  }
  MatrixStack<const float> stretched_frame(std::ptrdiff_t f) const {
    return MatrixStack<const float>::of(stretched.data() + f * skin.joint_count(), 1, skin.joint_count());
  }
};

constexpr std::ptrdiff_t kMostDense = 600'000;

/// A rig folder with the poses of its walk.dmat.
Rig read_walking_rig(const std::filesystem::path& folder);

/// The joint of each column of weights.
std::vector<std::int32_t> joints_of_columns(const Rig& rig);

/// Reads a rig folder with its walk.dmat and poses it for `frames` moments of the walk.
/// subdivisions  each quadruples the vertices: a new one in the middle of each edge and polygon,
///               its weights the mean of its corners'.
/// influences    the largest so many weights of each vertex are kept and brought to a sum of 1; one
///               that has fewer gets the nearest joints, the less the farther. 0: as subdivision
///               leaves them.
/// at_least      so many influences has every vertex at least (see influences); 0 or `influences`.
Character read_character(const std::filesystem::path& folder, int subdivisions, int influences, int at_least,
                         int frames);

}  // namespace sinew::bench
