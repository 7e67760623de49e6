#include "sinew/bvh.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <numbers>
#include <utility>

#include "base/text.h"
#include "files/write_files.h"

namespace sinew {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr int kMostChannels = 6;

std::vector<Matrix4<double>> translations(const std::vector<Vector3d>& offsets) {
  std::vector<Matrix4<double>> rest(offsets.size(), Matrix4<double>::Identity());
  for (std::size_t j = 0; j < offsets.size(); ++j) rest[j].topRightCorner<3, 1>() = offsets[j];
  return rest;
}

Quaterniond about(int axis, double degrees) {
  return Quaterniond(Eigen::AngleAxisd(degrees / kDegrees, Vector3d::Unit(axis)));
}

bool is_same(std::string_view word, std::string_view lower) {
  return std::ranges::equal(word, lower,
                            [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; });
}

// --- reading ---------------------------------------------------------------------------------------------------------

struct Channel {
  int axis;
  bool is_position;
};

struct Hierarchy {
  std::vector<std::int32_t> parents;
  std::vector<Vector3d> offsets, ends;
  std::vector<std::string> names;
  std::vector<Channel> channels;           // of all joints, one after the other
  std::vector<std::size_t> first_channel;  // J + 1
};

/// Reads words whatever the lines are.
class Words {
 public:
  explicit Words(const Path& path) : file_(path) {}

  LineReader& file() { return file_; }

  /// The next word; empty at the end of the file.
  std::string_view next() {
    for (auto word = file_.word();; word = file_.word()) {
      if (!word.empty() || !file_.next_line()) return word;
    }
  }

  void expect(std::string_view lower, const char* shown) {
    const auto word = next();
    if (!is_same(word, lower)) refuse(word, shown);
  }

  [[noreturn]] void refuse(std::string_view word, std::string_view expected) {
    if (word.empty()) fail(file_.name(), " ends where ", expected, " is expected");
    file_.fail_here("expected ", expected, ", found ", excerpt(word));
  }

  template <class T>
  T number(const char* what) {
    const auto word = next();
    T value{};
    if (!parse_number(word, value)) refuse(word, what);
    return value;
  }

  Vector3d point(const char* what) {
    Vector3d found;
    for (double& coordinate : found) coordinate = number<double>(what);
    return found;
  }

