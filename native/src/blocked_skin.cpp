#include "blocked_skin.h"

#include <algorithm>
#include <set>
#include <unordered_set>

#include "parallel.h"

namespace sinew {
namespace {

// A block multiplies by all its joints for every vertex, a single vertex by its own alone but at a
// fourth of the speed. Blocks of few joints are the faster in any case.
constexpr std::size_t kAlwaysBlocked = 12;
constexpr std::size_t kJointsAnInfluence = 4;

// On AVX-512 two blocks with the same joints run as a pair, half the loads a block; blocks are
// brought together by sorting within windows that the cache holds whole.
constexpr std::size_t kBlocksPerWindow = 4096 / kBlock;
constexpr int kLanesThatPair = 16;

constexpr std::size_t kBlocksPerTask = 512;
constexpr double kFill = 0.2, kFillPositions = 0.05;  // microseconds a block

/// The joint sets of a skin, each of which is stored once.
class SetTable {
 public:
  explicit SetTable(BlockedSkin& skin) : skin_(skin), known_(64, Hash{&skin}, Equal{&skin}) {}

  std::uint32_t index_of(const std::vector<std::uint32_t>& joints, bool is_rigid) {
    const auto index = static_cast<std::uint32_t>(skin_.sets.size());
    skin_.sets.push_back({static_cast<std::uint32_t>(skin_.joints.size()),
                          static_cast<std::uint32_t>(joints.size()), is_rigid});
    skin_.joints.insert(skin_.joints.end(), joints.begin(), joints.end());
    const auto [known, is_new] = known_.insert(index);
    if (!is_new) {
      skin_.joints.resize(skin_.sets.back().begin);
      skin_.sets.pop_back();
    }
    return *known;
  }

 private:
  struct Hash {
    const BlockedSkin* skin;
    std::size_t operator()(std::uint32_t index) const {
      std::uint64_t hash = skin->sets[index].is_rigid;
      for (const std::uint32_t joint : skin->joints_of(index)) {
        hash = (hash ^ joint) * 0x9e3779b97f4a7c15u;  // 2^64 / golden ratio
        hash ^= hash >> 32;
      }
      return hash;
    }
  };
  struct Equal {
    const BlockedSkin* skin;
    bool operator()(std::uint32_t a, std::uint32_t b) const {
      return skin->sets[a].is_rigid == skin->sets[b].is_rigid &&
             std::ranges::equal(skin->joints_of(a), skin->joints_of(b));
    }
  };

  BlockedSkin& skin_;
  std::unordered_set<std::uint32_t, Hash, Equal> known_;
};

/// Finds each block's joints; remembers which joints it has seen, so that a look is one read.
class JointGatherer {
 public:
  explicit JointGatherer(const BlockedSkin& skin)
      : skin_(skin), last_block_(skin.identity_joint + 1, 0) {}

  /// The distinct joints of vertices first..last, ascending; empty if there are too many.
  const std::vector<std::uint32_t>& joints_of(std::size_t first, std::size_t last) {
    joints_.clear();
    ++block_;
    for (std::size_t v = first; v < last; ++v) {
      if (skin_.offsets[v] == skin_.offsets[v + 1]) add(skin_.identity_joint);
    }
    const auto influences = skin_.influence_joints.subspan(
        skin_.offsets[first], skin_.offsets[last] - skin_.offsets[first]);
    for (const std::int32_t joint : influences) add(static_cast<std::uint32_t>(joint));
    if (joints_.size() > kAlwaysBlocked &&
        joints_.size() * (last - first) > kJointsAnInfluence * influences.size()) {
      joints_.clear();
    }
    std::ranges::sort(joints_);
    return joints_;
  }

 private:
  void add(std::uint32_t joint) {
    if (last_block_[joint] == block_) return;
    last_block_[joint] = block_;
    joints_.push_back(joint);
  }

