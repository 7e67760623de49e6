/// The shape of a mesh on one frame, with what it was computed from.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "sinew/layer.h"
#include "sinew/stage.h"

namespace sinew::bindings {

/// 128 bits of all that a shape was computed from, so that equal ones mean equal shapes.
using Digest = std::array<std::uint64_t, 2>;

/// Returns the digest of what a deformer and its stages compute a shape from; nullopt if a stage follows the shape of
/// another object.
/// identity    a number that no other deformer, stages and rest shape have
/// key_values  of all keys; the first does not count
std::optional<Digest> digest_of(std::uint64_t identity, std::span<const LayerPose> poses,
                                std::span<const float> key_values, std::span<const Stage> stages);

/// Immutable.
struct FrameShape {
  FrameShape(const Digest& own, std::span<const float> given);

  Digest digest;
  std::size_t count;                   ///< of numbers: V x 3
  std::unique_ptr<float[]> positions;  ///< of unwritten memory at first, so that nothing is written twice
};

}  // namespace sinew::bindings
