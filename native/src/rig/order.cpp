#include "rig/order.h"

#include <algorithm>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "base/check.h"
#include "rig/constraints/constraint.h"
#include "rig/constraints/ik.h"
#include "rig/ik_plan.h"

namespace sinew::rig {
namespace {

/// Sets of bones that are joined step by step.
class Groups {
 public:
  explicit Groups(std::size_t count) : parents_(count) { std::iota(parents_.begin(), parents_.end(), 0); }

  int of(int item) {
    while (parents_[item] != item) item = parents_[item] = parents_[parents_[item]];
    return item;
  }
  void join(int a, int b) { parents_[of(b)] = of(a); }

 private:
  std::vector<int> parents_;
};

int setting_count(ConstraintType type) {
  int count = 0;
  for (const RigSetting& setting : constraint_settings(type)) count += setting.count;
  return count;
}

/// Operations as nodes, each with the nodes that it needs.
class Graph {
 public:
  explicit Graph(const Program& program)
      : program_(program),
        bones_(static_cast<int>(program.bones.size())),
        drivers_(static_cast<int>(program.drivers.size())),
        trees_(static_cast<int>(program.trees.size())),
        chains_(static_cast<int>(program.chains.size())),
        needs_(2 * bones_ + drivers_ + trees_ + chains_) {
    note_owners();
    writers_.assign(owners_.size(), -1);
    for (int i = 0; i < drivers_; ++i) {
      next_writer_.push_back(std::exchange(writers_[program.drivers[i].value], i));
      const int owner = owners_[program.drivers[i].value];
      if (owner >= 0) drivers_of_bones_[owner].push_back(i);
    }
    for (int i = 0; i < bones_; ++i) add_bone(i);
    for (int i = 0; i < drivers_; ++i) add_driver(i);
    for (int i = 0; i < trees_; ++i) add_tree(i);
    for (int i = 0; i < chains_; ++i) add_chain(i);
  }

  std::vector<Operation> sorted();

 private:
  enum class Mark : char { unseen, open, done };

  int bone_node(int bone) const {
    const auto [tree, chain] = std::pair(program_.bones[bone].tree, program_.bones[bone].chain);
    return tree >= 0 ? tree_node(tree) : chain >= 0 ? chain_node(chain) : bone;
  }
  int driver_node(int driver) const { return bones_ + driver; }
  int tree_node(int tree) const { return bones_ + drivers_ + tree; }
  int segments_node(int bone) const { return bones_ + drivers_ + trees_ + bone; }
  int chain_node(int chain) const { return segments_node(bones_) + chain; }

  void need(int node, int other) { needs_[node].push_back(other); }
  void need_values(int node, int first, int count) {
    for (int value = first; value < first + count; ++value) {
      for (int driver = writers_[value]; driver >= 0; driver = next_writer_[driver]) need(node, driver_node(driver));
    }
  }

  // Blender's graph is coarser than what is computed. Its needs are kept too, so that its cycles are found.

  void note_owners();

  /// All drivers of a bone, as its location or a constraint's influence.
  void need_drivers_of(int node, int bone) {
    const auto found = drivers_of_bones_.find(bone);
    if (found == drivers_of_bones_.end()) return;
    for (const int driver : found->second) {
      if (driver_node(driver) != node) need(node, driver_node(driver));
    }
  }

  /// The segments of a B-bone, if a driver reads a setting of its bend.
  void need_bent(int driver, int value);

  void add_bone(int index);
  void add_segments(int index);
  void add_constraint(int node, const Constraint& constraint);
  void add_driver(int index);
  void add_tree(int index);
  void add_chain(int index);
  std::string name(int node) const;
  [[noreturn]] void refuse_cycle(const std::vector<int>& path, int again) const;

