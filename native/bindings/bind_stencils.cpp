#include <pybind11/stl.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>

#include "arrays.h"
#include "sinew/stencils.h"

namespace sinew::bindings {
namespace {

/// Returns what there is of each of so many rows, (R, 3), row by row; nothing for None.
std::vector<float> rows_of(const char* name, const std::optional<py::array>& array, py::ssize_t count) {
  if (!array) return {};
  require_shape(name, *array, shape_text({count, 3}));
  return copied<float>(name, *array);
}

py::array applied(const Stencils& self, const py::array& positions, const py::object& out) {
  const auto from = numbers_span("positions", positions, "(V, 3)");
  const std::vector<py::ssize_t> shape{self.count(), 3};
  const py::array result = out.is_none() ? py::array(py::dtype::of<float>(), shape) : given_array("out", out);
  const auto to = written_span<float>("out", result, shape);
  const py::gil_scoped_release release;
  self.apply(from, to);
  return result;
}

std::optional<py::array> py_colours_apart(std::ptrdiff_t vertex_count, const py::array& edges,
                                          const py::array& face_offsets, const py::array& face_vertices, int steps,
                                          int most) {
  require_shape("edges", edges, "(E, 2)");
  const std::vector<std::int32_t> own_edges = copied<std::int32_t>("edges", edges);
  const std::vector<std::int32_t> offsets = list_of<std::int32_t>("face_offsets", face_offsets);
  const std::vector<std::int32_t> vertices = list_of<std::int32_t>("face_vertices", face_vertices);
  std::optional<std::vector<std::int32_t>> colours;
  {
    const py::gil_scoped_release release;
    colours = colours_apart(vertex_count, own_edges, {offsets, vertices}, steps, most);
  }
  if (!colours) return std::nullopt;
  return given_away(std::move(*colours), {static_cast<py::ssize_t>(vertex_count)});
}

}  // namespace

void bind_stencils(py::module_& module) {
  py::class_<Stencils, std::shared_ptr<Stencils>>(
      module, "Stencils",
      "How each vertex of one mesh is made from those of another, as a weighted sum: what the modifiers Subdivision, "
      "Mirror and Array do. Immutable.")
      .def(py::init([](const py::array& offsets, const py::array& vertices, const py::array& weights,
                       std::ptrdiff_t vertex_count, const std::optional<py::array>& scales,
                       const std::optional<py::array>& shifts) {
             const Numbers<std::int64_t> own_offsets = list_of<std::int64_t>("offsets", offsets);
             const Numbers<std::int32_t> own_vertices = list_of<std::int32_t>("vertices", vertices);
             const Numbers<float> own_weights = list_of<float>("weights", weights);
             const py::ssize_t count = std::max<py::ssize_t>(offsets.size() - 1, 0);
             const std::vector<float> own_scales = rows_of("scales", scales, count);
             const std::vector<float> own_shifts = rows_of("shifts", shifts, count);
             const py::gil_scoped_release release;
             return std::make_shared<Stencils>(own_offsets, own_vertices, own_weights, vertex_count, own_scales,
                                               own_shifts);
           }),
           py::arg("offsets"), py::arg("vertices"), py::arg("weights"), py::arg("vertex_count"),
           py::arg("scales") = py::none(), py::arg("shifts") = py::none(),
           "offsets: (R + 1,) integers; stencil r has the entries offsets[r] up to offsets[r + 1].\n"
           "vertices: (N,) integers, of the mesh before.\n"
           "weights: (N,), finite. Equal rows are stored once.\n"
           "vertex_count: V, of the mesh before.\n"
           "scales: (R, 3), finite, by which the sums are multiplied: -1 along the axis of a mirror; None: 1.\n"
           "shifts: (R, 3), finite, what is added then, in the unit of the positions; None: 0.\n\n"
           "All are copied. Raises ValueError for what does not fit.")
      .def_property_readonly("vertex_count", &Stencils::vertex_count, "V.")
      .def_property_readonly("count", &Stencils::count, "R.")
      .def_property_readonly("entry_count", &Stencils::entry_count, "N.")
      .def_property_readonly("pattern_count", &Stencils::pattern_count,
                             "How many different rows of weights, scales and shifts there are.")
      .def(
          "apply", &applied, py::arg("positions"), py::arg("out") = py::none(),
          "Makes the vertices: p'(r) = s(r) sum_k w(r, k) p(i(r, k)) + t(r), axis by axis, in float32 and in the order "
          "of the entries, so that any number of threads gives the same bits. The GIL is released.\n\n"
          "positions: (V, 3) float32, C-contiguous.\n"
          "out: (R, 3) float32, C-contiguous, not overlapping positions; made if None.\n\n"
          "Returns out. Raises ValueError for another shape or dtype.");

  module.def(
      "colours_apart", &py_colours_apart, py::arg("vertex_count"), py::arg("edges"), py::arg("face_offsets"),
      py::arg("face_vertices"), py::arg("steps"), py::arg("most") = 256,
      "Colours vertices so that those of one colour are more than so many steps apart. A step leads to another "
      "vertex of the same edge or face.\n\n"
      "edges: (E, 2) integers.\n"
      "face_offsets: (faces + 1,) integers, where the corners of each face begin.\n"
      "face_vertices: (C,) integers, face after face.\n\n"
      "Returns (V,) int32, colours from 0 on; None if more than `most` would be needed. Raises ValueError for what "
      "does not fit.");
}

}  // namespace sinew::bindings
