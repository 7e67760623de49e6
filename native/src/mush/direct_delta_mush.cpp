#include "sinew/direct_delta_mush.h"

#include <algorithm>
#include <cmath>

#include "base/offsets.h"
#include "mesh/faces.h"
#include "mush/implicit_smoothing.h"
#include "mush/mush_precomputation.h"
#include "mush/packed_mush.h"

namespace sinew {
namespace {

constexpr double kMostSmoothing = 1000;
constexpr int kMostIterations = 1000, kMostVariant = 5;

void check_variant(int variant) { check_range("variant", variant, 0, kMostVariant); }

void check_settings(const MushSettings& settings) {
  check_range("smoothing", settings.smoothing, 0, kMostSmoothing);
  check_range("weight_smoothing", settings.weight_smoothing, 0, kMostSmoothing);
  check_range("blend", settings.blend, 0, 1);
  check_range("iterations", settings.iterations, 0, kMostIterations);
  check_range("prune", settings.prune, 0, 1);
  check_variant(settings.variant);
}

void check_count(const char* name, std::size_t count, std::ptrdiff_t expected) {
  if (static_cast<std::ptrdiff_t>(count) == expected) return;
  fail(name, " has ", plural(static_cast<long long>(count), "number"), "; expected ", grouped(expected));
}

void check_finite(const char* name, std::span<const float> numbers) {
  const auto wrong = std::ranges::find_if_not(numbers, [](float number) { return std::isfinite(number); });
  if (wrong != numbers.end()) fail(name, " is not finite at number ", wrong - numbers.begin());
}

void check_arrays(const Skin& skin, const MushArrays& arrays) {
  check_variant(arrays.variant);
  const std::ptrdiff_t vertices = skin.vertex_count(), entries = std::ssize(arrays.joints);
  check_count("omega", arrays.omega.size(), entries * MushArrays::width_of(arrays.variant));
  check_count("centers", arrays.centers.size(), 3 * vertices);
  check_count("scales", arrays.scales.size(), vertices);
  check_offsets<std::int64_t>("offsets", arrays.offsets, entries, "joints", vertices, "vertices");
  for (const std::int32_t joint : arrays.joints) {
    if (joint >= 0 && joint < skin.joint_count()) continue;
    fail("joints names joint ", joint, "; the skin has ", plural(skin.joint_count(), "joint"));
  }
  check_finite("omega", arrays.omega);
  check_finite("centers", arrays.centers);
  check_finite("scales", arrays.scales);
}

}  // namespace

std::shared_ptr<DirectDeltaMush> DirectDeltaMush::compute(std::shared_ptr<const Skin> skin,
                                                          std::span<const std::int32_t> face_offsets,
                                                          std::span<const std::int32_t> face_vertices,
                                                          const MushSettings& settings, Progress* progress) {
  check_settings(settings);
  check_faces({face_offsets, face_vertices}, skin->vertex_count());
  try {
    const Laplacian own = laplacian(skin->rest_positions(), face_offsets, face_vertices, settings.laplacian);
    stop_if_cancelled(progress);
    const MushArrays arrays = precompute_mush(*skin, own, settings, progress);
    return std::make_shared<DirectDeltaMush>(std::move(skin), arrays);
  } catch (const Cancelled&) {
    return nullptr;
  }
}

DirectDeltaMush::DirectDeltaMush(std::shared_ptr<const Skin> skin, const MushArrays& arrays) : skin_(std::move(skin)) {
  check_arrays(*skin_, arrays);
  packed_ = std::make_unique<Packed>(arrays, skin_->joint_count());
  pruned_ = arrays.pruned;
  entries_ = std::ssize(arrays.joints);
}

DirectDeltaMush::~DirectDeltaMush() = default;

int DirectDeltaMush::variant() const { return packed_->variant; }

std::size_t DirectDeltaMush::bytes() const { return packed_->bytes(); }

MushArrays DirectDeltaMush::arrays() const {
  MushArrays arrays = packed_->arrays();
  arrays.pruned = pruned_;
  return arrays;
}

}  // namespace sinew
