/// Reads and writes Blender's own memory by address, which need not be aligned.
#pragma once

#include <cmath>
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

/// Whether the motion of a B-bone's segment, 16 numbers column by column, flattens space along an axis, but for rounding.
/// Which rotation Blender takes from it then depends on how Blender has rounded.
inline bool is_nearly_flat(const float* motion) {
  constexpr float kShare = 1e-5f;
  const float *x = motion, *y = motion + 4, *z = motion + 8;
  const auto length = [](const float* v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); };
  const float volume =
      x[0] * (y[1] * z[2] - y[2] * z[1]) + x[1] * (y[2] * z[0] - y[0] * z[2]) + x[2] * (y[0] * z[1] - y[1] * z[0]);
  return !(std::abs(volume) > kShare * length(x) * length(y) * length(z));
}

constexpr std::uint16_t kMuted = 1;  ///< a bit of a shape key's flags
constexpr std::int16_t kNoKey = -1;  ///< Blender skips keys that are relative to a key that does not exist

/// Offsets of the members of a shape key, in bytes. relative: the number of the key that it is relative to.
struct KeyLayout {
  std::ptrdiff_t flags, value, relative;
};

/// Keeps Blender from adding keys of an evaluated copy to the first one. Writes their values, 0 for muted keys, except
/// for the first.
inline void silence_keys(std::span<const Address> keys, const KeyLayout& layout, std::span<float> values) {
  for (std::size_t k = 1; k < keys.size(); ++k) {
    write(keys[k] + layout.relative, kNoKey);
    const bool is_muted = read<std::uint16_t>(keys[k] + layout.flags) & kMuted;
    values[k] = is_muted ? 0.0f : read<float>(keys[k] + layout.value);
  }
}

/// Undoes silence_keys. numbers: for each key, that of the key that it is relative to.
inline void restore_keys(std::span<const Address> keys, const KeyLayout& layout,
                         std::span<const std::int16_t> numbers) {
  for (std::size_t k = 1; k < keys.size(); ++k) write(keys[k] + layout.relative, numbers[k]);
}

}  // namespace sinew::bindings
