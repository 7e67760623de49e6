/// The weight tools, and what reads faces, on arbitrary numbers. Whatever is accepted must keep the rules.
#include <cmath>
#include <cstdlib>
#include <optional>
#include <vector>

#include "bytes.h"
#include "files.h"
#include "sinew/threads.h"
#include "sinew/topology.h"
#include "sinew/weight_tools.h"

using namespace sinew;
using fuzz::require;

namespace {

/// V rows of finite weights above 0; at most `most` of them, with that sum if it is not 0.
void check(const WeightTable& table, std::ptrdiff_t vertices, std::size_t most, double sum) {
  require(table.vertices() == vertices, "a row for each vertex");
  for (std::size_t v = 0; v < static_cast<std::size_t>(vertices); ++v) {
    double own_sum = 0;
    std::int32_t before = -1;
    for (const BoneWeight& own : table.row(v)) {
      require(own.bone > before && own.bone < table.bones(), "bones ascend");
      require(own.weight > 0 && std::isfinite(own.weight), "weights are above 0 and finite");
      before = own.bone;
      own_sum += own.weight;
    }
    require(table.row(v).size() <= most, "no more weights than asked for");
    require(sum == 0 || std::abs(own_sum - sum) < 1e-4, "weights sum to 1");
  }
}

std::vector<float> positions_of(Bytes& bytes, std::size_t vertices, bool raw) {
  if (raw) return bytes.list<float>(3 * vertices);
  std::vector<float> numbers = bytes.list<float, std::int8_t>(3 * vertices);
  for (float& number : numbers) number /= 16;
  return numbers;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  [[maybe_unused]] static const bool alone = (set_thread_count(1), true);
  Bytes bytes(data, size);
  const auto choice = bytes.take<std::uint8_t>();
  const bool raw = choice & 0x80;  // numbers and faces as they come
  const std::size_t vertices = bytes.take<std::uint8_t>() % 40, bones = 1 + bytes.take<std::uint8_t>() % 6;
  const std::size_t count = bytes.take<std::uint8_t>() % 30;
  std::vector<std::int32_t> offsets{0};
  for (std::size_t f = 0; f < count; ++f) offsets.push_back(offsets.back() + 3 + bytes.take<std::uint8_t>() % 3);
  auto corners = bytes.list<std::int32_t, std::int8_t>(static_cast<std::size_t>(offsets.back()));
  if (raw) {
    offsets = bytes.list<std::int32_t>(count);
  } else if (vertices == 0) {
    offsets.clear();
    corners.clear();
  } else {
    for (auto& v : corners) v = static_cast<std::uint8_t>(v) % static_cast<std::int32_t>(vertices);
  }
  const Faces faces{offsets, corners};
  fuzz::accepts([&] {
    Topology(static_cast<std::ptrdiff_t>(vertices), bytes.list<std::int32_t, std::int8_t>(8), offsets, corners);
  });
  const std::vector<float> positions = positions_of(bytes, vertices, raw);
  std::vector<float> dense =
      raw ? bytes.list<float>(vertices * bones) : bytes.list<float, std::uint8_t>(vertices * bones);
  std::optional<WeightTable> table;
  const auto all = static_cast<std::ptrdiff_t>(vertices);
  const auto joints = static_cast<std::ptrdiff_t>(bones);
  if (!fuzz::accepts([&] { table = WeightTable::from_dense("weights", dense, all, joints); })) return 0;

  const std::vector<float> mask = bytes.list<float, std::uint8_t>(choice & 1 ? vertices : 0);
  const std::vector<std::int32_t> locked = bytes.list<std::int32_t, std::int8_t>(choice & 2 ? 1 : 0);
  SmoothWeightsSettings smooth{choice & 4 ? std::exp2(bytes.take<std::int8_t>() / 8.0) : 0,
                               bytes.take<std::uint8_t>() % 6,
                               bytes.take<std::uint8_t>() / 255.0,
                               mask,
                               locked,
                               {}};
  if (choice & 8) smooth.positions = positions;
  fuzz::accepts([&] { check(*smooth_weights(*table, faces, smooth), all, bones, 0); });

  const std::vector<double> numbers =
      raw ? bytes.list<double>(32 * bones) : bytes.list<double, std::int8_t>(32 * bones);
  std::vector<Matrix4<double>> matrices(2 * bones);
  for (std::size_t i = 0; i < matrices.size(); ++i) matrices[i] = Matrix4<double>::Map(numbers.data() + 16 * i);
  const ReduceSettings reduce{1 + bytes.take<std::uint8_t>() % 4, bytes.take<std::uint8_t>() % 3, locked};
  fuzz::accepts([&] {
    const auto stack = MatrixStack<const double>::of(matrices.data(), 2, joints);
    const auto made = reduce_weights(*table, positions, stack, faces, reduce);
    check(made->weights, all, static_cast<std::size_t>(reduce.most) + 1, 0);
  });

  const std::vector<std::int32_t> pairs = bytes.list<std::int32_t, std::int8_t>(bones);
  const MirrorSettings mirror{bytes.take<std::uint8_t>() % 3, bytes.take<std::int8_t>() / 16.0, bool(choice & 16),
                              bytes.take<std::uint8_t>() / 1e4, mask};
  fuzz::accepts([&] { check(*mirror_weights(*table, positions, faces, pairs, mirror), all, bones, 0); });

  const std::vector<float> others = positions_of(bytes, vertices, raw);
  const TransferSettings transfer{bytes.take<std::uint8_t>() / 100.0, 1.0 * (bytes.take<std::uint8_t>() % 181),
                                  bool(choice & 32)};
  fuzz::accepts(
      [&] { check(transfer_weights(positions, faces, *table, others, faces, transfer)->weights, all, bones, 1); });
  return 0;
}
