#include "deformer/method.h"

#include <algorithm>

#include "base/check.h"
#include "mush/direct_delta_mush_skinning.h"
#include "skinning/blended_skinning.h"
#include "skinning/dual_quaternion_skinning.h"
#include "skinning/linear_skinning.h"
#include "skinning/rotation_center_skinning.h"

namespace sinew {

const char* name_of(SkinningMethod method) {
  switch (method) {
    case SkinningMethod::linear:
      return "linear";
    case SkinningMethod::dual_quaternion:
      return "dual_quaternion";
    case SkinningMethod::blended:
      return "blended";
    case SkinningMethod::rotation_centers:
      return "rotation_centers";
    case SkinningMethod::direct_delta_mush:
      return "direct_delta_mush";
  }
  return "";
}

void check_matrices(const Skin& skin, MatrixStack<const float> matrices, const std::string& where) {
  if (matrices.joints != skin.joint_count()) {
    fail(where, "there are ", plural(matrices.joints, "matrix"), " per frame; the skin has ",
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

void check_data(const Skin& skin, SkinningMethod method, const MethodData* data, const std::string& where) {
  const bool has_some = method != SkinningMethod::linear && method != SkinningMethod::dual_quaternion;
  if (has_some && !data) fail(where, "the method ", name_of(method), " needs data of its own; pass it as data");
  if (!data) return;
  if (data->method() != method) {
    fail(where, "the data is of the method ", name_of(data->method()), "; the method is ", name_of(method));
  }
  if (data->vertex_count() != skin.vertex_count()) {
    fail(where, "the data has ", plural(data->vertex_count(), "vertex"), "; the skin has ",
         grouped(skin.vertex_count()));
  }
  if (method != SkinningMethod::direct_delta_mush) return;
  const std::ptrdiff_t joints = static_cast<const DirectDeltaMush&>(*data).skin()->joint_count();
  if (joints != skin.joint_count()) {
    fail(where, "the data has ", plural(joints, "joint"), "; the skin has ", grouped(skin.joint_count()));
  }
}

namespace {

void find_spoilt(const BlockedSkin& skin, MatrixStack<const float> matrices, std::ptrdiff_t frame, Palette& palette) {
  palette.is_spoilt.clear();
  const auto is_finite = [&](std::ptrdiff_t j) {
    return j >= matrices.joints || matrices.at(frame, j).topRows<3>().allFinite();
  };
  std::ptrdiff_t first = 0;
  while (first < matrices.joints && is_finite(first)) ++first;
  if (first == matrices.joints) return;
  for (std::uint32_t set = 0; set < skin.sets.size(); ++set) {
    palette.is_spoilt.push_back(!std::ranges::all_of(skin.joints_of(set), is_finite));
  }
}

}  // namespace

void prepare(const BlockedSkin& skin, SkinningMethod method, const StretchRule& rule, const MethodData* data,
             MatrixStack<const float> matrices, std::ptrdiff_t frame, Palette& palette, const Carried* carried) {
  const MatrixStack<const float> own = carried ? carried->matrices : matrices;
  find_spoilt(skin, own, frame, palette);
  if (method == SkinningMethod::direct_delta_mush) {
    return prepare_direct_delta_mush(skin, static_cast<const DirectDeltaMush&>(*data), own, frame, palette);
  }
  if (method != SkinningMethod::dual_quaternion) prepare_linear(own, frame, palette);
  if (method == SkinningMethod::linear) return;
  prepare_dual_quaternion(skin, rule, matrices, frame, carried ? &carried->space : nullptr, palette);
}

void run(const BlockedSkin& skin, SkinningMethod method, const Palette& palette, const Tile& tile) {
  switch (method) {
    case SkinningMethod::linear:
      return run_linear(skin, palette, tile);
    case SkinningMethod::dual_quaternion:
      return run_dual_quaternion(skin, palette, tile);
    case SkinningMethod::blended:
      return run_blended(skin, palette, tile);
    case SkinningMethod::rotation_centers:
      return run_rotation_centers(skin, palette, tile);
    case SkinningMethod::direct_delta_mush:
      return run_direct_delta_mush(palette, tile);
  }
}

void run_vertex(std::size_t v, const Influences& influences, SkinningMethod method, const MethodData* data,
                const Palette& palette, const float* rest, float* out) {
  switch (method) {
    case SkinningMethod::linear:
      return linear_vertex(influences, rest, palette.matrices.data(), out);
    case SkinningMethod::dual_quaternion:
      return dual_quaternion_vertex(influences, palette, rest, out);
    case SkinningMethod::blended:
      return blended_vertex(influences, palette, static_cast<const BlendShares&>(*data).shares()[v], rest, out);
    case SkinningMethod::rotation_centers:
      return rotation_center_vertex(v, influences, static_cast<const RotationCenters&>(*data), palette, rest, out);
    case SkinningMethod::direct_delta_mush:
      return;  // was made with other influences
  }
}

double microseconds_a_vertex(SkinningMethod method) {
  // AVX2, at most four influences; a compromise between half of the joints stretching and none.
  switch (method) {
    case SkinningMethod::linear:
      return 1.5e-3;
    case SkinningMethod::dual_quaternion:
      return 3.5e-3;
    case SkinningMethod::blended:
    case SkinningMethod::rotation_centers:
      return 5e-3;
    case SkinningMethod::direct_delta_mush:
      return 15e-3;
  }
  return 0;
}

}  // namespace sinew
