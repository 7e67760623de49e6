/// All that happens to one mesh in a frame.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sinew/bends.h"
#include "sinew/shape_keys.h"
#include "sinew/skin.h"
#include "sinew/skinning_method.h"
#include "sinew/stage.h"
#include "sinew/types.h"

namespace sinew {

/// What one armature does to a mesh. Immutable, but for what is done to its skin.
class Layer {
 public:
  /// skin    V vertices, J joints; several layers may share it.
  /// rule    of dual quaternions; its rest frames (J) are relative to the space in which the
  ///         matrices move points, the armature's. Copied.
  /// mask    V: how much of the motion each vertex takes part in, p + mask (skinned(p) - p);
  ///         nothing: all of it.
  /// share   V: of a layer that is mixed in, shape + share (own - shape), shape being the outcome
  ///         of the layers before it. The first layer has none, every other one has one.
  /// bends   or null: those of the skin's influences that are to follow a vertex. The skin has them
  ///         split as they are at its rest positions (or the base of the keys) and in split_space.
  ///         A vertex that is elsewhere in a frame is split anew: one that shape keys move, and all
  ///         of them on other rest positions or in another space than split_space.
  /// split_space  mesh_from_armature of LayerPose when the skin was split; without bends it says
  ///         nothing. Compared number by number.
  /// data    of a method that has some, null for the others.
  /// Throws InputError for bends that name a vertex or a joint that the skin does not have, for
  /// data of another method or number of vertices, and for a number of rest frames, masks or shares
  /// that does not fit, and for one that is not finite.
  Layer(std::shared_ptr<const Skin> skin, SkinningMethod method, const StretchRule& rule = {},
        std::optional<std::span<const float>> mask = std::nullopt,
        std::optional<std::span<const float>> share = std::nullopt, std::shared_ptr<const Bends> bends = nullptr,
        const std::optional<Matrix4<double>>& split_space = std::nullopt,
        std::shared_ptr<const MethodData> data = nullptr);

  const Skin& skin() const { return *skin_; }
  SkinningMethod method() const { return method_; }
  StretchRule rule() const { return {stretch_, rest_frames_}; }
  /// V, or nothing.
  const std::optional<std::vector<float>>& mask() const { return mask_; }
  const std::optional<std::vector<float>>& share() const { return share_; }
  /// Or null.
  const Bends* bends() const { return bends_.get(); }
  const std::optional<Matrix4<double>>& split_space() const { return split_space_; }
  /// Or null.
  const MethodData* data() const { return data_.get(); }

 private:
  std::shared_ptr<const Skin> skin_;
  SkinningMethod method_;
  Stretch stretch_;
  std::vector<Matrix4<double>> rest_frames_;
  std::optional<std::vector<float>> mask_;
  std::optional<std::vector<float>> share_;
  std::shared_ptr<const Bends> bends_;
  std::optional<Matrix4<double>> split_space_;
  std::shared_ptr<const MethodData> data_;
};

/// A layer's armature in one frame.
struct LayerPose {
  MatrixStack<const float> matrices;  ///< 1 x J skinning matrices, space of the armature
  /// From there to the space of the mesh; nothing: they are one. A linear layer, and dual
  /// quaternions if this only turns, moves and scales uniformly, is skinned in the space of the
  /// mesh with C M C^-1. Otherwise points go through C^-1, are skinned in the armature's space and
  /// come back through C. As in Blender, a C without an inverse has zeros for one.
  std::optional<Matrix4<double>> mesh_from_armature{};
};

/// Input (the first skin's rest positions, or shape keys, or what the caller has) -> layers, all of
/// that same input, each in its space and with its mask -> mixed by their shares -> stages, one
/// after the other -> output.
///
/// Immutable and without a state: several threads may deform with one object at once.
class Deformer {
 public:
  /// layers  may be none if there are keys, whose sum is then what the stages get.
  /// keys    or null.
  /// Throws InputError if two have different numbers of vertices, for a first layer with a share, a
  /// later one without, or if there is nothing at all.
  explicit Deformer(std::vector<std::shared_ptr<const Layer>> layers, std::shared_ptr<const ShapeKeys> keys = nullptr);
  /// For stages alone: rest_positions are what they get. vertex_count  V.
  explicit Deformer(std::ptrdiff_t vertex_count);

  /// V.
  std::ptrdiff_t vertex_count() const { return vertex_count_; }
  const std::vector<std::shared_ptr<const Layer>>& layers() const { return layers_; }

  /// poses           one a layer.
  /// positions       out, V x 3, space of the mesh.
  /// key_values      K, how much of each key, 0 for those that are muted; empty: 0 for all.
  /// rest_positions  V x 3 in place of the skin's own and of the keys; empty: these.
  /// stages          each of V vertices, in the order in which they work.
  /// milliseconds    out, one more than there are stages: what keys and layers took, then each
  ///                 stage; empty: nobody wants to know.
  ///
  /// One parallel region for keys and layers, some for each stage. Allocates nothing once each
  /// thread has seen layers of this size. The same bits for any number of threads. Throws
  /// InputError, having written nothing, if a shape does not fit, for a stage's settings that are
  /// wrong, for key values without keys or with rest positions, and if positions and rest_positions
  /// overlap.
  void deform(std::span<const LayerPose> poses, std::span<float> positions, std::span<const float> key_values = {},
              std::span<const float> rest_positions = {}, std::span<const Stage> stages = {},
              std::span<double> milliseconds = {}) const;

 private:
  void check(std::span<const LayerPose> poses, std::span<float> positions, std::span<const float> key_values,
             std::span<const float> rest_positions, std::span<const Stage> stages,
             std::span<double> milliseconds) const;
  void skin(std::span<const LayerPose> poses, std::span<float> positions, std::span<const float> key_values,
            std::span<const float> rest_positions) const;

  std::vector<std::shared_ptr<const Layer>> layers_;
  std::shared_ptr<const ShapeKeys> keys_;
  std::ptrdiff_t vertex_count_ = 0;
};

}  // namespace sinew
