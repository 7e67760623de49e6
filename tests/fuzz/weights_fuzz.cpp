/// Weights for a mesh and bones with arbitrary numbers. Whatever is accepted must have weights that keep the rules.
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>
#include <vector>

#include "bytes.h"
#include "files.h"
#include "sinew/automatic_weights.h"
#include "sinew/threads.h"

using namespace sinew;

namespace {

/// Mostly within a small cube, where numbers meet; some as they come.
std::vector<double> coordinates(Bytes& bytes, std::size_t count, bool raw) {
  if (raw) return bytes.list<double>(count);
  std::vector<double> numbers = bytes.list<double, std::int8_t>(count);
  for (double& number : numbers) number = number > 120 ? std::exp((number - 121) * 100) : number / 32;
  return numbers;
}

void check(const AutomaticWeights& result, std::size_t vertices, std::int32_t joints) {
  const auto expect = [](bool is_right) {
    if (!is_right) std::abort();
  };
  expect(result.weights.vertices() == std::ssize(result.ways) && result.weights.bones() == joints);
  expect(result.ways.size() == vertices && result.parts.size() == vertices);
  for (std::size_t v = 0; v < vertices; ++v) {
    std::int32_t last = -1;
    double sum = 0;
    for (const auto& [joint, weight] : result.weights.row(v)) {
      expect(weight > 0 && joint > last && joint < joints);
      last = joint;
      sum += weight;
    }
    expect(std::abs(sum - 1) < 1e-5);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  [[maybe_unused]] static const bool alone = (set_thread_count(1), true);
  Bytes bytes(data, size);
  const auto choice = bytes.take<std::uint8_t>();
  const bool raw = choice & 0x80;  // numbers that need not be finite, and faces that need not fit
  const std::size_t vertices = bytes.take<std::uint8_t>() % 60, bones = bytes.take<std::uint8_t>() % 8;
  const std::size_t faces = bytes.take<std::uint8_t>() % 60, fixed_count = bytes.take<std::uint8_t>() % 4;
  WeightSettings settings;
  settings.method = static_cast<WeightMethod>(choice % 3);
  settings.resolution = 8 + bytes.take<std::uint8_t>() % 24;
  settings.stiffness = std::exp2(bytes.take<std::int8_t>() / 16);
  settings.max_influences = bytes.take<std::uint8_t>() % 4;
  settings.least_weight = bytes.take<std::uint8_t>() / 510.0;
  settings.rigid_size = bytes.take<std::uint8_t>() / 255.0;
  settings.rigid_follow = choice & 0x40 ? RigidFollow::bone : RigidFollow::attachment;

  std::vector<std::int32_t> offsets{0};
  for (std::size_t f = 0; f < faces; ++f) {
    const auto corners = bytes.take<std::uint8_t>();
    offsets.push_back(offsets.back() + (raw ? corners % 5 : 3 + corners % 3));
  }
  auto corners = bytes.list<std::int32_t, std::int8_t>(static_cast<std::size_t>(offsets.back()));
  if (raw && choice & 0x10) offsets = bytes.list<std::int32_t>(faces + 1);
  if (!raw && vertices == 0) offsets = {0}, corners.clear();
  for (auto& v : corners) v = raw ? v : static_cast<std::uint8_t>(v) % static_cast<std::int32_t>(vertices);
  const auto positions = coordinates(bytes, 3 * vertices, raw), heads = coordinates(bytes, 3 * bones, raw),
             tails = coordinates(bytes, 3 * bones, raw);
  const auto fixed = bytes.list<std::int32_t, std::uint8_t>(vertices > 0 ? fixed_count : 0);
  const auto given = bytes.list<float, std::uint8_t>(fixed.size() * bones);
  std::vector<std::int32_t> parts;
  if (choice & 0x20) {
    parts = bytes.list<std::int32_t, std::int8_t>(vertices);
    settings.rigid_parts = parts;
  }
  std::optional<AutomaticWeights> result;
  const bool is_accepted = fuzz::accepts([&] {
    const auto rows = WeightTable::from_dense("given", given, std::ssize(fixed), static_cast<std::ptrdiff_t>(bones));
    result = automatic_weights(positions, offsets, corners, {heads, tails, {}}, {fixed, rows}, settings);
  });
  if (is_accepted) check(*result, vertices, static_cast<std::int32_t>(bones));
  return 0;
}