  const Program& program_;
  int bones_;
  int drivers_;
  int trees_;
  int chains_;
  std::vector<std::vector<int>> needs_;
  std::vector<int> writers_;      // of each number, the last driver that sets it, or -1
  std::vector<int> next_writer_;  // of each driver, the one before it that sets the same number
  std::unordered_map<int, std::vector<int>> drivers_of_bones_;
  std::vector<int> owners_;  // of each number, the bone whose pose it belongs to, itself or by a constraint; or -1
};

void Graph::note_owners() {
  owners_.assign(program_.map.values().size(), -1);
  const auto note = [&](int bone, int first, int count) { std::fill_n(owners_.begin() + first, count, bone); };
  for (int i = 0; i < bones_; ++i) {
    note(i, program_.bones[i].values, kPoseBend);
    note(i, program_.bones[i].values + kIk, kArmatureValues - kIk);
  }
  for (const Constraint& constraint : program_.constraints) {
    note(constraint.bone, constraint.values, setting_count(constraint.type));
    if (constraint.type != ConstraintType::armature) continue;
    note(constraint.bone, constraint.weights, static_cast<int>(constraint.targets.size()));
  }
}

void Graph::add_bone(int index) {
  const Bone& bone = program_.bones[index];
  const int node = bone_node(index);
  if (bone.parent >= 0 && bone_node(bone.parent) != node) need(node, bone_node(bone.parent));
  need_values(node, bone.values, kPoseBend);
  need_values(node, bone.values + kIk, kArmatureValues - kIk);
  for (int i = 0; i < bone.constraint_count; ++i) {
    add_constraint(node, program_.constraints[bone.first_constraint + i]);
  }
  if (bone.is_bendy()) add_segments(index);
}

void Graph::add_segments(int index) {
  const Bone& bone = program_.bones[index];
  const int node = segments_node(index);
  need(node, bone_node(index));
  for (const int handle : bone.bend.handles) {
    if (handle < 0) continue;
    const Bone& other = program_.bones[handle];
    need(node, bone_node(handle));
    if (other.parent >= 0) need(node, bone_node(other.parent));
    need_values(node, other.values + kPoseBend + kBendRollOut, 1);
    need_values(node, other.values + kRestBend + kBendRollOut, 1);
  }
  const int before = bone.bend.handles[0];
  if (bone.bend.uses_end_roll && before >= 0 && program_.bones[before].is_bendy()) need(node, segments_node(before));
  need_values(node, bone.values + kPoseBend, kBendValueCount);
  need_values(node, bone.values + kRestBend, kBendValueCount);
}

void Graph::add_constraint(int node, const Constraint& constraint) {
  const auto need_target = [&](const RigTarget& target, bool along_bend) {
    if (target.type != RigTarget::Type::bone) return;
    need(node, bone_node(target.index));
    if (along_bend && program_.bones[target.index].is_bendy()) need(node, segments_node(target.index));
  };
  const auto initial = [&](int setting) { return program_.map.values()[constraint.values + setting].initial; };
  const bool along_bend = constraint.type == ConstraintType::armature || initial(kAlongBend) != 0;
  for (const RigTarget& target : constraint.targets) need_target(target, along_bend);
  need_target(constraint.space, false);
  need_values(node, constraint.values, setting_count(constraint.type));
  if (constraint.type == ConstraintType::armature) {
    need_values(node, constraint.weights, static_cast<int>(constraint.targets.size()));
  }
}

void Graph::add_tree(int index) {
  for (const int constraint : program_.trees[index].constraints) {
    add_constraint(tree_node(index), program_.constraints[constraint]);
  }
  for (const Constraint& constraint : program_.constraints) {
    if (constraint.type == ConstraintType::ik) need_drivers_of(tree_node(index), constraint.bone);
  }
}

void Graph::add_chain(int index) {
  const Chain& chain = program_.chains[index];
  const Spline& spline = program_.splines[chain.spline];
  const int node = chain_node(index);
  add_constraint(node, program_.constraints[chain.constraint]);
  need_values(node, spline.radii, static_cast<int>(spline.points.size()));
  for (const ShapeOfSpline& key : spline.keys) need_values(node, key.value, 1);
  for (const SplineHook& hook : spline.hooks) {
    if (hook.target.type == RigTarget::Type::bone) need(node, bone_node(hook.target.index));
  }
}

void Graph::need_bent(int driver, int value) {
  const int bone = value / kBoneValueCount;
  const int place = value % kBoneValueCount;
  const bool is_bend = bone < bones_ && place >= kPoseBend && place < kIk && program_.bones[bone].is_bendy();
  if (is_bend && program_.drivers[driver].value / kBoneValueCount != bone) {
    need(driver_node(driver), segments_node(bone));
  }
}

void Graph::add_driver(int index) {
  const int node = driver_node(index);
  for (const Variable& variable : program_.drivers[index].variables) {
    if (variable.type == Variable::Type::value) {
      need_values(node, variable.value, 1);
      const int owner = owners_[variable.value];
      if (owner >= 0 && owner != owners_[program_.drivers[index].value]) need_drivers_of(node, owner);
      need_bent(index, variable.value);
    }
    if (variable.type == Variable::Type::bone_length) need(node, bone_node(variable.value));
    for (const ReadTarget& read : variable.targets) {
      if (read.target.type != RigTarget::Type::bone) continue;
      const bool reads_channels =
          read.space == TransformSpace::transform && variable.type != Variable::Type::rotation_difference;
      if (reads_channels) need_values(node, program_.bones[read.target.index].values, kPoseBend);
      // Blender waits for the bone even then, unless it is the driven one.
      if (!reads_channels || read.target.index != owners_[program_.drivers[index].value]) {
        need(node, bone_node(read.target.index));
      }
    }
  }
}

std::string Graph::name(int node) const {
  const auto bone_name = [&](int bone) {
    std::string path = program_.map.name(program_.bones[bone].values);
    return "bone " + path.substr(path.find('['), path.rfind(']', path.rfind('.')) - path.find('[') + 1);
  };
  if (node < bones_) return bone_name(node);
  if (node < tree_node(0)) return "the driver of " + program_.map.name(program_.drivers[node - bones_].value);
  if (node < segments_node(0)) return "the IK of " + bone_name(program_.trees[node - tree_node(0)].bones.front());
  if (node < chain_node(0)) return "the segments of " + bone_name(node - segments_node(0));
  return "the Spline IK of " + bone_name(program_.chains[node - chain_node(0)].bones.front());
}

void Graph::refuse_cycle(const std::vector<int>& path, int again) const {
  const auto first = std::find(path.begin(), path.end(), again);
  std::string names;
  for (auto node = path.end(); node != first;) names += name(*--node) + " -> ";
  fail("the rig has a cycle: ", names, name(path.back()),
       ". Blender cuts it somewhere, so the order is its own; remove one of these dependencies");
}

std::vector<Operation> Graph::sorted() {
  std::vector<Operation> order;
  std::vector<Mark> marks(needs_.size(), Mark::unseen);
  std::vector<int> path;
  std::vector<std::size_t> next(needs_.size(), 0);
  std::vector<int> levels(needs_.size(), 0);
  const auto write = [&](int node) {
    for (const int other : needs_[node]) {
      const bool is_tree = other >= tree_node(0) && other < segments_node(0);
      levels[node] = std::max(levels[node], levels[other] + (is_tree ? 1 : 0));
    }
    if (node < bones_) {
      order.push_back({Operation::Type::bone, node, levels[node]});
    } else if (node < tree_node(0)) {
      order.push_back({Operation::Type::driver, node - bones_, levels[node]});
    } else if (node < segments_node(0)) {
      order.push_back({Operation::Type::tree, node - tree_node(0), levels[node]});
    } else if (node < chain_node(0)) {
      order.push_back({Operation::Type::segments, node - segments_node(0), levels[node]});
    } else {
      order.push_back({Operation::Type::chain, node - chain_node(0), levels[node]});
    }
  };
  for (int start = 0; start < static_cast<int>(needs_.size()); ++start) {
    const bool is_solved_with_others = start < bones_ && bone_node(start) != start;
    const int bone = start - segments_node(0);
    const bool is_straight = bone >= 0 && bone < bones_ && !program_.bones[bone].is_bendy();
    if (is_solved_with_others || is_straight || marks[start] == Mark::done) continue;
    path.assign(1, start);
    marks[start] = Mark::open;
    while (!path.empty()) {
      const int node = path.back();
      if (next[node] == needs_[node].size()) {
        marks[node] = Mark::done;
        write(node);
        path.pop_back();
        continue;
      }
      const int other = needs_[node][next[node]++];
      if (marks[other] == Mark::open) refuse_cycle(path, other);
      if (marks[other] == Mark::done) continue;
      marks[other] = Mark::open;
      path.push_back(other);
    }
  }
  // Trees that do not need each other are solved at the same time.
  std::ranges::stable_sort(order, {}, [](const Operation& operation) {
    return std::pair(operation.level, operation.type == Operation::Type::tree);
  });
  return order;
}

}  // namespace

std::vector<Tree> find_trees(std::vector<Bone>& bones, const std::vector<Constraint>& constraints,
                             const ValueMap& map) {
  Groups groups(bones.size());
  std::vector<std::pair<int, int>> tips;  // a bone of the chain, and the constraint
  std::vector<char> is_in_chain(bones.size(), 0);
  int owner = -1;
  int tip = -1;
  for (std::size_t i = 0; i < constraints.size(); ++i) {
    const Constraint& constraint = constraints[i];
    const auto setting = [&](int place) { return map.values()[constraint.values + place].initial; };
    if (constraint.type != ConstraintType::ik || setting(kValid) == 0) continue;
    if (!has_ik_target(constraint)) continue;
    // A chain that would begin above a root has no bones: Blender leaves the root alone.
    if (setting(kIkUseTail) == 0 && bones[constraint.bone].parent < 0) continue;
    if (constraint.bone != owner) owner = tip = constraint.bone;
    if (setting(kIkUseTail) == 0 && bones[tip].parent >= 0) tip = bones[tip].parent;  // see ik_plan.cpp
    const int count = static_cast<int>(clamped(setting(kIkChainLength), 0, 255));
    for (const int bone : ik_chain(bones, tip, count)) {
      is_in_chain[bone] = 1;
      groups.join(tip, bone);
    }
    tips.emplace_back(tip, static_cast<int>(i));
  }
  std::vector<Tree> trees;
  std::unordered_map<int, int> numbers;  // of groups
  for (std::size_t i = 0; i < bones.size(); ++i) {
    if (!is_in_chain[i]) continue;
    const auto [entry, is_new] = numbers.emplace(groups.of(static_cast<int>(i)), static_cast<int>(trees.size()));
    if (is_new) trees.emplace_back();
    bones[i].tree = entry->second;
    trees[entry->second].bones.push_back(static_cast<int>(i));
  }
  for (const auto& [bone, constraint] : tips) trees[bones[bone].tree].constraints.push_back(constraint);
  return trees;
}

std::vector<Operation> put_in_order(const Program& program) { return Graph(program).sorted(); }

std::vector<char> written_values(const Program& program) {
  std::vector<char> written(program.map.values().size(), 0);
  for (const ProgramCurve& curve : program.curves) written[curve.value] = 1;
  for (const MixedNumber& mixed : program.nla.numbers) written[mixed.value] = 1;
  for (const ProgramDriver& driver : program.drivers) written[driver.value] = 1;
  return written;
}

}  // namespace sinew::rig
