#include "mush/packed_mush.h"

#include <algorithm>
#include <map>

namespace sinew {

DirectDeltaMush::Packed::Packed(const MushArrays& given, std::ptrdiff_t joint_count)
    : variant(given.variant),
      identity_joint(static_cast<std::uint32_t>(joint_count)),
      vertex_count(std::ssize(given.offsets) - 1) {
  const std::size_t count = (static_cast<std::size_t>(vertex_count) + kBlock - 1) / kBlock;
  const std::size_t width = MushArrays::width_of(variant) * kBlock;
  for (std::size_t b = 0; b < count; ++b) {
    std::map<std::uint32_t, double> shares;
    for (std::size_t v = b * kBlock; v < (b + 1) * kBlock; ++v) {
      const bool stays = v >= static_cast<std::size_t>(vertex_count) || given.offsets[v] == given.offsets[v + 1];
      if (stays) {
        shares.try_emplace(identity_joint, 0);
        continue;
      }
      for (auto i = given.offsets[v]; i < given.offsets[v + 1]; ++i) {
        shares[given.joints[i]] += given.omega[(i + 1) * MushArrays::width_of(variant) - 1];
      }
    }
    std::vector<std::pair<std::uint32_t, double>> in_order(shares.begin(), shares.end());
    std::ranges::stable_sort(in_order, std::greater(), [](const auto& one) { return one.second; });
    blocks.push_back(
        {omega_size_, static_cast<std::uint32_t>(joints.size()), static_cast<std::uint32_t>(in_order.size())});
    for (const auto& one : in_order) joints.push_back(one.first);
    omega_size_ += in_order.size() * width;
  }
  omega = aligned<float>(omega_size_);
  vertices = aligned<float>(count * vertex_width() * kBlock);
  std::fill_n(omega.get(), omega_size_, 0.0f);
  std::fill_n(vertices.get(), count * vertex_width() * kBlock, 0.0f);
  for (std::size_t b = 0; b < count; ++b) take_block(given, b);
}

void DirectDeltaMush::Packed::take_block(const MushArrays& given, std::size_t b) {
  const std::size_t width = MushArrays::width_of(variant);
  const Block& block = blocks[b];
  const auto* const first = joints.data() + block.first_joint;
  const auto place_of = [&](std::uint32_t joint) {
    const auto k = static_cast<std::size_t>(std::find(first, first + block.joint_count, joint) - first);
    return omega.get() + block.omega + k * width * kBlock;
  };
  float* const own = vertices.get() + b * vertex_width() * kBlock;
  for (std::size_t lane = 0; lane < kBlock; ++lane) {
    const std::size_t v = b * kBlock + lane;
    const bool exists = v < static_cast<std::size_t>(vertex_count);
    for (std::size_t axis = 0; exists && axis < 3; ++axis) own[axis * kBlock + lane] = given.centers[3 * v + axis];
    if (exists) own[3 * kBlock + lane] = given.scales[v];
    const auto put = [&](std::uint32_t joint, const float* numbers) {
      float* const to = place_of(joint) + lane;
      for (std::size_t n = 0; n < width; ++n) to[n * kBlock] += numbers[n];
      for (std::size_t n = 0; variant == 1 && n < 6; ++n) own[(4 + n) * kBlock + lane] += numbers[n];
    };
    if (!exists || given.offsets[v] == given.offsets[v + 1]) {
      constexpr float kStays[] = {1, 0, 0, 1, 0, 1, 0, 0, 0, 1};
      put(identity_joint, kStays + 10 - width);
      continue;
    }
    for (auto i = given.offsets[v]; i < given.offsets[v + 1]; ++i) {
      put(static_cast<std::uint32_t>(given.joints[i]), &given.omega[i * width]);
    }
  }
}

MushArrays DirectDeltaMush::Packed::arrays() const {
  MushArrays result;
  result.variant = variant;
  result.offsets.push_back(0);
  const std::size_t width = MushArrays::width_of(variant);
  for (std::size_t v = 0; v < static_cast<std::size_t>(vertex_count); ++v) {
    const Block& block = blocks[v / kBlock];
    std::map<std::uint32_t, const float*> own;
    for (std::uint32_t k = 0; k < block.joint_count; ++k) {
      const std::uint32_t joint = joints[block.first_joint + k];
      const float* const from = omega.get() + block.omega + k * width * kBlock + v % kBlock;
      bool is_there = false;
      for (std::size_t n = 0; n < width; ++n) is_there |= from[n * kBlock] != 0;
      if (is_there && joint != identity_joint) own[joint] = from;
    }
    for (const auto& [joint, from] : own) {
      result.joints.push_back(static_cast<std::int32_t>(joint));
      for (std::size_t n = 0; n < width; ++n) result.omega.push_back(from[n * kBlock]);
    }
    result.offsets.push_back(std::ssize(result.joints));
    const float* const center = vertices.get() + v / kBlock * vertex_width() * kBlock + v % kBlock;
    for (std::size_t axis = 0; axis < 3; ++axis) result.centers.push_back(center[axis * kBlock]);
    result.scales.push_back(center[3 * kBlock]);
  }
  return result;
}

std::size_t DirectDeltaMush::Packed::bytes() const {
  return sizeof(float) * (omega_size_ + blocks.size() * vertex_width() * kBlock) + sizeof(Block) * blocks.size() +
         sizeof(std::uint32_t) * joints.size();
}

}  // namespace sinew
