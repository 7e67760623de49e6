#include "sinew/rig_skeleton.h"

#include <algorithm>
#include <cctype>
#include <numeric>
#include <set>

#include "base/text.h"
#include "files/write_files.h"

namespace sinew {
namespace {

/// Returns R(j) of joints without a rest rotation: a translation from the parent's head to the joint's own.
std::vector<Matrix4<double>> rest_from_heads(std::span<const std::int32_t> parents, const Eigen::MatrixX3d& heads) {
  const auto count = static_cast<std::int32_t>(parents.size());
  if (heads.rows() != count) {
    fail("there are ", plural(heads.rows(), "head"), "; the skeleton has ", plural(count, "joint"));
  }
  std::vector<Matrix4<double>> rest(count, Matrix4<double>::Identity());
  for (std::int32_t j = 0; j < count; ++j) {
    Eigen::Vector3d offset = heads.row(j);
    // Skeleton reports a parent that is out of range.
    if (parents[j] >= 0 && parents[j] < count) offset -= heads.row(parents[j]);
    rest[j].topRightCorner<3, 1>() = offset;
  }
  return rest;
}

std::vector<std::string> usable_names(std::vector<std::string> names, std::size_t count) {
  const std::set<std::string> distinct(names.begin(), names.end());
  if (names.size() == count && distinct.size() == count && !distinct.contains("")) return names;
  names.clear();
  for (std::size_t j = 0; j < count; ++j) names.push_back("joint_" + std::to_string(j));
  return names;
}

/// Whether text after the fifth field of a .bf line is read back as a joint's name: it must be neither
/// a sixth number nor a comment.
bool is_name(std::string_view text) {
  if (text != trimmed(text) || text.find('\n') != text.npos || text.starts_with('#')) return false;
  const std::string_view first = next_word(text);
  double number;
  return !first.empty() && !parse_number(first, number);
}

struct BoneForest {
  std::vector<std::int32_t> weight_columns;
  std::vector<std::int32_t> parents;
  std::vector<Eigen::Vector3d> offsets;
  std::vector<std::string> names;

