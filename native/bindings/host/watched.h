/// Memory of Blender that must be unchanged for what was made from it to hold.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "host/memory.h"

namespace sinew::bindings {

/// One of Blender's structs, of which some regions are watched.
struct WatchedStruct {
  struct Region {
    std::ptrdiff_t offset;  ///< from the struct's address, in bytes
    std::size_t size;       ///< in bytes
  };

  Address address;
  std::ptrdiff_t parent;  ///< index of the struct that shows that this one still exists; -1: the caller knows it does
  std::size_t voucher;    ///< index of the parent's region that shows it: a pointer to this struct, or a mark
  std::vector<Region> regions;
};

/// A tree of structs. A struct is read only after a region of its parent was found unchanged: the pointer that leads to
/// it, or the mark (one byte) of the data-block that owns it, which is lost when Blender frees what the block owns.
class Watched {
 public:
  /// Stores what the regions contain now. Parents come before their children, and only the first struct has none.
  /// Throws InputError, without reading that struct, if its parent does not vouch for it.
  explicit Watched(std::span<const WatchedStruct> structs);

  /// Returns whether all regions are unchanged.
  bool holds() const;

 private:
  struct Region {
    Address address;
    std::size_t first, size;
  };
  std::vector<Region> regions_;  ///< of all structs, in their order
  std::vector<char> seen_;
};

}  // namespace sinew::bindings
