#include <pybind11/stl.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "arrays.h"
#include "host/memory.h"

// The bytes of some of Blender's structs, to find out later whether an edit has changed them.

namespace sinew::bindings {
namespace {

/// What to read of a struct, by offsets in bytes.
struct Described {
  using Part = std::pair<std::ptrdiff_t, std::shared_ptr<const Described>>;  // without a description: as this struct

  std::vector<std::pair<std::ptrdiff_t, std::size_t>> regions;  // (offset, size)
  std::vector<std::ptrdiff_t> texts;                            // of the address of a text
  std::vector<Part> structs;                                    // of the address of a struct
  std::vector<Part> lists;                                      // of the address of the first struct of a list
};

void append(Address at, const Described& described, std::string& to);

/// Each begins with the address of the next.
void append_list(Address first, const Described& described, std::string& to) {
  for (Address each = first; each != 0; each = read<Address>(each)) {
    to.push_back('+');
    append(each, described, to);
  }
  to.push_back('.');
}

void append(Address at, const Described& described, std::string& to) {
  const auto described_by = [&](const Described::Part& part) -> const Described& {
    return part.second == nullptr ? described : *part.second;
  };
  for (const auto& [offset, size] : described.regions) to.append(reinterpret_cast<const char*>(at + offset), size);
  for (const auto offset : described.texts) {
    if (const auto text = read<Address>(at + offset); text != 0) to.append(reinterpret_cast<const char*>(text));
    to.push_back('\0');
  }
  for (const auto& part : described.structs) {
    const auto there = read<Address>(at + part.first);
    to.push_back(there == 0 ? '-' : '+');
    if (there != 0) append(there, described_by(part), to);
  }
  for (const auto& part : described.lists) append_list(read<Address>(at + part.first), described_by(part), to);
}

py::bytes bytes_of_list(const Described& described, Address first) {
  std::string found;
  append_list(first, described, found);
  return found;
}

}  // namespace

void bind_described(py::module_& host) {
  py::class_<Described, std::shared_ptr<Described>>(host, "Described",
                                                    "Tells what to read of one of Blender's structs. Immutable.")
      .def(py::init([](std::vector<std::pair<std::ptrdiff_t, std::size_t>> regions, std::vector<std::ptrdiff_t> texts,
                       const std::vector<std::pair<std::ptrdiff_t, std::shared_ptr<Described>>>& structs,
                       const std::vector<std::pair<std::ptrdiff_t, std::shared_ptr<Described>>>& lists) {
             return std::make_shared<Described>(Described{
                 std::move(regions), std::move(texts), {structs.begin(), structs.end()}, {lists.begin(), lists.end()}});
           }),
           py::arg("regions"), py::arg("texts"), py::arg("structs"), py::arg("lists"),
           "regions: [(offset, size)]; texts: offsets of addresses of texts; structs, lists: [(offset, Described)] of "
           "addresses of a struct and of the first one of a list, None for a struct like this one. In bytes.")
      .def("bytes_of_list", &bytes_of_list, py::arg("first"),
           "Returns the bytes of all structs of a list, each of which begins with the address of the next.\n\n"
           "first: address of the first one, or 0.");
}

}  // namespace sinew::bindings