  const BlockedSkin& skin_;
  std::vector<std::size_t> last_block_;  // a joint: the last block that has it, counted from 1
  std::size_t block_ = 0;
  std::vector<std::uint32_t> joints_;
};

/// Whether the one joint of vertices first..last moves each with weight 1.
bool is_rigid(const BlockedSkin& skin, std::size_t first, std::size_t last) {
  for (std::size_t v = first; v < last; ++v) {
    const auto count = skin.offsets[v + 1] - skin.offsets[v];
    if (count > 1 || (count == 1 && skin.weights[skin.offsets[v]] != 1)) return false;
  }
  return true;
}

std::size_t numbers_of(const BlockedSkin& skin, const Block& block) {
  const JointSet set = skin.sets[block.joint_set];
  if (set.count == 0) return 0;
  return kBlock * (3 + (set.is_rigid ? 0 : set.count));
}

/// Calls use(vertex, lane) for the vertices of a block.
template <class Use>
void for_vertices(const BlockedSkin& skin, const Block& block, const Use& use) {
  const std::size_t first = block.first_vertex;
  const std::size_t count = std::min<std::size_t>(kBlock, skin.offsets.size() - 1 - first);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t lane_in_group = i % skin.lanes;
    use(first + i, i - lane_in_group + 3 * lane_in_group % skin.lanes);
  }
}

void fill_positions(BlockedSkin& skin, const Block& block) {
  float* const data = skin.data.get() + block.data;
  for_vertices(skin, block, [&](std::size_t v, std::size_t lane) {
    for (int axis = 0; axis < 3; ++axis) data[kBlock * axis + lane] = skin.rest[3 * v + axis];
  });
}

/// place: J + 1, scratch.
void fill_weights(BlockedSkin& skin, const Block& block, std::vector<std::uint32_t>& place) {
  if (skin.sets[block.joint_set].is_rigid) return;
  std::uint32_t next = 3;
  for (const std::uint32_t joint : skin.joints_of(block.joint_set)) place[joint] = kBlock * next++;
  float* const data = skin.data.get() + block.data;
  for_vertices(skin, block, [&](std::size_t v, std::size_t lane) {
    if (skin.offsets[v] == skin.offsets[v + 1]) data[place[skin.identity_joint] + lane] = 1;
    for (auto k = skin.offsets[v]; k < skin.offsets[v + 1]; ++k) {
      data[place[skin.influence_joints[k]] + lane] += skin.weights[k];
    }
  });
}

/// Calls use(block, scratch of the thread) for the blocks that have a packed form. `microseconds`:
/// what a block takes, about.
template <class Use>
void for_packed_blocks(BlockedSkin& skin, double microseconds, const Use& use) {
  const std::size_t count = skin.blocks.size();
  const bool parallel = threads_pay(microseconds * static_cast<double>(count));
  parallel_for(count, parallel ? kBlocksPerTask : count, [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> scratch(skin.identity_joint + 1);
    for (std::size_t b = begin; b < end; ++b) {
      if (skin.sets[skin.blocks[b].joint_set].count > 0) use(skin.blocks[b], scratch);
    }
  });
}

std::vector<JointPair> neighbours_in(const BlockedSkin& skin) {
  std::set<JointPair> pairs;
  for (std::uint32_t set = 0; set < skin.sets.size(); ++set) {
    const auto joints = skin.joints_of(set);
    for (std::size_t a = 0; a < joints.size(); ++a) {
      for (std::size_t b = a + 1; b < joints.size(); ++b) pairs.emplace(joints[a], joints[b]);
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
  JointGatherer gatherer(*this);
  for (std::size_t first = 0; first < vertices; first += kBlock) {
    const std::size_t last = std::min(vertices, first + kBlock);
    const auto& own = gatherer.joints_of(first, last);
    const bool rigid = own.size() == 1 && is_rigid(*this, first, last);
    blocks.push_back({0, static_cast<std::uint32_t>(first), table.index_of(own, rigid)});
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
  for_packed_blocks(*this, kFill, [this](const Block& block, std::vector<std::uint32_t>& scratch) {
    std::fill_n(data.get() + block.data, numbers_of(*this, block), 0.0f);
    fill_positions(*this, block);
    fill_weights(*this, block, scratch);
  });

  neighbours = neighbours_in(*this);
  spanning = spanning_forest(neighbours, identity_joint + 1);
}

void BlockedSkin::take_rest_positions() {
  for_packed_blocks(*this, kFillPositions, [this](const Block& block, std::vector<std::uint32_t>&) {
    fill_positions(*this, block);
  });
}

}  // namespace sinew