 private:
  LineReader file_;
};

/// The rest of the line, without a brace at its end; `has_brace` tells whether there was one.
std::string name_of_joint(LineReader& file, bool& has_brace) {
  std::string_view text = trimmed(file.rest());
  has_brace = text.ends_with('{');
  if (has_brace) text = trimmed(text.substr(0, text.size() - 1));
  if (text.empty() || text.ends_with('{')) file.fail_here("expected the name of a joint");
  std::string name(text);
  while (!file.word().empty()) {
  }
  return name;
}

void read_channels(Words& words, Hierarchy& found) {
  const auto count = words.number<int>("a number of channels");
  if (count < 0 || count > kMostChannels) {
    words.file().fail_here("expected 0 to ", kMostChannels, " channels, found ", count);
  }
  std::array<bool, kMostChannels> is_there{};
  for (int i = 0; i < count; ++i) {
    const auto word = words.next();
    const bool is_position = word.size() == 9 && is_same(word.substr(1), "position");
    const bool is_rotation = word.size() == 9 && is_same(word.substr(1), "rotation");
    const int axis = word.empty() ? -1 : std::tolower(static_cast<unsigned char>(word[0])) - 'x';
    if (!(is_position || is_rotation) || axis < 0 || axis > 2) {
      words.refuse(word, "a channel such as Xposition or Zrotation");
    }
    if (std::exchange(is_there[axis + 3 * is_rotation], true)) {
      words.file().fail_here("the joint already has the channel ", excerpt(word));
    }
    found.channels.push_back({axis, is_position});
  }
}

void begin_joint(Words& words, Hierarchy& found, std::int32_t parent) {
  bool has_brace = false;
  found.names.push_back(name_of_joint(words.file(), has_brace));
  if (!has_brace) words.expect("{", "{");
  found.parents.push_back(parent);
  found.first_channel.push_back(found.channels.size());
  words.expect("offset", "OFFSET");
  found.offsets.push_back(words.point("a coordinate"));
  found.ends.push_back(Vector3d::Zero());
  words.expect("channels", "CHANNELS");
  read_channels(words, found);
}

void read_end(Words& words, Vector3d& end) {
  words.expect("site", "Site");
  words.expect("{", "{");
  words.expect("offset", "OFFSET");
  end = words.point("a coordinate");
  words.expect("}", "}");
}

/// Ends after the word MOTION.
Hierarchy read_hierarchy(Words& words) {
  Hierarchy found;
  words.expect("hierarchy", "HIERARCHY");
  std::int32_t at = -1;  // the joint whose braces are open
  for (;;) {
    const auto word = words.next();
    if (at < 0 ? is_same(word, "root") : is_same(word, "joint")) {
      begin_joint(words, found, at);
      at = static_cast<std::int32_t>(found.parents.size()) - 1;
    } else if (at >= 0 && is_same(word, "end")) {
      read_end(words, found.ends[at]);
    } else if (at >= 0 && word == "}") {
      at = found.parents[at];
    } else if (at < 0 && is_same(word, "motion") && !found.parents.empty()) {
      found.first_channel.push_back(found.channels.size());
      return found;
    } else {
      words.refuse(word, at >= 0 ? "JOINT, End Site or }" : found.parents.empty() ? "ROOT" : "ROOT or MOTION");
    }
  }
}

// --- writing ---------------------------------------------------------------------------------------------------------

/// The angles about X, Y and Z, in degrees, of which the turn about X comes first.
Vector3d angles_of(const Quaterniond& rotation) {
  const Eigen::Matrix3d m = rotation.toRotationMatrix();
  const double z = std::atan2(m(1, 0), m(0, 0)), sine = std::sin(z), cosine = std::cos(z);
  // What is left after the turn about Z is exact also where Y is a right angle, and Z is any angle.
  const double x = std::atan2(sine * m(0, 2) - cosine * m(1, 2), cosine * m(1, 1) - sine * m(0, 1));
  return kDegrees * Vector3d(x, std::atan2(-m(2, 0), m.col(0).head<2>().norm()), z);
}

/// Of the same angles with whole turns added, those that are nearest to others.
Vector3d with_turns(const Vector3d& angles, const Vector3d& others) {
  return angles + 360 * ((others - angles) / 360).array().round().matrix();
}

/// The angles of a rotation that are nearest to those of the frame before.
Vector3d angles_after(const Quaterniond& rotation, const Vector3d& before) {
  const Vector3d found = angles_of(rotation);
  const Vector3d one = with_turns(found, before);
  const Vector3d other = with_turns({found[0] + 180, 180 - found[1], found[2] + 180}, before);
  return (other - before).lpNorm<1>() < (one - before).lpNorm<1>() ? other : one;
}

void append_numbers(std::string& text, const Vector3d& numbers) {
  for (const double number : numbers) {
    text += ' ';
    append_number(text, number);
  }
}

void check_name(const Path& path, const std::string& name, std::size_t joint) {
  if (!name.empty() && name.find('\n') == name.npos && trimmed(name) == name && !name.ends_with('{')) return;
  fail(shown(path.filename()), " cannot hold the name ", excerpt(name), " of joint ", joint,
       ": it is empty, has blanks at an end, more than one line, or { at its end; rename it");
}

std::string bvh_text(const Path& path, const BvhClip& clip) {
  const auto count = clip.skeleton().joint_count();
  const auto parents = clip.skeleton().parents();
  std::vector<std::vector<std::int32_t>> children(count + 1);  // the last: the roots
  std::vector<bool> moves(count);
  for (std::int32_t j = 0; j < count; ++j) {
    check_name(path, clip.names()[j], j);
    children[parents[j] < 0 ? count : parents[j]].push_back(j);
    moves[j] = parents[j] < 0;
  }
  for (std::size_t i = 0; i < clip.locations().size(); ++i) {
    if (!clip.locations()[i].isZero(0)) moves[i % count] = true;
  }
  std::string text = "HIERARCHY\n";
  std::vector<std::int32_t> order, open;  // open: joints whose braces are
  std::vector<std::int32_t> left(children[count].rbegin(), children[count].rend());
  const auto close_until = [&](std::int32_t parent) {
    for (; !open.empty() && open.back() != parent; open.pop_back()) text += "}\n";
  };
  while (!left.empty()) {
    const auto j = left.back();
    left.pop_back();
    close_until(parents[j]);
    text += (parents[j] < 0 ? "ROOT " : "JOINT ") + clip.names()[j] + "\n{\nOFFSET";
    append_numbers(text, clip.offsets()[j]);
    text += moves[j] ? "\nCHANNELS 6 Xposition Yposition Zposition" : "\nCHANNELS 3";
    text += " Zrotation Yrotation Xrotation\n";
    if (children[j].empty()) {
      text += "End Site\n{\nOFFSET";
      append_numbers(text, clip.ends()[j]);
      text += "\n}\n";
    }
    order.push_back(j);
    open.push_back(j);
    left.insert(left.end(), children[j].rbegin(), children[j].rend());
  }
  close_until(-1);
  text += "MOTION\nFrames: " + std::to_string(clip.frame_count()) + "\nFrame Time: ";
  append_number(text, clip.frame_time());
  text += '\n';
  std::vector<Vector3d> angles(count, Vector3d::Zero());
  for (std::ptrdiff_t frame = 0; frame < clip.frame_count(); ++frame) {
    std::string line;
    for (const auto j : order) {
      const auto at = frame * count + j;
      if (moves[j]) append_numbers(line, clip.offsets()[j] + clip.locations()[at]);
      angles[j] = angles_after(clip.rotations()[at], angles[j]);
      append_numbers(line, angles[j].reverse());
    }
    text.append(line, 1);
    text += '\n';
  }
  return text;
}

}  // namespace

