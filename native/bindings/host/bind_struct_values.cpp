#include <pybind11/stl.h>

#include <cstdint>
#include <memory>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "arrays.h"
#include "host/memory.h"

// Some members of Blender's structs as Python's values: many of them in one step.

namespace sinew::bindings {
namespace {

struct StructValues;

struct StructMember {
  std::vector<std::ptrdiff_t> path;                        // offsets of the addresses that lead to it, and its own
  std::variant<std::shared_ptr<StructValues>, char> kind;  // of the structs of a list, or of a number
};

/// What to read of a struct.
struct StructValues {
  std::vector<StructMember> members;

  py::tuple of(Address at) const {
    py::tuple found(members.size());
    for (std::size_t i = 0; i < members.size(); ++i) {
      PyTuple_SET_ITEM(found.ptr(), static_cast<py::ssize_t>(i), value(at, members[i]).release().ptr());
    }
    return found;
  }

  /// Each begins with the address of the next.
  py::list of_list(Address first) const {
    py::list found;
    for (Address each = first; each != 0; each = read<Address>(each)) found.append(of(each));
    return found;
  }

  py::list of_all(const std::vector<Address>& addresses) const {
    py::list found;
    for (const Address each : addresses) found.append(of(each));
    return found;
  }

 private:
  static py::object value(Address at, const StructMember& member) {
    for (std::size_t i = 0; i + 1 < member.path.size(); ++i) {
      at = read<Address>(at + member.path[i]);
      if (at == 0) return py::none();
    }
    at += member.path.back();
    if (const auto* list = std::get_if<0>(&member.kind)) return (*list)->of_list(read<Address>(at));
    switch (std::get<1>(member.kind)) {
      case 'b':
        return py::int_(read<std::int8_t>(at));
      case 'h':
        return py::int_(read<std::int16_t>(at));
      case 'P':
        return py::int_(read<Address>(at));
      default:
        return text_of(reinterpret_cast<const char*>(at));
    }
  }
};

using MemberOfPython = std::pair<std::vector<std::ptrdiff_t>, std::variant<std::shared_ptr<StructValues>, char>>;

}  // namespace

void bind_struct_values(py::module_& host) {
  py::class_<StructValues, std::shared_ptr<StructValues>>(host, "StructValues",
                                                          "Tells which members of a struct to read. Immutable.")
      .def(py::init([](const std::vector<MemberOfPython>& members) {
             auto values = std::make_shared<StructValues>();
             for (const auto& [path, kind] : members) {
               if (path.empty()) throw InputError("members has one without an offset");
               values->members.push_back({path, kind});
             }
             return values;
           }),
           py::arg("members"),
           "members: [(offsets, kind)]: byte offsets of the addresses that lead to a member, then its own; what it is, "
           "as in Python's struct: b, h, or P, s for a text that ends with 0, or StructValues for the address of the "
           "first struct of a list.")
      .def("of", &StructValues::of_all, py::arg("addresses"),
           "Returns a tuple for each struct. A value is None if an address that leads to it is 0.");
}

}  // namespace sinew::bindings
