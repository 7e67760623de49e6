/// What one armature does to a mesh.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sinew/bends.h"
#include "sinew/skin.h"
#include "sinew/skinning_method.h"
#include "sinew/types.h"

namespace sinew {

/// What one armature does to a mesh. Immutable, except for changes to its skin.
class Layer {
 public:
  /// skin    V vertices, J joints; several layers may share it.
  /// rule    for dual quaternions; its rest frames (J) are relative to the space in which the
  ///         matrices move points, the armature's. Copied.
  /// mask    V: how much of the motion each vertex gets, p + mask (skinned(p) - p); nullopt: all of
  ///         it.
  /// share   V: how a layer is mixed in, shape + share (own - shape), where shape is the result of the
  ///         layers before it. The first layer has no share, and every other layer has one.
  /// bends   or null: those of the skin's influences whose split follows the vertex. In the skin they
  ///         are split as at its rest positions (or at the base of the keys) and in split_space.
  ///         Vertices that are elsewhere in a frame are split again: those that shape keys move, and
  ///         all of them with other rest positions or in a space other than split_space.
  /// split_space  mesh_from_armature of LayerPose when the skin was split; has no effect without
  ///         bends. Compared number by number.
  /// data    the method's own data; null for a method that has none.
  /// Throws InputError for bends that name a vertex or a joint that the skin does not have, for data
  /// of another method or for another number of vertices, for a number of rest frames, masks or
  /// shares that does not fit, and if one of them is not finite.
  Layer(std::shared_ptr<const Skin> skin, SkinningMethod method, const StretchRule& rule = {},
        std::optional<std::span<const float>> mask = std::nullopt,
        std::optional<std::span<const float>> share = std::nullopt, std::shared_ptr<const Bends> bends = nullptr,
        const std::optional<Matrix4<double>>& split_space = std::nullopt,
        std::shared_ptr<const MethodData> data = nullptr);

  const Skin& skin() const { return *skin_; }
  SkinningMethod method() const { return method_; }
  StretchRule rule() const { return {stretch_, rest_frames_, refuses_half_turns_}; }
  /// V, or nullopt.
  const std::optional<std::vector<float>>& mask() const { return mask_; }
  const std::optional<std::vector<float>>& share() const { return share_; }
  /// Or null.
  const Bends* bends() const { return bends_.get(); }
  /// The bends' joints that may not be half a turn apart; empty unless the method is dual quaternions and its rule says
  /// so.
  std::span<const std::pair<std::uint32_t, std::uint32_t>> bent_pairs() const { return bent_pairs_; }
  const std::optional<Matrix4<double>>& split_space() const { return split_space_; }
  /// Or null.
  const MethodData* data() const { return data_.get(); }

 private:
  std::shared_ptr<const Skin> skin_;
  SkinningMethod method_;
  Stretch stretch_;
  std::vector<Matrix4<double>> rest_frames_;
  bool refuses_half_turns_;
  std::optional<std::vector<float>> mask_;
  std::optional<std::vector<float>> share_;
  std::shared_ptr<const Bends> bends_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> bent_pairs_;
  std::optional<Matrix4<double>> split_space_;
  std::shared_ptr<const MethodData> data_;
};

/// A layer's armature in one frame.
struct LayerPose {
  MatrixStack<const float> matrices;  ///< 1 x J skinning matrices, in armature space
  /// C, from armature space to mesh space; nullopt if they are the same. A linear layer is skinned in
  /// mesh space with C M C^-1; so are dual quaternions if C only turns, moves and scales uniformly.
  /// Otherwise points are transformed by C^-1, skinned in armature space and transformed back by C. As
  /// in Blender, a C that has no inverse gets zeros in its place.
  std::optional<Matrix4<double>> mesh_from_armature{};
};

}  // namespace sinew
