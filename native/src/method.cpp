#include "method.h"

#include "check.h"
#include "dual_quaternion_skinning.h"
#include "linear_skinning.h"

namespace sinew {

void check_matrices(const Skin& skin, MatrixStack<const float> matrices, const std::string& where) {
  if (matrices.joints != skin.joint_count()) {
    fail(where, "there are ", plural(matrices.joints, "matrix"), " a frame; the skin has ",
         plural(skin.joint_count(), "joint"));
  }
}

void check_rest_frames(const StretchRule& rule, std::ptrdiff_t joints, const std::string& where) {
  const auto frames = std::ssize(rule.rest_frames);
  const auto wanted = rule.stretch == Stretch::polar ? 0 : joints;
  if (frames != wanted) {
    fail(where, "there are ", plural(frames, "rest frame"), "; expected ", grouped(wanted));
  }
}

void prepare(const BlockedSkin& skin, SkinningMethod method, const StretchRule& rule, MatrixStack<const float> matrices,
             std::ptrdiff_t frame, Palette& palette) {
  if (method == SkinningMethod::linear) {
    prepare_linear(matrices, frame, palette);
  } else {
    prepare_dual_quaternion(skin, rule, matrices, frame, palette);
  }
}

void run(const BlockedSkin& skin, SkinningMethod method, const Palette& palette, const Tile& tile) {
  const bool linear = method == SkinningMethod::linear;
  (linear ? run_linear : run_dual_quaternion)(skin, palette, tile);
}

void run_vertex(const Influences& influences, SkinningMethod method, const Palette& palette, const float* rest,
                float* out) {
  if (method == SkinningMethod::linear) {
    linear_vertex(influences, rest, palette.matrices.data(), out);
  } else {
    dual_quaternion_vertex(influences, palette, rest, out);
  }
}

double microseconds_a_vertex(SkinningMethod method) {
  // AVX2, four influences at most.
  return method == SkinningMethod::linear ? 1.5e-3 : 2.5e-3;
}

}  // namespace sinew
