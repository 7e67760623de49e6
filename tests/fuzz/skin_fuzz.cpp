/// A skin of arbitrary influences and one call on arbitrary matrices. The first bytes say how many there are of each;
/// all others are taken as they are, from NaN to numbers that overflow.
#include <algorithm>
#include <cstring>
#include <optional>
#include <vector>

#include "files.h"
#include "sinew/skinning.h"
#include "sinew/threads.h"

using namespace sinew;

namespace {

class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), left_(size) {}

  /// Zero when nothing is left.
  template <class T>
  T take() {
    T value{};
    const std::size_t size = std::min(sizeof value, left_);
    std::memcpy(&value, data_, size);
    data_ += size;
    left_ -= size;
    return value;
  }

  template <class T, class Raw = T>
  std::vector<T> list(std::size_t count) {
    std::vector<T> values(count);
    for (T& value : values) value = static_cast<T>(take<Raw>());
    return values;
  }

 private:
  const std::uint8_t* data_;
  std::size_t left_;
};

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

  std::optional<Skin> skin;
  if (!fuzz::reads(size + 64 * (influences + vertices + joint_count),
                   [&] { skin.emplace(rest, offsets, joints, weights, joint_count); })) {
    return 0;
  }
  std::vector<float> positions(3 * frames * vertices);
  const MatrixStack<const float> stack{matrices.data(), frames, joint_count, 16 * joint_count, 16, 1, 4};
  constexpr Stretch kStretches[] = {Stretch::polar, Stretch::frame, Stretch::frame_each};
  const Stretch stretch = kStretches[choice % 3];
  const std::vector<Matrix4<double>> rest_frames(stretch == Stretch::polar ? 0 : joint_count,
                                                 Matrix4<double>::Identity());
  const SkinningJob job{&*skin,
                        stack,
                        positions,
                        choice % 4 == 3 ? SkinningMethod::linear : SkinningMethod::dual_quaternion,
                        {stretch, rest_frames}};
  skin_all({&job, 1});
  return 0;
}
