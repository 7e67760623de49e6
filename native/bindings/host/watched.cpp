#include "host/watched.h"

#include <cstring>
#include <string>

#include "sinew/types.h"

namespace sinew::bindings {
namespace {

constexpr std::size_t kMark = 1;

[[noreturn]] void refuse(std::size_t number, const std::string& why) {
  throw InputError("watched struct " + std::to_string(number) + " " + why);
}

/// Throws InputError if nothing shows that a struct exists as long as the structs before it are unchanged.
void check_voucher(std::span<const WatchedStruct> structs, std::size_t number) {
  const WatchedStruct& each = structs[number];
  if (number == 0 && each.parent == -1) return;
  if (each.parent < 0 || each.parent >= static_cast<std::ptrdiff_t>(number)) {
    refuse(number, "has the parent " + std::to_string(each.parent) + ", which is not one of those before it");
  }
  const WatchedStruct& parent = structs[each.parent];
  if (each.voucher >= parent.regions.size()) {
    refuse(number, "names region " + std::to_string(each.voucher) + " of its parent, which has " +
                       std::to_string(parent.regions.size()));
  }
  const WatchedStruct::Region& voucher = parent.regions[each.voucher];
  if (voucher.size == kMark) return;
  if (voucher.size != sizeof(Address) || read<Address>(parent.address + voucher.offset) != each.address) {
    refuse(number, "is not where region " + std::to_string(each.voucher) + " of its parent points");
  }
}

}  // namespace

Watched::Watched(std::span<const WatchedStruct> structs) {
  for (std::size_t s = 0; s < structs.size(); ++s) {
    check_voucher(structs, s);
    for (const auto& [offset, size] : structs[s].regions) {
      const Address address = structs[s].address + offset;
      regions_.push_back({address, seen_.size(), size});
      const auto* const bytes = reinterpret_cast<const char*>(address);
      seen_.insert(seen_.end(), bytes, bytes + size);
    }
  }
}

bool Watched::holds() const {
  // A struct comes after its parent, so when it is read its voucher has been found unchanged.
  for (const Region& region : regions_) {
    if (std::memcmp(reinterpret_cast<const void*>(region.address), seen_.data() + region.first, region.size) != 0) {
      return false;
    }
  }
  return true;
}

}  // namespace sinew::bindings
