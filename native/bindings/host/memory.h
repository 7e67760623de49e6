/// Reads and writes Blender's own memory by address, which need not be aligned.
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

/// Offsets of the members of a pose bone, in bytes.
struct PoseBoneLayout {
  std::ptrdiff_t next, motion, segment_count, segments;
};

/// Copies the motions of a pose bone: one matrix, or one for each end of its segments. Returns false if the number of
/// segments does not match count.
inline bool copy_motions(Address bone, const PoseBoneLayout& layout, std::int32_t count, char* to) {
  if (count == 1) {
    std::memcpy(to, reinterpret_cast<const void*>(bone + layout.motion), kMatrix);
    return true;
  }
  const auto bent = read<Address>(bone + layout.segments);
  if (bent == 0 || read<std::int32_t>(bone + layout.segment_count) + 1 != count) return false;
  // The first of these matrices transforms to the bone's own space; the motions follow it.
  std::memcpy(to, reinterpret_cast<const void*>(bent + kMatrix), count * kMatrix);
  return true;
}

// Bits of a shape key's flags. The first is Blender's. Blender does not use the others, and they are lost when it
// copies the key again.
constexpr std::uint16_t kMuted = 1, kSeen = 1 << 14, kMutedByUser = 1 << 15;

/// Mutes a key of an evaluated copy. Returns its value, or 0 if the user has muted it.
inline float silence_key(Address key, std::ptrdiff_t flags_at, std::ptrdiff_t value_at) {
  auto flags = read<std::uint16_t>(key + flags_at);
  const bool muted = flags & (flags & kSeen ? kMutedByUser : kMuted);
  flags = static_cast<std::uint16_t>(flags & ~kMutedByUser) | kMuted | kSeen;
  if (muted) flags |= kMutedByUser;
  write(key + flags_at, flags);
  return muted ? 0.0f : read<float>(key + value_at);
}

}  // namespace sinew::bindings
