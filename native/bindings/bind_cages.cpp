#include <pybind11/stl.h>

#include <array>
#include <memory>
#include <optional>
#include <string>

#include "arrays.h"
#include "methods.h"
#include "stages.h"

// What moves a mesh with the shapes of other objects.

namespace sinew::bindings {
namespace {

std::shared_ptr<Lattice> make_lattice(std::ptrdiff_t vertex_count, const std::optional<py::array>& weights,
                                      bool invert) {
  const OptionalNumbers group("weights", weights);
  const py::gil_scoped_release release;
  return std::make_shared<Lattice>(vertex_count, VertexGroup{group, invert});
}

StageOfPython lattice_stage(const std::shared_ptr<const Lattice>& self, const py::array& points,
                            const std::array<std::int32_t, 3>& counts, const std::array<float, 3>& first,
                            const std::array<float, 3>& step, const std::array<std::string, 3>& interpolation,
                            const py::array& matrix, float strength, const std::optional<py::array>& point_weights) {
  LatticePoints::Grid grid{counts, first, step};
  for (int axis = 0; axis < 3; ++axis) grid.interpolation[axis] = spline_named(interpolation[axis]);
  const Numbers<float> own = points_of<float>("points", points);
  std::optional<Numbers<float>> weights;
  if (point_weights) weights.emplace(list_of<float>("point_weights", *point_weights));
  const std::span<const float> kept = weights ? std::span<const float>(*weights) : std::span<const float>();
  auto prepared = std::make_shared<const LatticePoints>(grid, own, matrix_of<4, 4>("matrix", matrix), kept);
  return StageOfPython(self, {std::move(prepared), strength});
}

std::shared_ptr<SurfaceDeform> make_surface_deform(std::ptrdiff_t vertex_count, const py::array& vertices,
                                                   const py::array& offsets, const py::array& attachments,
                                                   const py::array& corner_offsets, const py::array& corners,
                                                   const py::array& corner_weights, const py::array& distances,
                                                   const py::array& influences, const std::optional<py::array>& weights,
                                                   bool invert) {
  const OptionalNumbers group("weights", weights);
  const auto bound = list_of<std::int32_t>("vertices", vertices);
  const auto first = list_of<std::int32_t>("offsets", offsets);
  const auto kinds = list_of<std::int32_t>("attachments", attachments);
  const auto first_corners = list_of<std::int32_t>("corner_offsets", corner_offsets);
  const auto of_target = list_of<std::int32_t>("corners", corners);
  const auto own_weights = list_of<float>("corner_weights", corner_weights);
  const auto away = list_of<float>("distances", distances);
  const auto parts = list_of<float>("influences", influences);
  const SurfaceDeform::Binding binding{bound, first, kinds, first_corners, of_target, own_weights, away, parts};
  const py::gil_scoped_release release;
  return std::make_shared<SurfaceDeform>(vertex_count, binding, VertexGroup{group, invert});
}

StageOfPython surface_deform_stage(const std::shared_ptr<const SurfaceDeform>& self, const py::array& target,
                                   const py::array& matrix, float strength) {
  const Numbers<float> points = points_of<float>("target", target);
  const Matrix4<float> mesh_from_target = matrix_of<4, 4>("matrix", matrix);
  std::shared_ptr<const SurfaceDeform::Shape> shape;
  {
    const py::gil_scoped_release release;
    shape = self->shape_of(points, mesh_from_target);
  }
  return StageOfPython(self, {std::move(shape), strength});
}

std::shared_ptr<MeshDeform> make_mesh_deform(const py::array& offsets, const py::array& cage_vertices,
                                             const py::array& cage_weights, const py::array& cage_positions,
                                             const std::optional<py::array>& weights, bool invert) {
  const OptionalNumbers group("weights", weights);
  const auto first = list_of<std::int32_t>("offsets", offsets);
  const auto of_cage = list_of<std::int32_t>("cage_vertices", cage_vertices);
  const auto own_weights = list_of<float>("cage_weights", cage_weights);
  const auto positions = points_of<float>("cage_positions", cage_positions);
  const MeshDeform::Binding binding{first, of_cage, own_weights, positions};
  const py::gil_scoped_release release;
  return std::make_shared<MeshDeform>(binding, VertexGroup{group, invert});
}

StageOfPython mesh_deform_stage(const std::shared_ptr<const MeshDeform>& self, const py::array& cage,
                                const py::array& matrix, const py::array& back) {
  const Numbers<float> points = points_of<float>("cage", cage);
  return StageOfPython(self,
                       {self->differences(points, matrix_of<4, 4>("matrix", matrix)), matrix_of<3, 3>("back", back)});
}

}  // namespace

void bind_cages(py::module_& module) {
  py::class_<Lattice, std::shared_ptr<Lattice>>(
      module, "Lattice",
      "Blender's Lattice modifier: moves vertices with the points of a lattice around them. Immutable; several "
      "threads may use one at once.")
      .def(py::init(&make_lattice), py::arg("vertex_count"), py::arg("weights") = py::none(), py::arg("invert") = false,
           "vertex_count: V.\n"
           "weights: (V,), how much of it each vertex gets; None: all of it. Vertices of weight 0 or less stay, and "
           "cost nothing.\n"
           "invert: use 1 - weight instead of each weight. Without weights it has no effect.\n"
           "All are copied. Raises ValueError for sizes that do not fit and for numbers that are not finite.")
      .def_property_readonly("vertex_count", &Lattice::vertex_count, "V.")
      .def("stage", &lattice_stage, py::arg("points"), py::arg("counts"), py::arg("first"), py::arg("step"),
           py::arg("interpolation"), py::arg("matrix"), py::arg("strength") = 1.0f,
           py::arg("point_weights") = py::none(),
           "points: (P, 3), the points in this frame, in the space of the lattice; u changes fastest.\n"
           "counts: how many there are along u, v and w; their product is P.\n"
           "first, step: where the points at rest begin along each axis, and the distance between them.\n"
           "interpolation: along each axis \"linear\", \"cardinal\", \"catmull_rom\" or \"bspline\".\n"
           "matrix: (4, 4), from the space of the mesh to that of the lattice.\n"
           "strength: any finite number.\n"
           "point_weights: (P,), how much of the effect is kept around each point; None: all of it.\n"
           "All are copied. Raises ValueError for an unknown interpolation, for sizes that do not fit, for numbers "
           "that are not finite and for a matrix without inverse.");

  py::class_<SurfaceDeform, std::shared_ptr<SurfaceDeform>>(
      module, "SurfaceDeform",
      "Blender's Surface Deform modifier: vertices are attached to faces of a target. Immutable; several threads may "
      "use one at once.")
      .def(py::init(&make_surface_deform), py::arg("vertex_count"), py::arg("vertices"), py::arg("offsets"),
           py::arg("attachments"), py::arg("corner_offsets"), py::arg("corners"), py::arg("corner_weights"),
           py::arg("distances"), py::arg("influences"), py::arg("weights") = py::none(), py::arg("invert") = false,
           "vertex_count: V.\n"
           "vertices: (B,), the bound ones.\n"
           "offsets: (B + 1,), where the attachments of each begin.\n"
           "attachments: (N,), how each is attached to a face: 0 to the first three corners, 1 to all corners, 2 to "
           "the first two and the mean of all.\n"
           "corner_offsets: (N + 1,), where the corners of each attachment's face begin.\n"
           "corners: (C,), vertices of the target, around each face.\n"
           "corner_weights: (W,), of the attachments in turn: one for each corner if it is attached to all, otherwise "
           "three.\n"
           "distances: (N,), along the normal of the face.\n"
           "influences: (N,), the share of each attachment.\n"
           "weights: (V,), how much of it each vertex gets; None: all of it. Vertices of weight 0 stay, and cost "
           "nothing.\n"
           "invert: use 1 - weight instead of each weight. Without weights it has no effect.\n"
           "All are copied. Raises ValueError for sizes that do not fit, for what is out of range and for numbers "
           "that are not finite.")
      .def_property_readonly("vertex_count", &SurfaceDeform::vertex_count, "V.")
      .def_property_readonly("least_target_count", &SurfaceDeform::least_target_count,
                             "How many vertices a target must have at least.")
      .def("stage", &surface_deform_stage, py::arg("target"), py::arg("matrix"), py::arg("strength") = 1.0f,
           "target: (T, 3), its positions in this frame, in its own space.\n"
           "matrix: (4, 4), from that space to the mesh's, as when the mesh was bound.\n"
           "strength: any finite number.\n"
           "All are copied. Raises ValueError for shapes that do not fit and for a strength that is not finite.");

  py::class_<MeshDeform, std::shared_ptr<MeshDeform>>(
      module, "MeshDeform",
      "Blender's Mesh Deform modifier, bound without Dynamic: vertices follow the weighted mean of how far the "
      "vertices "
      "of a cage have moved. Immutable; several threads may use one at once.")
      .def(py::init(&make_mesh_deform), py::arg("offsets"), py::arg("cage_vertices"), py::arg("cage_weights"),
           py::arg("cage_positions"), py::arg("weights") = py::none(), py::arg("invert") = false,
           "offsets: (V + 1,), where the influences of each vertex begin.\n"
           "cage_vertices, cage_weights: (N,), of each influence.\n"
           "cage_positions: (C, 3), when the mesh was bound.\n"
           "weights: (V,), how much of it each vertex gets; None: all of it. Vertices of weight 0 or less stay, and "
           "cost nothing, as do those without influences.\n"
           "invert: use 1 - weight instead of each weight. Without weights it has no effect.\n"
           "All are copied. Raises ValueError for sizes that do not fit, for what is out of range and for numbers "
           "that are not finite.")
      .def_property_readonly("vertex_count", &MeshDeform::vertex_count, "V.")
      .def_property_readonly("cage_vertex_count", &MeshDeform::cage_vertex_count, "C.")
      .def("stage", &mesh_deform_stage, py::arg("cage"), py::arg("matrix"), py::arg("back"),
           "cage: (C, 3), its positions in this frame, in its own space.\n"
           "matrix: (4, 4), from that space to the one of cage_positions.\n"
           "back: (3, 3), from there to the space of the mesh.\n"
           "All are copied. Raises ValueError for shapes that do not fit and for a matrix that is not finite.");
}

}  // namespace sinew::bindings
