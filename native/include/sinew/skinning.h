/// Several skins at once: the meshes of a character, the characters of a scene.
#pragma once

#include <span>

#include "sinew/dual_quaternion_skinning.h"
#include "sinew/skin.h"
#include "sinew/types.h"

namespace sinew {

enum class SkinningMethod { linear, dual_quaternion };

/// What skin_linear and skin_dual_quaternion take.
struct SkinningJob {
  const Skin* skin;                   ///< V vertices, J joints; several jobs may share it
  MatrixStack<const float> matrices;  ///< F x J skinning matrices
  std::span<float> positions;         ///< out, F x V x 3; no part of it in another job's
  SkinningMethod method;
  StretchRule rule{};  ///< of dual quaternions
};

/// Does all jobs in one parallel region, whose start is thus paid for once: many small meshes keep
/// all threads busy where each alone would not. The same bits as one call a job. Throws InputError
/// if a shape does not fit or two results overlap; then nothing is written.
void skin_all(std::span<const SkinningJob> jobs);

}  // namespace sinew
