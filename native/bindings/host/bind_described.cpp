#include <pybind11/stl.h>

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
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

  /// An address of a struct, whose type follows from a number.
  struct Choice {
    std::ptrdiff_t kind = 0;  // offset of that number, an int16
    std::ptrdiff_t address = 0;
    std::map<int, std::shared_ptr<const Described>> kinds;
  };
  std::vector<Choice> choices;
};

/// A struct of a type that is not described.
struct Unknown {};

void append(Address at, const Described& described, bool is_marked, std::string& to);

/// Each begins with the address of the next. is_marked: with marks where structs and lists begin and end.
void append_list(Address first, const Described& described, bool is_marked, std::string& to) {
  for (Address each = first; each != 0; each = read<Address>(each)) {
    if (is_marked) to.push_back('+');
    append(each, described, is_marked, to);
  }
  if (is_marked) to.push_back('.');
}

void append(Address at, const Described& described, bool is_marked, std::string& to) {
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
    if (is_marked) to.push_back(there == 0 ? '-' : '+');
    if (there != 0) append(there, described_by(part), is_marked, to);
  }
  for (const auto& part : described.lists) {
    append_list(read<Address>(at + part.first), described_by(part), is_marked, to);
  }
  for (const Described::Choice& choice : described.choices) {
    const auto kind = choice.kinds.find(read<std::int16_t>(at + choice.kind));
    const auto there = read<Address>(at + choice.address);
    if (kind == choice.kinds.end() || there == 0) throw Unknown();
    append(there, *kind->second, is_marked, to);
  }
}

std::optional<py::bytes> bytes_of_list(const Described& described, Address first, bool is_marked) {
  std::string found;
  try {
    append_list(first, described, is_marked, found);
  } catch (const Unknown&) {
    return std::nullopt;
  }
  return found;
}

using PartOfPython = std::pair<std::ptrdiff_t, OrNone<Described>>;
using ChoiceOfPython = std::tuple<std::ptrdiff_t, std::ptrdiff_t, std::map<int, std::shared_ptr<Described>>>;

}  // namespace

void bind_described(py::module_& host) {
  py::class_<Described, std::shared_ptr<Described>>(host, "Described",
                                                    "Tells what to read of one of Blender's structs. Immutable.")
      .def(
          py::init([](std::vector<std::pair<std::ptrdiff_t, std::size_t>> regions, std::vector<std::ptrdiff_t> texts,
                      const std::vector<PartOfPython>& structs, const std::vector<PartOfPython>& lists,
                      const std::vector<ChoiceOfPython>& choices) {
            auto described = std::make_shared<Described>();
            described->regions = std::move(regions);
            described->texts = std::move(texts);
            for (const auto& [offset, part] : structs) described->structs.emplace_back(offset, part.value_or(nullptr));
            for (const auto& [offset, part] : lists) described->lists.emplace_back(offset, part.value_or(nullptr));
            for (const auto& [kind, address, kinds] : choices) {
              described->choices.push_back({kind, address, {kinds.begin(), kinds.end()}});
            }
            return described;
          }),
          py::arg("regions"), py::arg("texts"), py::arg("structs"), py::arg("lists"),
          py::arg("choices") = std::vector<ChoiceOfPython>(),
          "regions: [(offset, size)]; texts: offsets of addresses of texts; structs, lists: [(offset, Described)] of "
          "addresses of a struct and of the first one of a list, None for a struct like this one; choices: [(offset of "
          "an int16, offset of an address of a struct, {int16: Described})]. In bytes.")
      .def("bytes_of_list", &bytes_of_list, py::arg("first"), py::arg("marks") = true,
           "Returns the bytes of all structs of a list, each of which begins with the address of the next, or None if "
           "one has a choice that is not described.\n\n"
           "first: address of the first one, or 0; marks: with a byte where a struct or a list begins or ends.");
}

}  // namespace sinew::bindings