BvhClip::BvhClip(std::span<const std::int32_t> parents, std::vector<Vector3d> offsets, std::vector<Vector3d> ends,
                 std::vector<std::string> names, double frame_time, std::vector<Vector3d> locations,
                 std::vector<Quaterniond> rotations)
    : skeleton_(parents, translations(offsets)),
      offsets_(std::move(offsets)),
      ends_(std::move(ends)),
      names_(std::move(names)),
      frame_time_(frame_time),
      locations_(std::move(locations)),
      rotations_(std::move(rotations)) {
  const auto count = static_cast<std::size_t>(skeleton_.joint_count());
  if (count == 0) fail("there are no joints; expected at least one");
  if (ends_.size() != count || names_.size() != count) {
    fail("there are ", plural(std::ssize(ends_), "end"), " and ", plural(std::ssize(names_), "name"),
         "; the skeleton has ", plural(skeleton_.joint_count(), "joint"));
  }
  if (rotations_.empty() || rotations_.size() % count != 0 || locations_.size() != rotations_.size()) {
    fail("there are ", plural(std::ssize(locations_), "location"), " and ", plural(std::ssize(rotations_), "rotation"),
         " for ", plural(skeleton_.joint_count(), "joint"), "; expected one per joint for each of at least one frame");
  }
  frame_count_ = static_cast<std::ptrdiff_t>(rotations_.size() / count);
  if (!std::isfinite(frame_time) || frame_time <= 0) {
    fail("the frame time is ", frame_time, "; expected seconds above 0");
  }
  for (std::size_t j = 0; j < count; ++j) {
    if (!ends_[j].allFinite()) fail("the end of joint ", j, " holds a number that is not finite");
  }
  for (std::size_t i = 0; i < rotations_.size(); ++i) {
    if (!locations_[i].allFinite()) {
      fail("the location of joint ", i % count, " in frame ", i / count, " holds a number that is not finite");
    }
    const double length = rotations_[i].norm();
    if (!std::isfinite(length) || length < 1e-9) {
      fail("the quaternion of joint ", i % count, " in frame ", i / count, " has length ", length, "; expected 1");
    }
    rotations_[i].coeffs() /= length;
  }
}

BvhClip read_bvh(const Path& path) {
  Words words(path);
  Hierarchy found = read_hierarchy(words);
  const auto joints = static_cast<long long>(found.parents.size());
  words.expect("frames:", "Frames:");
  const auto frames = words.number<std::int32_t>("a number of frames");
  if (frames < 1) words.file().fail_here("expected at least 1 frame, found ", frames);
  const auto bytes = static_cast<long long>(words.file().byte_count());
  if (frames > bytes / joints) {
    fail(words.file().name(), " describes ", plural(frames, "frame"), " of ", plural(joints, "joint"),
         ", more than its ", plural(bytes, "byte"), " can hold");
  }
  words.expect("frame", "Frame Time:");
  words.expect("time:", "Frame Time:");
  const auto frame_time = words.number<double>("seconds");
  if (frame_time <= 0) words.file().fail_here("expected a frame time above 0, found ", frame_time);
  const auto total = static_cast<std::size_t>(frames * joints);
  std::vector<Vector3d> locations(total, Vector3d::Zero());
  std::vector<Quaterniond> rotations(total, Quaterniond::Identity());
  for (std::size_t i = 0; i < total; ++i) {
    const std::size_t j = i % found.parents.size();
    for (auto channel = found.first_channel[j]; channel < found.first_channel[j + 1]; ++channel) {
      const auto [axis, is_position] = found.channels[channel];
      const auto value = words.number<double>("a number of each channel on each frame");
      if (is_position) {
        locations[i][axis] = value - found.offsets[j][axis];
      } else {
        rotations[i] = rotations[i] * about(axis, value);
      }
    }
  }
  const auto word = words.next();
  if (!word.empty()) words.refuse(word, "the end of the file after the last frame");
  return naming(path, [&] {
    return BvhClip(found.parents, std::move(found.offsets), std::move(found.ends), std::move(found.names), frame_time,
                   std::move(locations), std::move(rotations));
  });
}

void write_bvh(const Path& path, const BvhClip& clip) { write_file(path, bvh_text(path, clip)); }

}  // namespace sinew
