#include <pybind11/stl.h>

#include <cstdint>
#include <string_view>
#include <tuple>
#include <vector>

#include "arrays.h"
#include "host/memory.h"
#include "sinew/object_place.h"

// Where objects are, written as Blender's evaluation writes it.

namespace sinew::bindings {
namespace {

/// Offsets in bytes: in an object, of the address of what holds the matrices and of its flags; in that, of the matrix to
/// the world, which is followed by its inverse; and the flag of a matrix that mirrors.
struct PlaceLayout {
  std::ptrdiff_t pointer, matrix, flags;
  std::int16_t mirrored;
};

// Parent's row or -1, matrices, objects, and one whose bones Blender has posed, or 0.
using Row = std::tuple<int, py::bytes, std::vector<Address>, Address>;

Matrix4<float> matrix_in(std::string_view bytes, std::size_t number) {
  Matrix4<float> matrix;
  std::memcpy(matrix.data(), bytes.data() + number * kMatrix, kMatrix);
  return matrix;
}

void write_place(Address object, const ObjectPlace& place, const PlaceLayout& layout, bool is_posed = false) {
  const Address at = read<Address>(object + layout.pointer) + layout.matrix;
  std::memcpy(reinterpret_cast<void*>(at), place.world.data(), kMatrix);
  if (is_posed && !place.has_inverse) {
    std::memset(reinterpret_cast<void*>(at + kMatrix), 0, kMatrix);  // as Blender finds it anew for bones
  } else {
    std::memcpy(reinterpret_cast<void*>(at + kMatrix), place.inverse.data(), kMatrix);
  }
  const auto flags = read<std::int16_t>(object + layout.flags);
  const int set = place.is_mirrored ? flags | layout.mirrored : flags & ~layout.mirrored;
  write(object + layout.flags, static_cast<std::int16_t>(set));
}

py::list write_places(const PlaceLayout& layout, const std::vector<Row>& rows) {
  std::vector<ObjectPlace> places;
  py::list found;
  for (const auto& [parent, bytes, objects, posed] : rows) {
    const std::string_view own = bytes;
    if (parent >= static_cast<int>(places.size()) || own.size() != (parent < 0 ? 1 : 2) * kMatrix) {
      throw InputError("a row has a parent behind it, or no matrices");
    }
    places.push_back(parent < 0 ? place_of(matrix_in(own, 0))
                                : place_of_child(places[parent].world, matrix_in(own, 0), matrix_in(own, 1)));
    for (const Address object : objects) write_place(object, places.back(), layout);
    if (posed != 0) write_place(posed, places.back(), layout, true);
    found.append(py::bytes(reinterpret_cast<const char*>(places.back().world.data()), kMatrix) +
                 py::bytes(reinterpret_cast<const char*>(places.back().inverse.data()), kMatrix));
  }
  return found;
}

}  // namespace

void bind_places(py::module_& host) {
  py::class_<PlaceLayout>(host, "PlaceLayout", "Where in an object its place is.")
      .def(py::init<std::ptrdiff_t, std::ptrdiff_t, std::ptrdiff_t, std::int16_t>(), py::arg("pointer"),
           py::arg("matrix"), py::arg("flags"), py::arg("mirrored"),
           "pointer, flags: byte offsets in an object of the address of what holds its matrices, and of its flags; "
           "matrix: in that, of the matrix to the world, which its inverse follows; mirrored: the flag of one that "
           "mirrors.");
  host.def("write_places", &write_places, py::arg("layout"), py::arg("rows"),
           "Computes where objects are, and writes it into them.\n\n"
           "rows: of each (parent, matrices, objects, posed): the number of its parent's row, which is in front of it, "
           "and the bytes of matrix_parent_inverse and matrix_basis, or -1 and those of its world matrix, column by "
           "column; the addresses of the objects that get the place; and that of an evaluated armature that does, or "
           "0: without an inverse Blender leaves it zeros.\n"
           "Returns of each row the bytes of the world matrix and its inverse.");
}

}  // namespace sinew::bindings
