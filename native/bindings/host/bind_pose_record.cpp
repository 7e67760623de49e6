#include <pybind11/stl.h>

#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <tuple>
#include <utility>

#include "arrays.h"
#include "host/memory.h"
#include "sinew/threads.h"

// A record of a pose: what Blender's evaluation has written into its bones, so that it can be written there again.

namespace sinew::bindings {
namespace {

using Record = py::array_t<std::uint8_t, py::array::c_style>;

/// Offsets in a pose bone, in bytes.
struct RecordLayout {
  std::ptrdiff_t next, segment_count;
  std::vector<std::array<std::ptrdiff_t, 2>> members;   // offset and size of what is in the bone itself
  std::vector<std::array<std::ptrdiff_t, 2>> computed;  // the same, of what only evaluated bones have; not compared
  std::vector<std::array<std::ptrdiff_t, 4>> segments;  // arrays: offset of the address, size and number of items; the
                                                        // number is that beyond one for each segment; 1 if compared
};

struct Region {
  Address start;
  std::size_t size;
  bool is_compared;
};

/// Returns the number of a bone's segments, 0 if it is not bent.
std::int32_t segment_count_of(Address bone, const RecordLayout& layout) {
  const auto count = read<std::int32_t>(bone + layout.segment_count);
  if (count < 2 || layout.segments.empty()) return 0;
  for (const auto& array : layout.segments) {
    if (read<Address>(bone + array[0]) == 0) return 0;
  }
  return count;
}

/// Appends the recorded memory of a bone. Returns the number of its segments, 0 if it is not bent.
std::int32_t regions_of(Address bone, const RecordLayout& layout, std::vector<Region>& regions) {
  for (const auto& [offset, size] : layout.members) {
    regions.push_back({bone + offset, static_cast<std::size_t>(size), true});
  }
  for (const auto& [offset, size] : layout.computed) {
    regions.push_back({bone + offset, static_cast<std::size_t>(size), false});
  }
  const std::int32_t count = segment_count_of(bone, layout);
  if (count == 0) return 0;
  for (const auto& [offset, size, more, is_compared] : layout.segments) {
    const auto bytes = static_cast<std::size_t>(size * (count + more));
    regions.push_back({read<Address>(bone + offset), bytes, is_compared != 0});
  }
  return count;
}

/// The recorded memory of a whole pose, and what tells whether a record was made of the same bones.
struct Pose {
  std::vector<std::int32_t> segments;  // of each bone
  std::vector<Region> regions;
  std::size_t size = 0;
};

Pose pose_at(Address bone, const RecordLayout& layout) {
  Pose pose;
  for (; bone != 0; bone = read<Address>(bone + layout.next)) {
    pose.segments.push_back(regions_of(bone, layout, pose.regions));
  }
  for (const Region& region : pose.regions) pose.size += region.size;
  return pose;
}

constexpr std::size_t kNumber = sizeof(std::int32_t);

/// A record begins with the number of bones and the number of segments of each.
std::size_t head_size(const Pose& pose) { return (pose.segments.size() + 1) * kNumber; }

Record record_pose(Address bone, const RecordLayout& layout) {
  const Pose pose = pose_at(bone, layout);
  Record record(static_cast<py::ssize_t>(head_size(pose) + pose.size));
  auto* to = reinterpret_cast<char*>(record.mutable_data());
  const auto count = static_cast<std::int32_t>(pose.segments.size());
  std::memcpy(to, &count, kNumber);
  if (count > 0) std::memcpy(to + kNumber, pose.segments.data(), count * kNumber);
  to += head_size(pose);
  for (const Region& region : pose.regions) {
    std::memcpy(to, reinterpret_cast<const void*>(region.start), region.size);
    to += region.size;
  }
  return record;
}

/// Returns what follows the head of a record, or nothing if it was made of other bones.
std::optional<const char*> body_of(const Pose& pose, const Record& record) {
  const auto* const bytes = reinterpret_cast<const char*>(record.data());
  const std::size_t head = head_size(pose);
  const auto count = static_cast<std::int32_t>(pose.segments.size());
  if (static_cast<std::size_t>(record.size()) != head + pose.size || std::memcmp(bytes, &count, kNumber) != 0 ||
      (count > 0 && std::memcmp(bytes + kNumber, pose.segments.data(), count * kNumber) != 0)) {
    return std::nullopt;
  }
  return bytes + head;
}

bool play_pose(Address bone, const RecordLayout& layout, const Record& record) {
  const Pose pose = pose_at(bone, layout);
  const auto body = body_of(pose, record);
  if (!body) return false;
  const char* from = *body;
  for (const Region& region : pose.regions) {
    std::memcpy(reinterpret_cast<void*>(region.start), from, region.size);
    from += region.size;
  }
  return true;
}

/// Whether two regions of floats are equal. A zero may have another sign: a computed pose's may differ from Blender's.
bool are_equal(const void* a, const void* b, std::size_t size) {
  if (std::memcmp(a, b, size) == 0) return true;
  for (std::size_t at = 0; at < size; at += sizeof(float)) {
    float x;
    float y;
    std::memcpy(&x, static_cast<const char*>(a) + at, sizeof x);
    std::memcpy(&y, static_cast<const char*>(b) + at, sizeof y);
    if (x != y && !(std::isnan(x) && std::isnan(y))) return false;
  }
  return true;
}

/// Fetches what is recorded of a bone into the caches, while another one is read.
void prefetch(Address bone, const RecordLayout& layout) {
#if defined(__GNUC__)
  constexpr std::ptrdiff_t kLine = 64;
  for (const auto& [offset, size] : layout.members) {
    for (std::ptrdiff_t at = 0; at < size + kLine; at += kLine) {
      __builtin_prefetch(reinterpret_cast<const void*>(bone + offset + at));
    }
  }
#endif
}

/// Goes once through the bones of a pose, which are cold, in the order of a record. Calls visit(start, size, is_compared)
/// for each region, and end_bone() after each bone. Returns false if a visit does, or if the record is of other bones.
template <class Visit, class EndBone>
bool walk(const RecordLayout& layout, Address bone, const char* record, const Visit& visit, const EndBone& end_bone) {
  const auto count = read<std::int32_t>(reinterpret_cast<Address>(record));
  for (std::int32_t b = 0; b < count; ++b) {
    if (bone == 0) return false;
    const auto following = read<Address>(bone + layout.next);
    if (following != 0) prefetch(following, layout);
    for (const auto& [offset, size] : layout.members) {
      if (!visit(bone + offset, static_cast<std::size_t>(size), true)) return false;
    }
    for (const auto& [offset, size] : layout.computed) {
      if (!visit(bone + offset, static_cast<std::size_t>(size), false)) return false;
    }
    const auto segments = read<std::int32_t>(reinterpret_cast<Address>(record) + (b + 1) * kNumber);
    if (segment_count_of(bone, layout) != segments) return false;
    for (const auto& [offset, size, more, is_compared] : layout.segments) {
      const auto bytes = static_cast<std::size_t>(size * (segments + more));
      if (segments > 0 && !visit(read<Address>(bone + offset), bytes, is_compared != 0)) return false;
    }
    end_bone();
    bone = following;
  }
  return bone == 0;
}

/// Whether a pose holds a record.
bool holds(const RecordLayout& layout, Address bone, std::span<const std::uint8_t> record) {
  const auto* const bytes = reinterpret_cast<const char*>(record.data());
  std::size_t done = (static_cast<std::size_t>(read<std::int32_t>(reinterpret_cast<Address>(bytes))) + 1) * kNumber;
  const auto is_same = [&](Address region, std::size_t size, bool is_compared) {
    const char* const from = bytes + std::exchange(done, done + size);
    if (done > record.size()) return false;
    return !is_compared || are_equal(reinterpret_cast<const void*>(region), from, size);
  };
  return walk(layout, bone, bytes, is_same, [] {}) && done == record.size();
}

std::vector<bool> are_poses(const RecordLayout& layout, const std::vector<std::pair<Address, Record>>& asked) {
  std::vector<std::span<const std::uint8_t>> records;
  for (const auto& [bone, record] : asked) {
    records.emplace_back(record.data(), static_cast<std::size_t>(record.size()));
  }
  std::vector<std::uint8_t> found(asked.size());
  run_parallel(asked.size(), [&](std::size_t i) { found[i] = holds(layout, asked[i].first, records[i]); });
  return {found.begin(), found.end()};
}

/// Writes what the originals have, too, into the bones of an original, whose segments need not be those of the record.
bool play_original_pose(Address bone, const RecordLayout& layout, const Record& record) {
  std::size_t computed = 0, per_segment = 0, more_segments = 0;
  for (const auto& member : layout.computed) computed += member[1];
  for (const auto& array : layout.segments) {
    per_segment += array[1];
    more_segments += array[1] * array[2];
  }
  const auto* bytes = reinterpret_cast<const char*>(record.data());
  const auto count = static_cast<std::size_t>(read<std::int32_t>(reinterpret_cast<Address>(bytes)));
  std::size_t bones = 0;
  for (Address each = bone; each != 0; each = read<Address>(each + layout.next)) ++bones;
  if (bones != count) return false;
  const char* from = bytes + (count + 1) * kNumber;
  for (std::size_t b = 0; b < count; ++b, bone = read<Address>(bone + layout.next)) {
    for (const auto& [offset, size] : layout.members) {
      std::memcpy(reinterpret_cast<void*>(bone + offset), from, size);
      from += size;
    }
    from += computed;
    std::int32_t segments;
    std::memcpy(&segments, bytes + (b + 1) * kNumber, kNumber);
    if (segments > 0) from += per_segment * segments + more_segments;
  }
  return true;
}

/// Compares a region with one record and writes another one. Returns false, and writes nothing, if it differs.
bool step_region(Address at, std::size_t size, bool is_compared, const char* before, const char* next) {
  auto* const to = reinterpret_cast<void*>(at);
  if (is_compared && !are_equal(to, before, size)) return false;
  std::memcpy(to, next, size);
  return true;
}

/// What `step_pose` does to one pose.
struct Step {
  Address bone, original;
  std::span<const std::uint8_t> before, next;  // records
};

/// Compares bones with one record, and writes the next one into them and
/// into those of the original. Returns false at the first bone that differs; those before it are written.
bool step_pose(const RecordLayout& layout, const Step& wanted) {
  const auto& [bone, first_original, before, next] = wanted;
  Address original = first_original;
  const auto* old_bytes = reinterpret_cast<const char*>(before.data());
  const auto* new_bytes = reinterpret_cast<const char*>(next.data());
  const auto count = read<std::int32_t>(reinterpret_cast<Address>(old_bytes));
  const std::size_t head = (static_cast<std::size_t>(count) + 1) * kNumber;
  if (before.size() != next.size() || std::memcmp(old_bytes, new_bytes, head) != 0) return false;
  const char* old_at = old_bytes + head;
  const char* new_at = new_bytes + head;
  const char* members = new_at;  // of the bone that is being visited
  const auto step = [&](Address at, std::size_t size, bool is_compared) {
    const bool is_same = step_region(at, size, is_compared, old_at, new_at);
    old_at += size;
    new_at += size;
    return is_same;
  };
  const auto write_original = [&] {
    const char* from = std::exchange(members, new_at);
    if (original == 0) return;
    const auto after = read<Address>(original + layout.next);
    if (after != 0) prefetch(after, layout);
    for (const auto& [offset, size] : layout.members) {
      std::memcpy(reinterpret_cast<void*>(original + offset), from, static_cast<std::size_t>(size));
      from += size;
    }
    original = after;
  };
  return walk(layout, bone, new_bytes, step, write_original);
}

using StepOfRecords = std::tuple<Address, Address, Record, Record>;

std::vector<bool> step_poses(const RecordLayout& layout, const std::vector<StepOfRecords>& wanted) {
  std::vector<Step> steps;
  for (const auto& [bone, original, before, next] : wanted) {
    steps.push_back({bone,
                     original,
                     {before.data(), static_cast<std::size_t>(before.size())},
                     {next.data(), static_cast<std::size_t>(next.size())}});
  }
  std::vector<std::uint8_t> has_stepped(steps.size());
  run_parallel(steps.size(), [&](std::size_t i) { has_stepped[i] = step_pose(layout, steps[i]); });
  return {has_stepped.begin(), has_stepped.end()};
}

}  // namespace

void bind_pose_record(py::module_& host) {
  py::class_<RecordLayout>(host, "PoseRecordLayout",
                           "Where in a pose bone the memory is that a record of a pose holds.")
      .def(py::init<std::ptrdiff_t, std::ptrdiff_t, std::vector<std::array<std::ptrdiff_t, 2>>,
                    std::vector<std::array<std::ptrdiff_t, 2>>, std::vector<std::array<std::ptrdiff_t, 4>>>(),
           py::arg("next"), py::arg("segment_count"), py::arg("members"), py::arg("computed"), py::arg("segments"),
           "next, segment_count: byte offsets in a bone of the next one's address and of its number of segments.\n"
           "members: (offset, size) in bytes of what is in the bone itself; computed: of what only evaluated bones "
           "have, and follows from the rest.\n"
           "segments: (offset, size, more, is_compared) of each array with an item for each segment of a B-bone, and "
           "that many more: the offset of its address, the size of an item in bytes, and whether are_poses compares "
           "it.");
  host.def("record_pose", &record_pose, py::arg("bone"), py::arg("layout"),
           "Copies what the layout names of all bones of one of Blender's poses.\n\n"
           "bone: address of its first bone, or 0.\n"
           "Returns (N,) uint8, for play_pose.");
  host.def("play_pose", &play_pose, py::arg("bone"), py::arg("layout"), py::arg("record"),
           "Writes a record into the bones of one of Blender's poses.\n\n"
           "record: (N,) uint8, made by record_pose with the same layout.\n"
           "Returns whether it did: False if the pose has other bones or segments; then nothing is written.");
  host.def("play_original_pose", &play_original_pose, py::arg("bone"), py::arg("layout"), py::arg("record"),
           "Writes those parts of a record that originals have into the bones of an original.\n\n"
           "record: (N,) uint8, made by record_pose with the same layout. Returns False, and writes nothing, if it was "
           "made of another number of bones.");
  host.def(
      "step_poses", &step_poses, py::arg("layout"), py::arg("steps"),
      "Does what are_poses, play_pose and play_original_pose do, to several poses in parallel, while it goes through "
      "the bones of each once.\n\n"
      "steps: of each pose (bone, original, before, next): the addresses of the first bone of an evaluated pose and "
      "of its original, or 0; the record that the pose must hold, and the one to write, both (N,) uint8.\n"
      "Returns for each pose False if it does not hold the first record. Then some of its bones may have been "
      "written.");
  host.def("are_poses", &are_poses, py::arg("layout"), py::arg("asked"),
           "Whether the bones of Blender's poses hold the numbers that are in records, see play_pose. What the layout "
           "excepts is not compared.\n\n"
           "asked: of each pose (bone, record): the address of its first bone, or 0, and (N,) uint8.");
}

}  // namespace sinew::bindings
