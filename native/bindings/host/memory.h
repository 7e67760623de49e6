/// Reads and writes Blender's own memory by address, which need not be aligned.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "sinew/types.h"

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

/// Offsets of the members of a shape key, in bytes. relative: the number of the key that it is relative to.
struct KeyLayout {
  std::ptrdiff_t flags, value, relative;
};

/// Mutes a key of an evaluated copy. Returns its value, or 0 if the user has muted it.
inline float silence_key(Address key, const KeyLayout& layout) {
  auto flags = read<std::uint16_t>(key + layout.flags);
  const bool muted = flags & (flags & kSeen ? kMutedByUser : kMuted);
  flags = static_cast<std::uint16_t>(flags & ~kMutedByUser) | kMuted | kSeen;
  if (muted) flags |= kMutedByUser;
  write(key + layout.flags, flags);
  return muted ? 0.0f : read<float>(key + layout.value);
}

/// Undoes silence_key.
inline void give_key_back(Address key, std::ptrdiff_t flags_at) {
  auto flags = read<std::uint16_t>(key + flags_at);
  if (!(flags & kSeen)) return;
  const std::uint16_t muted = flags & kMutedByUser ? kMuted : 0;
  flags &= static_cast<std::uint16_t>(~(kSeen | kMutedByUser | kMuted));
  write(key + flags_at, static_cast<std::uint16_t>(flags | muted));
}

/// Makes a key of an evaluated copy relative to itself, so that Blender adds nothing: for a key whose mute flag drivers
/// or keyframes may set on each frame. Returns its value, or 0 if it is muted.
inline float detach_key(Address key, const KeyLayout& layout, std::int16_t number) {
  give_key_back(key, layout.flags);  // if it was silenced before it was animated
  write(key + layout.relative, number);
  return read<std::uint16_t>(key + layout.flags) & kMuted ? 0.0f : read<float>(key + layout.value);
}

/// Keeps Blender from adding keys of an evaluated copy to the first one. animated: for each key, whether drivers or
/// keyframes may mute it. Writes their values, 0 for muted keys, except for the first.
inline void silence_keys(std::span<const Address> keys, const KeyLayout& layout, const std::vector<bool>& animated,
                         std::span<float> values) {
  for (std::size_t k = 1; k < keys.size(); ++k) {
    values[k] = animated[k] ? detach_key(keys[k], layout, static_cast<std::int16_t>(k)) : silence_key(keys[k], layout);
  }
}

/// Returns for each of count keys whether it is one of those with these numbers.
inline std::vector<bool> chosen_keys(const std::vector<std::size_t>& numbers, std::size_t count) {
  std::vector<bool> chosen(count, false);
  for (const std::size_t number : numbers) {
    if (number >= count) throw InputError("animated has a number that is not one of a key");
    chosen[number] = true;
  }
  return chosen;
}

}  // namespace sinew::bindings
