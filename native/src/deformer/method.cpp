#include "deformer/method.h"

#include <algorithm>
#include <iterator>
#include <optional>

#include "base/check.h"
#include "mush/direct_delta_mush_skinning.h"
#include "skinning/blended_skinning.h"
#include "skinning/dual_quaternion_skinning.h"
#include "skinning/linear_skinning.h"
#include "skinning/rotation_center_skinning.h"

namespace sinew {

namespace {

struct Prepared {
  const BlockedSkin& skin;
  const StretchRule& rule;
  const MethodData* data;
  MatrixStack<const float> given;
  std::ptrdiff_t frame;
  const Carried* carried;

  /// The matrices in the skin's own space.
  MatrixStack<const float> own() const { return carried ? carried->matrices : given; }
};

void prepare_matrices(const Prepared& of, Palette& palette) { prepare_linear(of.own(), of.frame, palette); }

void prepare_quaternions(const Prepared& of, Palette& palette) {
  prepare_dual_quaternion(of.skin, of.rule, of.given, of.frame, of.carried ? &of.carried->space : nullptr, palette);
}

void prepare_both(const Prepared& of, Palette& palette) {
  prepare_matrices(of, palette);
  prepare_quaternions(of, palette);
}

void prepare_mush(const Prepared& of, Palette& palette) {
  prepare_direct_delta_mush(of.skin, static_cast<const DirectDeltaMush&>(*of.data), of.own(), of.frame, palette);
}

void linear_of(std::size_t, const Influences& own, const MethodData*, const Palette& palette, const float* rest,
               float* out) {
  linear_vertex(own, rest, palette.matrices.data(), out);
}

void dual_quaternion_of(std::size_t, const Influences& own, const MethodData*, const Palette& palette,
                        const float* rest, float* out) {
  dual_quaternion_vertex(own, palette, rest, out);
}

void blended_of(std::size_t v, const Influences& own, const MethodData* data, const Palette& palette, const float* rest,
                float* out) {
  blended_vertex(own, palette, static_cast<const BlendShares&>(*data).shares()[v], rest, out);
}

void rotation_centers_of(std::size_t v, const Influences& own, const MethodData* data, const Palette& palette,
                         const float* rest, float* out) {
  rotation_center_vertex(v, own, static_cast<const RotationCenters&>(*data), palette, rest, out);
}

void nothing_of(std::size_t, const Influences&, const MethodData*, const Palette&, const float*, float*) {}

void run_mush(const BlockedSkin&, const Palette& palette, const Tile& tile) { run_direct_delta_mush(palette, tile); }

/// All that differs between the methods.
struct Entry {
  SkinningMethod method;
  const char* name;              ///< in Python
  double microseconds_a_vertex;  ///< AVX2, at most four influences; between half of the joints stretching and none
  bool needs_data;
  bool carries_any;  ///< C M C^-1 in a space does what M does outside of it, for any C, not for similarities alone
  void (*prepare)(const Prepared& of, Palette& palette);
  void (*run)(const BlockedSkin& skin, const Palette& palette, const Tile& tile);
  void (*run_vertex)(std::size_t v, const Influences& influences, const MethodData* data, const Palette& palette,
                     const float* rest, float* out);
};

constexpr Entry kEntries[] = {
    {SkinningMethod::linear, "linear", 1.5e-3, false, true, prepare_matrices, run_linear, linear_of},
    {SkinningMethod::dual_quaternion, "dual_quaternion", 3.5e-3, false, false, prepare_quaternions, run_dual_quaternion,
     dual_quaternion_of},
    {SkinningMethod::blended, "blended", 5e-3, true, false, prepare_both, run_blended, blended_of},
    {SkinningMethod::rotation_centers, "rotation_centers", 5e-3, true, false, prepare_both, run_rotation_centers,
     rotation_centers_of},
    {SkinningMethod::direct_delta_mush, "direct_delta_mush", 15e-3, true, true, prepare_mush, run_mush, nothing_of},
};

constexpr bool is_in_order() {
  if (std::size(kEntries) != std::size(kSkinningMethods)) return false;
  for (std::size_t i = 0; i < std::size(kEntries); ++i) {
    if (kEntries[i].method != kSkinningMethods[i] || kEntries[i].method != static_cast<SkinningMethod>(i)) return false;
  }
  return true;
}
static_assert(is_in_order());

const Entry& entry_of(SkinningMethod method) { return kEntries[static_cast<std::size_t>(method)]; }

}  // namespace

const char* name_of(SkinningMethod method) { return entry_of(method).name; }

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
  if (entry_of(method).needs_data && !data)
    fail(where, "the method ", name_of(method), " needs data of its own; pass it as data");
  if (!data) return;
  if (data->method() != method) {
    fail(where, "the data is of the method ", name_of(data->method()), "; the method is ", name_of(method));
  }
  if (data->vertex_count() != skin.vertex_count()) {
    fail(where, "the data has ", plural(data->vertex_count(), "vertex"), "; the skin has ",
         grouped(skin.vertex_count()));
  }
  const std::optional<std::ptrdiff_t> joints = data->joint_count();
  if (joints && *joints != skin.joint_count()) {
    fail(where, "the data has ", plural(*joints, "joint"), "; the skin has ", grouped(skin.joint_count()));
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
  const Prepared given{skin, rule, data, matrices, frame, carried};
  find_spoilt(skin, given.own(), frame, palette);
  entry_of(method).prepare(given, palette);
}

void run(const BlockedSkin& skin, SkinningMethod method, const Palette& palette, const Tile& tile) {
  entry_of(method).run(skin, palette, tile);
}

void run_vertex(std::size_t v, const Influences& influences, SkinningMethod method, const MethodData* data,
                const Palette& palette, const float* rest, float* out) {
  entry_of(method).run_vertex(v, influences, data, palette, rest, out);
}

bool is_carried(SkinningMethod method, const Space& by) {
  return by.has_inverse && (entry_of(method).carries_any || by.is_similarity());
}

double microseconds_a_vertex(SkinningMethod method) { return entry_of(method).microseconds_a_vertex; }

}  // namespace sinew