  std::int32_t count() const { return static_cast<std::int32_t>(parents.size()); }
};

BoneForest read_rows(LineReader& file) {
  BoneForest forest;
  while (file.next_line()) {
    std::string_view blank = file.line();
    if (next_word(blank).empty()) continue;
    forest.weight_columns.push_back(file.number<std::int32_t>("a weight index"));
    if (forest.weight_columns.back() < -1) file.fail_here("expected a weight index of -1 (none) or more");
    forest.parents.push_back(file.number<std::int32_t>("the parent's row"));
    Eigen::Vector3d offset;
    for (double& coordinate : offset) coordinate = file.number<double>("an offset");
    forest.offsets.push_back(offset);
    const std::string_view text = trimmed(file.rest());
    forest.names.emplace_back(is_name(text) ? text : "");
  }
  if (forest.parents.empty()) fail(file.name(), " holds no joints");
  return forest;
}

Convention detected(std::span<const std::int32_t> parents, std::span<const std::int32_t> weight_columns) {
  for (std::size_t j = 0; j < parents.size(); ++j) {
    if (parents[j] < 0 && weight_columns[j] < 0) return Convention::bone;
  }
  return Convention::joint;
}

/// Returns where each joint's bone is drawn to when only joints are known: the mean of the children, or for a leaf a
/// point farther on.
Eigen::MatrixX3d tails_from_children(std::span<const std::int32_t> parents, const Eigen::MatrixX3d& heads) {
  Eigen::MatrixX3d tails = Eigen::MatrixX3d::Zero(heads.rows(), 3);
  std::vector<int> children(parents.size(), 0);
  for (std::size_t j = 0; j < parents.size(); ++j) {
    if (parents[j] < 0) continue;
    tails.row(parents[j]) += heads.row(j);
    ++children[parents[j]];
  }
  for (std::size_t j = 0; j < parents.size(); ++j) {
    if (children[j] > 0) {
      tails.row(j) /= children[j];
    } else if (parents[j] >= 0) {
      tails.row(j) = heads.row(j) + (heads.row(j) - heads.row(parents[j])) / 2;
    } else {
      tails.row(j) = heads.row(j);
    }
  }
  return tails;
}

RigSkeleton read_bone_forest(const Path& path, std::optional<Convention> wanted) {
  LineReader file(path);
  BoneForest forest = read_rows(file);
  return naming(path, [&] {
    // Skeleton checks the parents; then positions can be summed down the tree.
    std::vector<Matrix4<double>> rest(forest.count(), Matrix4<double>::Identity());
    for (std::int32_t j = 0; j < forest.count(); ++j) {
      rest[j].topRightCorner<3, 1>() = forest.offsets[j];
    }
    const Skeleton joints(forest.parents, rest);
    Eigen::MatrixX3d positions(forest.count(), 3);
    for (std::int32_t j = 0; j < forest.count(); ++j) {
      positions.row(j) = joints.rest_world()[j].topRightCorner<3, 1>();
    }

    const Convention convention = wanted.value_or(detected(forest.parents, forest.weight_columns));
    Eigen::MatrixX3d heads = positions;
    Eigen::MatrixX3d tails = positions;
    if (convention == Convention::bone) {
      for (std::int32_t j = 0; j < forest.count(); ++j) {
        if (forest.parents[j] >= 0) heads.row(j) = positions.row(forest.parents[j]);
      }
    } else {
      tails = tails_from_children(forest.parents, positions);
    }
    return RigSkeleton(forest.parents, heads, tails, std::move(forest.weight_columns), std::move(forest.names),
                       convention);
  });
}

/// Goes to the next line that is not blank; false at the end of the section or of the file.
bool next_of_section(LineReader& file) {
  while (file.next_line()) {
    std::string_view line = file.line();
    const std::string_view first = next_word(line);
    if (!first.empty()) return !first.starts_with('#');
  }
  return false;
}

RigSkeleton read_trivial_graph(const Path& path) {
  LineReader file(path);
  std::vector<Eigen::Vector3d> joints;
  while (next_of_section(file)) {
    const auto number = file.number<std::int32_t>("a joint's number");
    if (number != static_cast<std::int32_t>(joints.size()) + 1) {
      file.fail_here("joint ", number, " found; expected joint ", joints.size() + 1);
    }
    Eigen::Vector3d position;
    for (double& coordinate : position) coordinate = file.number<double>("a coordinate");
    joints.push_back(position);
  }

  const auto joint_count = static_cast<std::int32_t>(joints.size());
  std::vector<std::int32_t> starts, ends;
  std::vector<std::int32_t> bone_ending_at(joints.size(), -1);
  while (next_of_section(file)) {
    for (auto* list : {&starts, &ends}) {
      const auto joint = file.number<std::int32_t>("a joint's number");
      if (joint < 1 || joint > joint_count) {
        file.fail_here("joint ", joint, " does not exist; there are ", joint_count);
      }
      list->push_back(joint - 1);
    }
    if (bone_ending_at[ends.back()] >= 0) {
      file.fail_here("a second bone ends at joint ", ends.back() + 1, "; expected a tree");
    }
    bone_ending_at[ends.back()] = static_cast<std::int32_t>(ends.size()) - 1;
  }
  if (ends.empty()) fail(file.name(), " holds no bones");

  const auto count = static_cast<std::int32_t>(ends.size());
  std::vector<std::int32_t> parents(count), columns(count);
  Eigen::MatrixX3d heads(count, 3), tails(count, 3);
  for (std::int32_t bone = 0; bone < count; ++bone) {
    parents[bone] = bone_ending_at[starts[bone]];
    columns[bone] = bone;
    heads.row(bone) = joints[starts[bone]];
    tails.row(bone) = joints[ends[bone]];
  }
  return naming(path, [&] { return RigSkeleton(parents, heads, tails, columns, {}, Convention::bone); });
}

void append_row(std::string& text, const Eigen::RowVector3d& point) {
  for (const double coordinate : point) {
    text += ' ';
    append_number(text, coordinate);
  }
}

/// In the bone convention a bone starts where its parent's ends; a file that stores each joint once
/// cannot represent anything else.
void check_connected(const Path& path, const RigSkeleton& skeleton) {
  for (std::ptrdiff_t j = 0; j < skeleton.joint_count(); ++j) {
    const auto parent = skeleton.parents()[j];
    if (parent >= 0 && skeleton.heads().row(j) != skeleton.tails().row(parent)) {
      fail(shown(path.filename()), " cannot hold joint ", skeleton.names()[j],
           " in the bone convention: it does not start where its parent's bone ends");
    }
  }
}

std::string bone_forest_text(const Path& path, const RigSkeleton& skeleton) {
  const bool bones = skeleton.convention() == Convention::bone;
  if (bones) check_connected(path, skeleton);
  if (detected(skeleton.parents(), skeleton.weight_columns()) != skeleton.convention()) {
    fail(shown(path.filename()), " cannot hold this skeleton: a .bf file is read in the ",
         bones ? "joint convention unless a root" : "bone convention if a root", " is without a column of weights");
  }
  const Eigen::MatrixX3d& positions = bones ? skeleton.tails() : skeleton.heads();
  std::string text;
  for (std::ptrdiff_t j = 0; j < skeleton.joint_count(); ++j) {
    const auto parent = skeleton.parents()[j];
    if (bones && parent < 0 && skeleton.heads().row(j) != skeleton.tails().row(j)) {
      fail(shown(path.filename()), " cannot hold the root bone ", skeleton.names()[j],
           ": a .bf file has a row for the joint that it starts from; write a .tgf file");
    }
    if (!is_name(skeleton.names()[j])) {
      fail(shown(path.filename()), " cannot hold the name \"", skeleton.names()[j], "\" of joint ", j,
           ": it reads as a number, a comment or nothing; rename it");
    }
    Eigen::RowVector3d offset = positions.row(j);
    if (parent >= 0) offset -= positions.row(parent);
    append_number(text, skeleton.weight_columns()[j]);
    text += ' ';
    append_number(text, parent);
    append_row(text, offset);
    text += ' ' + skeleton.names()[j] + '\n';
  }
  return text;
}

std::string trivial_graph_text(const Path& path, const RigSkeleton& skeleton) {
  const std::string name = shown(path.filename());
  if (skeleton.convention() != Convention::bone) {
    fail(name, " cannot hold a skeleton in the joint convention; write a .bf file");
  }
  check_connected(path, skeleton);
  const auto count = static_cast<std::int32_t>(skeleton.joint_count());
  // Joint number of each bone's end; the joints at which root bones start come first.
  std::vector<Eigen::RowVector3d> joints;
  std::vector<std::int32_t> start(count);
  for (std::int32_t bone = 0; bone < count; ++bone) {
    if (skeleton.weight_columns()[bone] != bone) {
      fail(name, " cannot hold joint ", skeleton.names()[bone],
           ": its bones are the columns of weights, in order; write a .bf file");
    }
    if (skeleton.parents()[bone] >= 0) continue;
    const auto same = std::find(joints.begin(), joints.end(), skeleton.heads().row(bone));
    start[bone] = static_cast<std::int32_t>(same - joints.begin());
    if (same == joints.end()) joints.emplace_back(skeleton.heads().row(bone));
  }
  const auto first_end = static_cast<std::int32_t>(joints.size());
  std::string edges = "#\n";
  for (std::int32_t bone = 0; bone < count; ++bone) {
    const auto parent = skeleton.parents()[bone];
    append_number(edges, (parent >= 0 ? first_end + parent : start[bone]) + 1);
    edges += ' ';
    append_number(edges, first_end + bone + 1);
    edges += '\n';
    joints.emplace_back(skeleton.tails().row(bone));
  }
  std::string text;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    append_number(text, j + 1);
    append_row(text, joints[j]);
    text += '\n';
  }
  return text + edges;
}

std::string ending(const Path& path) {
  std::string ending = shown(path.extension());
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (ending != ".bf" && ending != ".tgf") {
    fail(shown(path.filename()), " is not a skeleton file; expected a name that ends in .bf or .tgf");
  }
  return ending;
}

}  // namespace

