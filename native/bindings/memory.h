/// Blender's own memory, read and written by address. Unaligned is fine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace sinew::bindings {

using Address = std::uintptr_t;

template <class T>
T read(Address at) {
  T value;
  std::memcpy(&value, reinterpret_cast<const void*>(at), sizeof value);
  return value;
}

template <class T>
void write(Address at, T value) {
  std::memcpy(reinterpret_cast<void*>(at), &value, sizeof value);
}

constexpr std::size_t kMatrix = 16 * sizeof(float);

/// Where the members of a pose bone lie, in bytes.
struct PoseBoneLayout {
  std::ptrdiff_t next, motion, segment_count, segments;
};

/// Copies the motions of one pose bone: one matrix, or those of the ends of its segments. False if
/// it has other segments.
inline bool copy_motions(Address bone, const PoseBoneLayout& layout, std::int32_t count, char* to) {
  if (count == 1) {
    std::memcpy(to, reinterpret_cast<const void*>(bone + layout.motion), kMatrix);
    return true;
  }
  const auto bent = read<Address>(bone + layout.segments);
  if (bent == 0 || read<std::int32_t>(bone + layout.segment_count) + 1 != count) return false;
  // The first of these matrices leads into the bone's own space; the motions come after it.
  std::memcpy(to, reinterpret_cast<const void*>(bent + kMatrix), count * kMatrix);
  return true;
}

}  // namespace sinew::bindings
