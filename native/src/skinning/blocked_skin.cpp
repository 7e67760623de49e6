#include "skinning/blocked_skin.h"

#include <algorithm>
#include <set>
#include <unordered_set>

#include "base/parallel.h"
#include "skinning/kernels.h"

namespace sinew {
namespace {

// In a block, every vertex is multiplied by all of the block's joints; a single vertex only by its own
// joints, but at a quarter of the speed. Blocks of few joints are faster in any case.
constexpr std::size_t kAlwaysBlocked = 12;
constexpr std::size_t kJointsAnInfluence = 4;

constexpr std::size_t kBlocksPerTask = 512;
constexpr double kFill = 0.2, kFillPositions = 0.01;  // microseconds per block

/// The joint sets of a skin; each is stored once.
class SetTable {
 public:
  explicit SetTable(BlockedSkin& skin) : skin_(skin), known_(64, Hash{&skin}, Equal{&skin}) {}

  std::uint32_t index_of(const std::vector<std::uint32_t>& joints, bool is_rigid) {
    const auto index = static_cast<std::uint32_t>(skin_.sets.size());
    skin_.sets.push_back(
        {static_cast<std::uint32_t>(skin_.joints.size()), static_cast<std::uint32_t>(joints.size()), is_rigid});
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

/// Finds each block's joints; marks those already seen, so that each check is one read.
class JointGatherer {
 public:
  explicit JointGatherer(const BlockedSkin& skin) : skin_(skin), last_block_(skin.identity_joint + 1, 0) {}

  /// Returns the distinct joints of vertices first..last, ascending; empty if there are too many.
  const std::vector<std::uint32_t>& joints_of(std::size_t first, std::size_t last) {
    joints_.clear();
    ++block_;
    for (std::size_t v = first; v < last; ++v) {
      if (skin_.offsets[v] == skin_.offsets[v + 1]) add(skin_.identity_joint);
    }
    const auto influences =
        skin_.influence_joints.subspan(skin_.offsets[first], skin_.offsets[last] - skin_.offsets[first]);
    for (const std::int32_t joint : influences) add(static_cast<std::uint32_t>(joint));
    if (joints_.size() > kAlwaysBlocked && joints_.size() * (last - first) > kJointsAnInfluence * influences.size()) {
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
  std::vector<std::size_t> last_block_;  // per joint: the last block that has it, counted from 1
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

/// Returns how many numbers a block's packed weights take.
std::size_t weights_of(const BlockedSkin& skin, const Block& block) {
  const JointSet set = skin.sets[block.joint_set];
  return set.is_rigid ? 0 : kBlock * set.count;
}

/// place: J + 1, scratch.
void fill_weights(BlockedSkin& skin, std::size_t b, std::vector<std::uint32_t>& place) {
  const std::size_t numbers = weights_of(skin, skin.blocks[b]);
  if (numbers == 0) return;
  float* const weights = skin.packed_weights.get() + skin.blocks[b].weights;
  std::fill_n(weights, numbers, 0.0f);
  std::uint32_t next = 0;
  for (const std::uint32_t joint : skin.joints_of(skin.blocks[b].joint_set)) {
    place[joint] = kBlock * next++;
  }
  for (std::size_t v = b * kBlock; v < skin.vertex_after(b + 1); ++v) {
    const std::size_t i = v % kBlock, in_group = i % skin.lanes;
    float* const lane = weights + i - in_group + 3 * in_group % skin.lanes;
    if (skin.offsets[v] == skin.offsets[v + 1]) lane[place[skin.identity_joint]] = 1;
    for (auto k = skin.offsets[v]; k < skin.offsets[v + 1]; ++k) {
      lane[place[skin.influence_joints[k]]] += skin.weights[k];
    }
  }
}

/// Calls use(begin, end) for ranges of blocks. `microseconds`: the approximate time per block.
template <class Use>
void for_blocks(const BlockedSkin& skin, double microseconds, const Use& use) {
  const std::size_t count = skin.blocks.size();
  const bool parallel = threads_pay(microseconds * static_cast<double>(count));
  parallel_for(count, parallel ? kBlocksPerTask : count, use);
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

std::vector<JointPair> spanning_forest(const std::vector<JointPair>& neighbours, std::size_t joint_count) {
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

BlockedSkin::BlockedSkin(std::span<const float> rest_positions, std::span<const std::int64_t> skin_offsets,
                         std::span<const std::int32_t> skin_joints, std::span<const float> skin_weights,
                         std::ptrdiff_t joint_count)
    : lanes(kernel_lanes()),
      identity_joint(static_cast<std::uint32_t>(joint_count)),
      rest(rest_positions),
      offsets(skin_offsets),
      influence_joints(skin_joints),
      weights(skin_weights) {
  has_negative_weights = std::ranges::any_of(weights, [](float weight) { return weight < 0; });

  SetTable table(*this);
  JointGatherer gatherer(*this);
  std::uint64_t numbers = 0;
  for (std::size_t first = 0; first < vertex_count(); first += kBlock) {
    const std::size_t last = std::min(vertex_count(), first + kBlock);
    const auto& own = gatherer.joints_of(first, last);
    const bool rigid = own.size() == 1 && is_rigid(*this, first, last);
    blocks.push_back({numbers, table.index_of(own, rigid)});
    numbers += weights_of(*this, blocks.back());
  }
  points = aligned<float>(blocks.size() * kBlockFloats);
  packed_weights = aligned<float>(numbers);
  pack_rest_positions();
  for_blocks(*this, kFill, [this](std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> place(identity_joint + 1);
    for (std::size_t b = begin; b < end; ++b) fill_weights(*this, b, place);
  });

  neighbours = neighbours_in(*this);
  spanning = spanning_forest(neighbours, identity_joint + 1);
}

void BlockedSkin::pack_rest_positions() {
  for_blocks(*this, kFillPositions, [this](std::size_t begin, std::size_t end) {
    const std::size_t first = begin * kBlock;
    pack_points(rest.data() + 3 * first, vertex_after(end) - first, points.get() + begin * kBlockFloats);
  });
}

}  // namespace sinew
