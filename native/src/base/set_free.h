/// Gives memory back before a function ends.
#pragma once

#include <vector>

namespace sinew {

/// Empties a list and frees its memory, which `list = {}` keeps.
template <class T>
void set_free(std::vector<T>& list) {
  std::vector<T>().swap(list);
}

}  // namespace sinew
