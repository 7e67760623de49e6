/// Checks where the entries of each row of a list of lists begin.
#pragma once

#include <cstddef>
#include <span>

#include "base/check.h"

namespace sinew {

/// Requires offsets that begin with 0, never decrease, and end with the number of entries. So all are in that range.
/// entries: what those are, such as "corners". Throws InputError.
template <class Offset>
void check_offsets(const char* name, std::span<const Offset> offsets, std::ptrdiff_t count, const char* entries) {
  if (offsets.empty()) fail(name, " is empty; expected one number more than there are rows");
  if (offsets.front() != 0 || offsets.back() != count) {
    fail(name, " goes from ", offsets.front(), " to ", offsets.back(), "; expected 0 to ", count, ", the number of ",
         entries);
  }
  for (std::size_t i = 1; i < offsets.size(); ++i) {
    if (offsets[i] < offsets[i - 1]) fail(name, "[", i, "] is ", offsets[i], ", below the one before");
  }
}

/// The same for so many rows, such as "vertices".
template <class Offset>
void check_offsets(const char* name, std::span<const Offset> offsets, std::ptrdiff_t count, const char* entries,
                   std::ptrdiff_t row_count, const char* rows) {
  if (std::ssize(offsets) != row_count + 1) {
    fail(name, " has ", plural(std::ssize(offsets), "entry"), "; expected ", grouped(row_count + 1),
         ", one more than there are ", rows);
  }
  check_offsets(name, offsets, count, entries);
}

}  // namespace sinew
