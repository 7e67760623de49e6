#include "rig/order.h"

#include <algorithm>
#include <numeric>
#include <optional>
#include <unordered_map>
#include <utility>

#include "base/check.h"
#include "rig/constraints/constraint.h"
#include "rig/constraints/ik.h"
#include "rig/constraints/spline_ik.h"
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

/// Blender's graph of a rig: operations as nodes, each with the nodes that it needs. A bone is first ready, as its
/// channels and constraints pose it, and done when IK and Spline IK have moved it. Bones that the same chain moves or
/// reaches for read of each other what is ready: otherwise they would wait for themselves.
class Graph {
 public:
  explicit Graph(const Program& program)
      : program_(program),
        written_(written_values(program)),
        bones_(static_cast<int>(program.bones.size())),
        drivers_(static_cast<int>(program.drivers.size())),
        needs_(4 * bones_ + drivers_ + program.constraints.size() + 1),
        roots_(program.bones.size()),
        is_early_(program.bones.size()),
        chains_(program.constraints.size(), -1) {
    note_owners();
    writers_.assign(owners_.size(), -1);
    for (int i = 0; i < drivers_; ++i) {
      next_writer_.push_back(std::exchange(writers_[program.drivers[i].value], i));
      const int owner = owners_[program.drivers[i].value];
      if (owner >= 0) drivers_of_bones_[owner].push_back(i);
    }
    for (std::size_t i = 0; i < program.chains.size(); ++i) chains_[program.chains[i].constraint] = static_cast<int>(i);
    for (std::size_t i = 0; i < program.solves.size(); ++i) solves_[program.solves[i].root] = static_cast<int>(i);
    for (int i = 0; i < static_cast<int>(program.constraints.size()); ++i) add_solver(i);
    for (const Tree& tree : program.trees) {
      for (std::size_t i = 0; i < tree.tips.size(); ++i) {
        if (tree.tips[i] != tip_of(program.constraints[tree.constraints[i]])) add_ik(tree.constraints[i], tree.tips[i]);
      }
    }
    for (const Constraint& constraint : program.constraints) check_idle_chain(constraint);
    for (int i = 0; i < bones_; ++i) add_bone(i);
    for (int i = 0; i < drivers_; ++i) add_driver(i);
  }

  std::vector<Operation> sorted();

 private:
  enum class Mark : char { unseen, open, done };

  int ready_node(int bone) const { return bone; }
  int driver_node(int driver) const { return bones_ + driver; }
  int segments_node(int bone) const { return bones_ + drivers_ + bone; }
  int done_node(int bone) const { return segments_node(bones_) + bone; }
  /// The IK of all chains that begin at a bone.
  int ik_node(int root) const { return done_node(bones_) + root; }
  int spline_node(int constraint) const { return ik_node(bones_) + constraint; }
  /// What Blender prepares for the IK of all bones.
  int plan_node() const { return static_cast<int>(needs_.size()) - 1; }

  bool is_solved(int bone) const { return program_.bones[bone].tree >= 0 || program_.bones[bone].chain >= 0; }
  bool have_common_root(int a, int b) const {
    return std::ranges::any_of(roots_[a], [&](int root) { return std::ranges::count(roots_[b], root) != 0; });
  }
  bool is_above_in_tree(int bone, int other) const;
  float initial(const Constraint& constraint, int setting) const {
    return program_.map.values()[constraint.values + setting].initial;
  }

  /// Where an IK chain ends, for Blender's graph; -1 for none.
  int tip_of(const Constraint& constraint) const {
    return initial(constraint, kIkUseTail) != 0 ? constraint.bone : program_.bones[constraint.bone].parent;
  }

  void need(int node, int other) { needs_[node].push_back(other); }
  void need_values(int node, int first, int count) {
    for (int value = first; value < first + count; ++value) {
      for (int driver = writers_[value]; driver >= 0; driver = next_writer_[driver]) need(node, driver_node(driver));
    }
  }
  void need_done(int node, const RigTarget& target) {
    if (target.type == RigTarget::Type::bone) need(node, done_node(target.index));
  }

  // Blender's graph is coarser than what is computed. Its needs are kept too, so that its cycles are found.

