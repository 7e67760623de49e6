#include "sinew/layer.h"

#include "base/check.h"
#include "base/vertex_numbers.h"
#include "deformer/method.h"

namespace sinew {
namespace {

std::optional<std::vector<float>> checked(const char* name, std::optional<std::span<const float>> numbers,
                                          std::ptrdiff_t vertices) {
  if (!numbers) return std::nullopt;
  check_vertex_numbers(name, *numbers, vertices, "the skin");
  return std::vector<float>(numbers->begin(), numbers->end());
}

void check_bends(const Bends& bends, const Skin& skin) {
  if (!bends.vertices().empty() && bends.vertices().back() >= skin.vertex_count()) {
    fail("bends names vertex ", bends.vertices().back(), "; the skin has ", plural(skin.vertex_count(), "vertex"));
  }
  if (bends.joint_count() > skin.joint_count()) {
    fail("bends names joint ", bends.joint_count() - 1, "; the skin has ", plural(skin.joint_count(), "joint"));
  }
}

}  // namespace

Layer::Layer(std::shared_ptr<const Skin> skin, SkinningMethod method, const StretchRule& rule,
             std::optional<std::span<const float>> mask, std::optional<std::span<const float>> share,
             std::shared_ptr<const Bends> bends, const std::optional<Matrix4<double>>& split_space,
             std::shared_ptr<const MethodData> data)
    : skin_(std::move(skin)),
      method_(method),
      stretch_(rule.stretch),
      rest_frames_(rule.rest_frames.begin(), rule.rest_frames.end()),
      refuses_half_turns_(rule.refuses_half_turns),
      mask_(checked("mask", mask, skin_->vertex_count())),
      share_(checked("share", share, skin_->vertex_count())),
      bends_(std::move(bends)),
      split_space_(split_space),
      data_(std::move(data)) {
  check_rest_frames(rule, skin_->joint_count(), "");
  check_data(*skin_, method_, data_.get(), "");
  if (!bends_) return;
  check_bends(*bends_, *skin_);
  if (refuses_half_turns_ && method_ == SkinningMethod::dual_quaternion) bent_pairs_ = bends_->joint_pairs();
}

}  // namespace sinew