RigSkeleton::RigSkeleton(std::span<const std::int32_t> parents, const Eigen::MatrixX3d& heads, Eigen::MatrixX3d tails,
                         std::vector<std::int32_t> weight_columns, std::vector<std::string> names,
                         Convention convention)
    : Skeleton(parents, rest_from_heads(parents, heads)),
      heads_(heads),
      tails_(std::move(tails)),
      weight_columns_(std::move(weight_columns)),
      names_(usable_names(std::move(names), parents.size())),
      convention_(convention) {
  if (tails_.rows() != joint_count() || static_cast<std::ptrdiff_t>(weight_columns_.size()) != joint_count()) {
    fail("there are ", plural(tails_.rows(), "tail"), " and ", plural(weight_columns_.size(), "weight column"),
         "; the skeleton has ", plural(joint_count(), "joint"));
  }
  if (!tails_.allFinite()) fail("a tail holds a number that is not finite");
  std::set<std::int32_t> taken;
  for (std::ptrdiff_t j = 0; j < joint_count(); ++j) {
    const auto column = weight_columns_[j];
    if (column < -1) fail("joint ", j, " has weight column ", column, "; expected -1 or more");
    if (column >= 0 && !taken.insert(column).second) {
      fail("two joints have weight column ", column, ", the second is joint ", j);
    }
  }
}

RigSkeleton read_skeleton(const Path& path, std::optional<Convention> convention) {
  if (ending(path) == ".bf") return read_bone_forest(path, convention);
  if (convention == Convention::joint) {
    fail(shown(path.filename()),
         " is in the bone convention, like every .tgf file; the joint convention was requested");
  }
  return read_trivial_graph(path);
}

std::string skeleton_text(const Path& path, const RigSkeleton& skeleton) {
  return ending(path) == ".bf" ? bone_forest_text(path, skeleton) : trivial_graph_text(path, skeleton);
}

void write_skeleton(const Path& path, const RigSkeleton& skeleton) { write_file(path, skeleton_text(path, skeleton)); }

}  // namespace sinew
