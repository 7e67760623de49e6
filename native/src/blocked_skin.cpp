#include "blocked_skin.h"

#include <algorithm>
#include <set>
#include <string_view>
#include <unordered_map>

namespace sinew {
namespace {

// Beyond this many joints a block does more work for zero weights than vertex by vertex.
constexpr std::size_t kMostJoints = 12;

// On AVX-512 two blocks with the same joints run as a pair, half the loads a block; blocks are
// brought together by sorting within windows that the cache holds whole.
constexpr std::size_t kBlocksPerWindow = 4096 / kBlock;
constexpr int kLanesThatPair = 16;

/// Looks up joint sets that have been seen before by their bytes.
class SetTable {
 public:
  explicit SetTable(BlockedSkin& skin) : skin_(skin) {}

  std::uint32_t index_of(const std::vector<std::uint32_t>& joints) {
    const std::string key(reinterpret_cast<const char*>(joints.data()),
                          joints.size() * sizeof(joints.front()));
    const auto [entry, is_new] =
        known_.try_emplace(key, static_cast<std::uint32_t>(skin_.sets.size()));
    if (is_new) {
      skin_.sets.push_back({static_cast<std::uint32_t>(skin_.joints.size()),
                            static_cast<std::uint32_t>(joints.size())});
      skin_.joints.insert(skin_.joints.end(), joints.begin(), joints.end());
    }
    return entry->second;
  }

 private:
  BlockedSkin& skin_;
  std::unordered_map<std::string, std::uint32_t> known_;
};

/// The distinct joints of vertices first..last, ascending; empty if there are too many.
void gather_joints(const BlockedSkin& skin, std::size_t first, std::size_t last,
                   std::vector<std::uint32_t>& joints) {
  joints.clear();
  const auto add = [&](std::uint32_t joint) {
    if (std::find(joints.begin(), joints.end(), joint) == joints.end()) joints.push_back(joint);
  };
  for (std::size_t v = first; v < last; ++v) {
    if (skin.offsets[v] == skin.offsets[v + 1]) add(skin.identity_joint);
    for (auto i = skin.offsets[v]; i < skin.offsets[v + 1]; ++i) add(skin.influence_joints[i]);
    if (joints.size() > kMostJoints) return joints.clear();
  }
  std::sort(joints.begin(), joints.end());
}

std::size_t numbers_of(const BlockedSkin& skin, const Block& block) {
  const std::size_t joints = skin.sets[block.joint_set].count;
  return joints == 0 ? 0 : kBlock * (3 + joints);
}

void fill(BlockedSkin& skin, const Block& block) {
  const JointSet set = skin.sets[block.joint_set];
  float* const data = skin.data.get() + block.data;
  std::fill_n(data, numbers_of(skin, block), 0.0f);
  const std::size_t vertices = skin.offsets.size() - 1;
  for (int i = 0; i < kBlock && block.first_vertex + i < vertices; ++i) {
    const std::size_t v = block.first_vertex + i;
    const int lane = i / skin.lanes * skin.lanes + 3 * (i % skin.lanes) % skin.lanes;
    for (int axis = 0; axis < 3; ++axis) data[kBlock * axis + lane] = skin.rest[3 * v + axis];
    const auto add = [&](std::uint32_t joint, float weight) {
      const std::uint32_t* begin = skin.joints.data() + set.begin;
      const auto place = std::lower_bound(begin, begin + set.count, joint) - begin;
      data[kBlock * (3 + place) + lane] += weight;
    };
    if (skin.offsets[v] == skin.offsets[v + 1]) add(skin.identity_joint, 1);
    for (auto k = skin.offsets[v]; k < skin.offsets[v + 1]; ++k) {
      add(skin.influence_joints[k], skin.weights[k]);
    }
  }
}

std::vector<JointPair> neighbours_in(const BlockedSkin& skin) {
  std::set<JointPair> pairs;
  for (const JointSet& set : skin.sets) {
    for (std::uint32_t a = set.begin; a < set.begin + set.count; ++a) {
      for (std::uint32_t b = a + 1; b < set.begin + set.count; ++b) {
        pairs.emplace(skin.joints[a], skin.joints[b]);
      }
    }
  }
  return {pairs.begin(), pairs.end()};
}

std::vector<JointPair> spanning_forest(const std::vector<JointPair>& neighbours,
                                       std::size_t joint_count) {
  std::vector<std::vector<std::uint32_t>> adjacent(joint_count);
  for (const auto& [a, b] : neighbours) {
    adjacent[a].push_back(b);
    adjacent[b].push_back(a);
  }
  std::vector<bool> reached(joint_count, false);
  std::vector<JointPair> forest;
  const auto reach_from = [&](std::uint32_t joint) {
    for (const std::uint32_t next : adjacent[joint]) {
      if (reached[next]) continue;
      reached[next] = true;
      forest.emplace_back(joint, next);
    }
  };
  for (std::uint32_t root = 0; root < joint_count; ++root) {
    if (reached[root]) continue;
    reached[root] = true;
    std::size_t next = forest.size();
    reach_from(root);
    for (; next < forest.size(); ++next) reach_from(forest[next].second);
  }
  return forest;
}

}  // namespace

BlockedSkin::BlockedSkin(std::span<const float> rest_positions,
                         std::span<const std::int64_t> skin_offsets,
                         std::span<const std::int32_t> skin_joints,
                         std::span<const float> skin_weights, std::ptrdiff_t joint_count,
                         int lane_count)
    : lanes(lane_count),
      identity_joint(static_cast<std::uint32_t>(joint_count)),
      rest(rest_positions),
      offsets(skin_offsets),
      influence_joints(skin_joints),
      weights(skin_weights) {
  has_negative_weights = std::ranges::any_of(weights, [](float weight) { return weight < 0; });

  const std::size_t vertices = offsets.size() - 1;
  SetTable table(*this);
  std::vector<std::uint32_t> own;
  for (std::size_t first = 0; first < vertices; first += kBlock) {
    gather_joints(*this, first, std::min(vertices, first + kBlock), own);
    blocks.push_back({0, static_cast<std::uint32_t>(first), table.index_of(own)});
  }
  if (lanes == kLanesThatPair) {
    for (std::size_t begin = 0; begin < blocks.size(); begin += kBlocksPerWindow) {
      const auto end = std::min(blocks.size(), begin + kBlocksPerWindow);
      std::stable_sort(blocks.begin() + begin, blocks.begin() + end,
                       [](const Block& a, const Block& b) { return a.joint_set < b.joint_set; });
    }
  }
  std::uint64_t numbers = 0;
  for (Block& block : blocks) {
    block.data = numbers;
    numbers += numbers_of(*this, block);
  }
  data = hwy::AllocateAligned<float>(std::max<std::uint64_t>(1, numbers));
  if (!data) throw std::bad_alloc();
  for (const Block& block : blocks) {
    if (sets[block.joint_set].count > 0) fill(*this, block);
  }

  neighbours = neighbours_in(*this);
  spanning = spanning_forest(neighbours, identity_joint + 1);
}

}  // namespace sinew