  void note_owners();

  /// All drivers of a bone, as of its location or of a constraint's influence.
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
  void add_constraint(const Constraint& constraint);
  void add_driver(int index);
  void add_solver(int constraint);
  void add_ik(int constraint, int tip);
  void add_spline(int constraint);
  void need_spline(int node, const Spline& spline);
  void check_idle_chain(const Constraint& constraint) const;
  void add_chain(int node, const std::vector<int>& bones);
  void see_ready(int bone);
  std::optional<Operation> operation_of(int node) const;
  std::vector<int> in_line() const;
  std::vector<char> needed_by_bones(const std::vector<int>& line) const;
  std::string name(int node) const;
  [[noreturn]] void refuse_cycle(const std::vector<int>& path, int again) const;

  const Program& program_;
  std::vector<char> written_;
  int bones_;
  int drivers_;
  std::vector<std::vector<int>> needs_;
  std::vector<std::vector<int>> roots_;  // of each bone, where the chains begin that move it or reach for it
  std::vector<char> is_early_;  // bones of chains that are posed before, since others read them as they are then
  std::vector<int> chains_;     // of each constraint, or -1
  std::unordered_map<int, int> solves_;  // by root
  std::vector<int> writers_;             // of each number, the last driver that sets it, or -1
  std::vector<int> next_writer_;         // of each driver, the one before it that sets the same number
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

bool Graph::is_above_in_tree(int bone, int other) const {
  const Bone& own = program_.bones[other];
  for (int above = own.parent; above >= 0; above = program_.bones[above].parent) {
    if (program_.bones[above].tree != own.tree || program_.bones[above].chain != own.chain) return false;
    if (above == bone) return true;
  }
  return false;
}

void Graph::add_chain(int node, const std::vector<int>& bones) {
  const int root = bones.back();
  need(node, plan_node());
  for (const int bone : bones) {
    need(node, ready_node(bone));
    need(done_node(bone), node);
    roots_[bone].push_back(root);
  }
  // The solvers of chains above that overlap come first, if Blender has seen them by now.
  int above = -1;
  for (int bone = program_.bones[root].parent; bone >= 0; bone = program_.bones[bone].parent) {
    if (!have_common_root(root, bone)) break;
    above = bone;
  }
  if (above >= 0) need(node, done_node(above));
}

void Graph::add_solver(int index) {
  const Constraint& constraint = program_.constraints[index];
  if (constraint.type == ConstraintType::spline_ik) add_spline(index);
  if (constraint.type != ConstraintType::ik || initial(constraint, kValid) == 0) return;
  if (const int tip = tip_of(constraint); tip >= 0) add_ik(index, tip);
  const auto begin = written_.begin() + constraint.values;
  const bool is_animated = std::any_of(begin, begin + setting_count(constraint.type), [](char is) { return is != 0; });
  if (is_animated) need_drivers_of(plan_node(), constraint.bone);
}

void Graph::add_ik(int index, int tip) {
  const Constraint& constraint = program_.constraints[index];
  const int count = static_cast<int>(clamped(initial(constraint, kIkChainLength), 0, 255));
  const std::vector<int> chain = ik_chain(program_.bones, tip, count);
  const int node = ik_node(chain.back());
  for (const RigTarget& target : constraint.targets) need_done(node, target);
  const RigTarget& goal = constraint.targets[0];
  if (goal.type == RigTarget::Type::bone) roots_[goal.index].push_back(chain.back());
  add_chain(node, chain);
}

/// Refuses IK without a target that reaches into other chains, unless it is within a single one. Blender then takes the
/// pose of bones before or after IK, as it happens.
void Graph::check_idle_chain(const Constraint& constraint) const {
  if (constraint.type != ConstraintType::ik || initial(constraint, kValid) == 0 || has_ik_target(constraint)) return;
  const int tip = tip_of(constraint);
  if (tip < 0) return;
  const int count = static_cast<int>(clamped(initial(constraint, kIkChainLength), 0, 255));
  const std::vector<int> chain = ik_chain(program_.bones, tip, count);
  if (std::ranges::none_of(chain, [&](int bone) { return is_solved(bone); })) return;
  const auto is_within = [&](const Solve& solve) {
    const bool has_own_root = solve.root == chain.back() || !solves_.contains(chain.back());
    return has_own_root && std::ranges::all_of(chain, [&](int bone) {
             return program_.bones[bone].chain < 0 && std::ranges::count(solve.bones, bone) != 0;
           });
  };
  if (std::ranges::any_of(program_.solves, is_within)) return;
  fail("the IK of ", name(constraint.bone),
       " has no target and reaches into another chain, of which Blender takes the pose before or after IK, as it "
       "happens; remove this constraint");
}

void Graph::add_spline(int index) {
  const Constraint& constraint = program_.constraints[index];
  const int count = static_cast<int>(clamped(initial(constraint, kSplineChainLength), 1, 255));
  const int node = spline_node(index);
  add_chain(node, ik_chain(program_.bones, constraint.bone, count));
  if (chains_[index] < 0) return;
  need_spline(node, program_.splines[program_.chains[chains_[index]].spline]);
}

void Graph::need_spline(int node, const Spline& spline) {
  if (spline.time >= 0) need_values(node, spline.time, 1);
  need_values(node, spline.radii, static_cast<int>(spline.points.size()));
  for (const ShapeOfSpline& key : spline.keys) need_values(node, key.value, 1);
  for (const SplineHook& hook : spline.hooks) need_done(node, hook.target);
}

void Graph::add_bone(int index) {
  const Bone& bone = program_.bones[index];
  const int node = ready_node(index);
  need(done_node(index), node);
  if (bone.parent >= 0) {
    const bool sees_ready = have_common_root(index, bone.parent);
    need(node, sees_ready ? ready_node(bone.parent) : done_node(bone.parent));
    if (sees_ready && !is_solved(index)) see_ready(bone.parent);
  }
  need_drivers_of(node, index);
  for (int i = 0; i < bone.constraint_count; ++i) add_constraint(program_.constraints[bone.first_constraint + i]);
  // Blender waits for the drivers of bends also where nothing bends.
  need_values(node, bone.values + kRestBend, kBendValueCount);
  if (bone.is_bendy()) {
    add_segments(index);
  } else {
    need_values(done_node(index), bone.values + kPoseBend, kBendValueCount);
  }
}

void Graph::add_segments(int index) {
  const Bone& bone = program_.bones[index];
  const int node = segments_node(index);
  need(node, done_node(index));
  for (const int handle : bone.bend.handles) {
    if (handle < 0) continue;
    const Bone& other = program_.bones[handle];
    need(node, done_node(handle));
    if (other.parent >= 0) need(node, done_node(other.parent));
    need_values(node, other.values + kPoseBend + kBendRollOut, 1);
    need_values(node, other.values + kRestBend + kBendRollOut, 1);
  }
  const int before = bone.bend.handles[0];
  if (bone.bend.uses_end_roll && before >= 0 && program_.bones[before].is_bendy()) need(node, segments_node(before));
  need_values(node, bone.values + kPoseBend, kBendValueCount);
  need_values(node, bone.values + kRestBend, kBendValueCount);
}

void Graph::add_constraint(const Constraint& constraint) {
  const int node = ready_node(constraint.bone);
  const auto need_target = [&](const RigTarget& target, bool is_final, bool along_bend) {
    if (target.type != RigTarget::Type::bone) return;
    if (along_bend && program_.bones[target.index].is_bendy()) {
      need(node, segments_node(target.index));
    } else if (is_final || !have_common_root(constraint.bone, target.index)) {
      need(node, done_node(target.index));
    } else {
      need(node, ready_node(target.index));
      if (may_act(program_, written_, constraint.values) && !is_above_in_tree(target.index, constraint.bone))
        see_ready(target.index);
    }
  };
  const bool is_armature = constraint.type == ConstraintType::armature;
  const bool along_bend = is_armature || initial(constraint, kAlongBend) != 0;
  for (const RigTarget& target : constraint.targets) need_target(target, is_armature, along_bend);
  need_target(constraint.space, false, false);
  if (constraint.type == ConstraintType::follow_path && constraint.spline >= 0) {
    need_spline(node, program_.splines[constraint.spline]);
  }
}

/// Has a bone that a chain moves posed before, with all that this reads in turn.
void Graph::see_ready(int index) {
  if (!is_solved(index) || is_early_[index]) return;
  is_early_[index] = 1;
  const Bone& bone = program_.bones[index];
  const auto see = [&](int other) {
    if (have_common_root(index, other)) see_ready(other);
  };
  if (bone.parent >= 0) see(bone.parent);
  for (int i = 0; i < bone.constraint_count; ++i) {
    const Constraint& constraint = program_.constraints[bone.first_constraint + i];
    for (const RigTarget& target : constraint.targets) {
      if (target.type == RigTarget::Type::bone) see(target.index);
    }
    if (constraint.space.type == RigTarget::Type::bone) see(constraint.space.index);
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
    if (variable.type == Variable::Type::bone_length) need(node, done_node(variable.value));
    for (const ReadTarget& read : variable.targets) {
      if (read.target.type != RigTarget::Type::bone) continue;
      const bool reads_channels =
          read.space == TransformSpace::transform && variable.type != Variable::Type::rotation_difference;
      if (reads_channels) need_values(node, program_.bones[read.target.index].values, kPoseBend);
      // Blender waits for the bone even then, unless it is the driven one.
      if (!reads_channels || read.target.index != owners_[program_.drivers[index].value]) {
        need(node, done_node(read.target.index));
      }
    }
  }
}

std::string Graph::name(int node) const {
  const auto bone_name = [&](int bone) {
    std::string path = program_.map.name(program_.bones[bone].values);
    return "bone " + path.substr(path.find('['), path.rfind(']', path.rfind('.')) - path.find('[') + 1);
  };
  if (node < driver_node(0)) return bone_name(node);
  if (node < segments_node(0)) return "the driver of " + program_.map.name(program_.drivers[node - bones_].value);
  if (node < done_node(0)) return "the segments of " + bone_name(node - segments_node(0));
  if (node < ik_node(0)) return bone_name(node - done_node(0));
  if (node < spline_node(0)) return "the IK of " + bone_name(node - ik_node(0));
  if (node == plan_node()) return "the settings of IK";
  return "the Spline IK of " + bone_name(program_.constraints[node - spline_node(0)].bone);
}

void Graph::refuse_cycle(const std::vector<int>& path, int again) const {
  const auto first = std::find(path.begin(), path.end(), again);
  const std::string last = name(path.back());
  std::string names = last;
  std::string before = last;
  for (auto node = first; node != path.end(); ++node) {
    const std::string own = name(*node);
    if (own != before) names.insert(0, own + " -> ");
    before = own;
  }
  fail("the rig has a cycle: ", names,
       ". Blender cuts it somewhere, so the order is its own; remove one of these dependencies");
}

/// All nodes, each after those that it needs. Throws InputError for a cycle.
std::vector<int> Graph::in_line() const {
  std::vector<int> line;
  std::vector<Mark> marks(needs_.size(), Mark::unseen);
  std::vector<int> path;
  std::vector<std::size_t> next(needs_.size(), 0);
  for (int start = 0; start < static_cast<int>(needs_.size()); ++start) {
    if (marks[start] == Mark::done) continue;
    path.assign(1, start);
    marks[start] = Mark::open;
    while (!path.empty()) {
      const int node = path.back();
      if (next[node] == needs_[node].size()) {
        marks[node] = Mark::done;
        line.push_back(node);
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
  return line;
}

/// What a node computes, if anything.
std::optional<Operation> Graph::operation_of(int node) const {
  if (node < driver_node(0)) {
    if (is_solved(node) && !is_early_[node]) return std::nullopt;
    return Operation{Operation::Type::bone, node};
  }
  if (node < segments_node(0)) return Operation{Operation::Type::driver, node - driver_node(0)};
  if (node < done_node(0)) {
    const int bone = node - segments_node(0);
    if (!program_.bones[bone].is_bendy()) return std::nullopt;
    return Operation{Operation::Type::segments, bone};
  }
  if (node < ik_node(0) || node == plan_node()) return std::nullopt;
  if (node < spline_node(0)) {
    const auto found = solves_.find(node - ik_node(0));
    if (found == solves_.end()) return std::nullopt;
    return Operation{Operation::Type::tree, found->second};
  }
  const int chain = chains_[node - spline_node(0)];
  if (chain < 0) return std::nullopt;
  return Operation{Operation::Type::chain, chain};
}

/// Which nodes there have to be for others than segments of B-bones. line: as in_line returns it.
std::vector<char> Graph::needed_by_bones(const std::vector<int>& line) const {
  std::vector<char> found(needs_.size(), 1);
  std::fill(found.begin() + segments_node(0), found.begin() + done_node(0), 0);
  for (auto node = line.rbegin(); node != line.rend(); ++node) {
    if (found[*node] == 0) continue;
    for (const int other : needs_[*node]) found[other] = 1;
  }
  return found;
}

std::vector<Operation> Graph::sorted() {
  std::vector<Operation> order;
  std::vector<int> levels(needs_.size(), 0);
  std::vector<int> last_of_trees(program_.trees.size(), -1);
  const std::vector<int> line = in_line();
  const std::vector<char> are_needed = needed_by_bones(line);
  for (const int node : line) {
    std::optional<Operation> operation = operation_of(node);
    const bool is_tree = operation && operation->type == Operation::Type::tree;
    if (is_tree) {  // those that share bones one after the other
      const int before = std::exchange(last_of_trees[program_.solves[operation->index].tree], node);
      if (before >= 0) need(node, before);
    }
    for (const int other : needs_[node]) {
      const bool is_after_tree = other >= ik_node(0) && other < spline_node(0) && solves_.contains(other - ik_node(0));
      levels[node] = std::max(levels[node], levels[other] + (is_after_tree ? 1 : 0));
    }
    if (!operation) continue;
    operation->level = levels[node];
    operation->is_shown = are_needed[node] == 0;
    order.push_back(*operation);
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
    // A second constraint without "use tail" begins one bone further up.
    if (setting(kIkUseTail) == 0 && bones[tip].parent >= 0) tip = bones[tip].parent;
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
  for (const auto& [bone, constraint] : tips) {
    Tree& tree = trees[bones[bone].tree];
    tree.constraints.push_back(constraint);
    tree.tips.push_back(bone);
  }
  return trees;
}

std::vector<Solve> find_solves(const Program& program) {
  std::vector<Solve> solves;
  for (std::size_t i = 0; i < program.trees.size(); ++i) {
    const Tree& tree = program.trees[i];
    const std::size_t first = solves.size();
    for (std::size_t k = 0; k < tree.tips.size(); ++k) {
      const float count =
          program.map.values()[program.constraints[tree.constraints[k]].values + kIkChainLength].initial;
      const std::vector<int> chain = ik_chain(program.bones, tree.tips[k], static_cast<int>(clamped(count, 0, 255)));
      const auto with_root = [&](const Solve& solve) { return solve.root == chain.back(); };
      auto solve = std::find_if(solves.begin() + static_cast<std::ptrdiff_t>(first), solves.end(), with_root);
      if (solve == solves.end()) solve = solves.insert(solve, {static_cast<int>(i), chain.back(), {}});
      solve->bones.insert(solve->bones.end(), chain.rbegin(), chain.rend());
    }
  }
  return solves;
}

std::vector<Operation> put_in_order(const Program& program) { return Graph(program).sorted(); }

std::vector<char> written_values(const Program& program) {
  std::vector<char> written(program.map.values().size(), 0);
  for (const ProgramCurve& curve : program.curves) written[curve.value] = 1;
  for (const MixedNumber& mixed : program.nla.numbers) written[mixed.value] = 1;
  for (const ProgramDriver& driver : program.drivers) written[driver.value] = 1;
  return written;
}

bool stays(const Program& program, const std::vector<char>& written, int value, bool is_on) {
  return !written[value] && (program.map.values()[value].initial != 0) == is_on;
}

bool may_act(const Program& program, const std::vector<char>& written, int first) {
  const auto is_always = [&](int setting, bool is_on) { return stays(program, written, first + setting, is_on); };
  return !is_always(kMuted, true) && !is_always(kEnabled, false) && !is_always(kValid, false) &&
         !is_always(kInfluence, false);
}

}  // namespace sinew::rig
