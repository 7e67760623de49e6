/// A skin of arbitrary influences, what its method has for each vertex, computed from arbitrary faces or given, and one
/// call on arbitrary matrices. The first bytes say how many there are of each; all others are taken as they are, from
/// NaN to numbers that overflow.
#include <algorithm>
#include <memory>
#include <vector>

#include "bytes.h"
#include "files.h"
#include "sinew/skinning.h"
#include "sinew/threads.h"

using namespace sinew;

namespace {

struct Faces {
  std::vector<std::int32_t> offsets, vertices;

  /// raw: faces that need not fit.
  Faces(Bytes& bytes, std::size_t vertex_count, bool raw) {
    offsets.resize(bytes.take<std::uint8_t>() % 40);
    std::int32_t corners = 0;
    for (std::int32_t& offset : offsets) {
      offset = corners;
      corners = std::max(0, corners + (raw ? bytes.take<std::int8_t>() : 3 + bytes.take<std::uint8_t>() % 3));
    }
    vertices = bytes.list<std::int32_t, std::int8_t>(offsets.empty() ? 0 : offsets.back());
    if (raw || vertex_count == 0) return;
    for (auto& v : vertices) v = static_cast<std::uint8_t>(v) % static_cast<std::int32_t>(vertex_count);
  }
};

/// One of six to the end of its range and beyond; the others where it is used.
double setting(Bytes& bytes, double most) {
  const auto part = bytes.take<std::uint8_t>();
  return part % 6 == 5 ? bytes.take<float>() : most * part / 255;
}

MushSettings mush_settings(Bytes& bytes) {
  MushSettings settings;
  settings.smoothing = setting(bytes, 10);
  settings.weight_smoothing = setting(bytes, 10);
  settings.blend = setting(bytes, 1);
  settings.iterations = bytes.take<std::int8_t>() % 20;
  settings.laplacian = bytes.take<std::uint8_t>() % 2 ? LaplacianKind::uniform : LaplacianKind::cotangent;
  settings.variant = bytes.take<std::uint8_t>() % 7;
  settings.prune = setting(bytes, 0.1);
  return settings;
}

/// Of that skin, but with joints, numbers and variant as they come.
MushArrays mush_arrays(Bytes& bytes, const Skin& skin) {
  MushArrays arrays;
  arrays.variant = bytes.take<std::uint8_t>() % 7;
  arrays.offsets.push_back(0);
  for (std::ptrdiff_t v = 0; v < skin.vertex_count(); ++v) {
    arrays.offsets.push_back(arrays.offsets.back() + bytes.take<std::uint8_t>() % 5);
  }
  const auto vertices = static_cast<std::size_t>(skin.vertex_count());
  const auto entries = static_cast<std::size_t>(arrays.offsets.back());
  arrays.joints = bytes.list<std::int32_t, std::uint8_t>(entries);
  if (skin.joint_count() > 0) {
    for (auto& joint : arrays.joints) joint %= static_cast<std::int32_t>(skin.joint_count()) + joint / 255;
  }
  arrays.omega = bytes.list<float>(entries * static_cast<std::size_t>(MushArrays::width_of(arrays.variant)));
  arrays.centers = bytes.list<float>(3 * vertices);
  arrays.scales = bytes.list<float>(vertices);
  return arrays;
}

/// What the method has for each vertex, or null. Throws InputError.
std::shared_ptr<const MethodData> data_of(SkinningMethod method, const std::shared_ptr<const Skin>& skin, Bytes& bytes,
                                          bool raw) {
  const auto vertices = static_cast<std::size_t>(skin->vertex_count());
  const bool computed = bytes.take<std::uint8_t>() % 4 > 0;
  if (method == SkinningMethod::blended) {
    auto shares = computed ? bytes.list<float, std::uint8_t>(vertices) : bytes.list<float>(vertices);
    if (computed) std::ranges::transform(shares, shares.begin(), [](float share) { return share / 255; });
    return std::make_shared<BlendShares>(shares);
  }
  if (method == SkinningMethod::rotation_centers && !computed) {
    const auto has_center = bytes.list<std::uint8_t>(vertices);
    return std::make_shared<RotationCenters>(bytes.list<float>(3 * vertices), has_center);
  }
  if (method == SkinningMethod::rotation_centers) {
    const Faces faces(bytes, vertices, raw);
    return RotationCenters::compute(*skin, faces.offsets, faces.vertices, setting(bytes, 1));
  }
  if (method == SkinningMethod::direct_delta_mush && !computed) {
    return std::make_shared<DirectDeltaMush>(skin, mush_arrays(bytes, *skin));
  }
  if (method == SkinningMethod::direct_delta_mush) {
    const Faces faces(bytes, vertices, raw);
    return DirectDeltaMush::compute(skin, faces.offsets, faces.vertices, mush_settings(bytes));
  }
  return nullptr;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  [[maybe_unused]] static const bool alone = (set_thread_count(1), true);
  Bytes bytes(data, size);
  const auto choice = bytes.take<std::uint8_t>();
  const std::ptrdiff_t frames = bytes.take<std::uint8_t>() % 4;
  const std::ptrdiff_t joint_count = bytes.take<std::uint8_t>() % 40;
  const std::size_t vertices = bytes.take<std::uint8_t>() % 100;
  const auto most_influences = 1 + bytes.take<std::uint8_t>() % 20;
  const bool raw = choice & 0x80;  // offsets and joints that need not fit

  std::vector<std::int64_t> offsets{0};
  for (std::size_t v = 0; v < vertices; ++v) {
    const auto step = bytes.take<std::int8_t>();
    offsets.push_back(offsets.back() + (raw ? step : static_cast<std::uint8_t>(step) % most_influences));
  }
  const auto influences = static_cast<std::size_t>(std::clamp<std::int64_t>(offsets.back(), 0, 2000));
  std::vector<std::int32_t> joints = bytes.list<std::int32_t, std::int8_t>(influences);
  if (!raw && joint_count > 0) {
    for (auto& joint : joints) joint = static_cast<std::uint8_t>(joint) % joint_count;
  }
  const auto weights = bytes.list<float>(influences);
  const auto rest = bytes.list<float>(3 * vertices);
  const auto matrices = bytes.list<float>(16 * frames * joint_count);

  std::shared_ptr<const Skin> skin;
  if (!fuzz::reads(size + 64 * (influences + vertices + joint_count),
                   [&] { skin = std::make_shared<Skin>(rest, offsets, joints, weights, joint_count); })) {
    return 0;
  }
  constexpr Stretch kStretches[] = {Stretch::polar, Stretch::frame, Stretch::frame_each};
  const Stretch stretch = kStretches[choice % 3];
  const SkinningMethod method = kSkinningMethods[choice / 3 % std::size(kSkinningMethods)];
  std::shared_ptr<const MethodData> own;
  if (!fuzz::accepts([&] { own = data_of(method, skin, bytes, raw); })) return 0;
  std::vector<float> positions(3 * frames * vertices);
  const MatrixStack<const float> stack{matrices.data(), frames, joint_count, 16 * joint_count, 16, 1, 4};
  const std::vector<Matrix4<double>> rest_frames(stretch == Stretch::polar ? 0 : joint_count,
                                                 Matrix4<double>::Identity());
  const SkinningJob job{skin.get(), stack, positions, method, {stretch, rest_frames}, own.get()};
  skin_all({&job, 1});
  return 0;
}
