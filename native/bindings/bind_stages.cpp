#include <pybind11/stl.h>

#include <memory>
#include <optional>

#include "arrays.h"
#include "methods.h"
#include "stages.h"

namespace sinew::bindings {
namespace {

std::shared_ptr<Topology> make_topology(std::ptrdiff_t vertex_count, const py::array& edges,
                                        const std::optional<py::array>& face_offsets,
                                        const std::optional<py::array>& corner_vertices) {
  require_shape("edges", edges, "(E, 2)");
  const std::vector<std::int32_t> ends = Numbers<std::int32_t>("edges", edges);
  std::vector<std::int32_t> offsets, corners;
  if (face_offsets) offsets = list_of<std::int32_t>("face_offsets", *face_offsets);
  if (corner_vertices) corners = list_of<std::int32_t>("corner_vertices", *corner_vertices);
  const py::gil_scoped_release release;
  return std::make_shared<Topology>(vertex_count, ends, offsets, corners);
}

std::shared_ptr<Smooth> make_smooth(std::shared_ptr<Topology> topology, const std::optional<py::array>& weights,
                                    bool invert) {
  const OptionalNumbers group("weights", weights);
  const py::gil_scoped_release release;
  return std::make_shared<Smooth>(std::move(topology), VertexGroup{group, invert});
}

std::shared_ptr<CorrectiveSmooth> make_corrective(std::shared_ptr<Topology> topology,
                                                  const std::optional<py::array>& rest_positions,
                                                  const std::optional<py::array>& weights, bool invert,
                                                  bool pin_boundary, const std::string& corner_angle) {
  const OptionalNumbers group("weights", weights);
  const CornerAngle angle = corner_angle_named(corner_angle);
  std::optional<Numbers<float>> rest;
  if (rest_positions) {
    require_shape("rest_positions", *rest_positions, shape_text({topology->vertex_count(), 3}));
    rest.emplace("rest_positions", *rest_positions);
  }
  const std::span<const float> positions = rest ? *rest : std::span<const float>();
  const py::gil_scoped_release release;
  return std::make_shared<CorrectiveSmooth>(std::move(topology), positions, VertexGroup{group, invert}, pin_boundary,
                                            angle);
}

std::shared_ptr<Hook> make_hook(std::ptrdiff_t vertex_count, const std::optional<py::array>& vertices,
                                const std::optional<py::array>& weights, bool invert) {
  const OptionalNumbers group("weights", weights);
  std::optional<std::vector<std::int32_t>> named;
  if (vertices) named = list_of<std::int32_t>("vertices", *vertices);
  const py::gil_scoped_release release;
  return std::make_shared<Hook>(vertex_count, named, VertexGroup{group, invert});
}

Hook::Settings hook_settings(const py::array& matrix, float strength, const std::string& falloff, float radius,
                             const std::array<float, 3>& center, const std::optional<py::array>& uniform) {
  Hook::Settings settings{matrix_of<4, 4>("matrix", matrix), strength, falloff_named(falloff), radius,
                          Eigen::Vector3f(center.data())};
  if (uniform) settings.uniform = matrix_of<3, 3>("uniform", *uniform);
  return settings;
}

void apply(const StageOfPython& self, const py::object& positions) {
  std::visit(
      [&](const auto& one) {
        const std::span<float> own =
            written_span<float>("positions", given_array("positions", positions), {one.stage->vertex_count(), 3});
        const py::gil_scoped_release release;
        one.stage->apply(one.settings, own);
      },
      self.stage);
}

constexpr const char* kGroup =
    "weights: (V,), how much of it each vertex gets; None: all of it.\n"
    "invert: use 1 - weight instead of each weight. Without weights it has no effect.\n";

}  // namespace

void bind_stages(py::module_& module) {
  py::class_<Topology, std::shared_ptr<Topology>>(
      module, "Topology", "Which vertices are joined by edges, and the faces around each. Immutable.")
      .def(py::init(&make_topology), py::arg("vertex_count"), py::arg("edges"), py::arg("face_offsets") = py::none(),
           py::arg("corner_vertices") = py::none(),
           "vertex_count: V.\n"
           "edges: (E, 2) integers. Sums over neighbors are taken in this order, as in Blender. Edges without a face "
           "are allowed.\n"
           "face_offsets: (faces + 1,) integers, where the corners of each face begin. None: there "
           "are no faces.\n"
           "corner_vertices: (C,) integers, the vertices around each face, face after face.\n"
           "All are copied. Raises ValueError for a vertex out of range, for offsets that do not "
           "fit, for a face with fewer than three corners and for one with a side that is not an edge.")
      .def_property_readonly("vertex_count", &Topology::vertex_count, "V.")
      .def_property_readonly("edge_count", &Topology::edge_count, "E.")
      .def_property_readonly("corner_count", &Topology::corner_count, "C.");

  py::class_<StageOfPython>(module, "Stage",
                            "What a CorrectiveSmooth, a Smooth or another stage does in one frame: made by "
                            "their stage(...), for apply or for Deformer.deform. Immutable.")
      .def("apply", &apply, py::arg("positions"),
           "Works in place. Several threads may call it at once.\n\n"
           "positions: (V, 3) float32, C-contiguous.\n"
           "Raises ValueError, and writes nothing, if the shape or dtype does not fit.");

  py::class_<CorrectiveSmooth, std::shared_ptr<CorrectiveSmooth>>(
      module, "CorrectiveSmooth",
      "Blender's Corrective Smooth modifier: smooths the shape, then adds what smoothing removes from the rest shape, "
      "turned with the faces. It equals Blender's result to the bit, except with arc cosines. "
      "Immutable except for set_rest_positions; several threads may use one at once.")
      .def(py::init(&make_corrective), py::arg("topology"), py::arg("rest_positions") = py::none(),
           py::arg("weights") = py::none(), py::arg("invert") = false, py::arg("pin_boundary") = false,
           py::arg("corner_angle") = "polynomial",
           (std::string("topology: a Topology of V vertices.\n"
                        "rest_positions: (V, 3), the shape that keeps its detail: Blender's "
                        "original or bound coordinates. None: for only_smooth.\n") +
            kGroup +
            "pin_boundary: vertices on edges with only one face get weight 0.\n"
            "corner_angle: \"polynomial\" as in Blender 4.1 and later, \"arc_cosine\" as before.\n"
            "All but topology is copied. Vertices of weight 0 stay, and cost nothing. Raises "
            "ValueError for sizes that do not fit and for numbers that are not finite.")
               .c_str())
      .def_property_readonly("vertex_count", &CorrectiveSmooth::vertex_count, "V.")
      .def(
          "set_rest_positions",
          [](CorrectiveSmooth& self, const py::array& positions) {
            const Numbers<float> own = points_of<float>("positions", positions);
            const py::gil_scoped_release release;
            self.set_rest_positions(own);
          },
          py::arg("positions"),
          "Sets another rest shape. Do not call it while another thread uses the object.\n\n"
          "positions: (V, 3), copied.\n"
          "Raises "
          "ValueError for another number of positions and for one that is not finite.")
      .def(
          "stage",
          [](const std::shared_ptr<CorrectiveSmooth>& self, float factor, int iterations, float scale,
             const std::string& smooth_type, bool only_smooth) {
            return StageOfPython(std::shared_ptr<const CorrectiveSmooth>(self),
                                 {factor, iterations, scale, smooth_type_named(smooth_type), only_smooth});
          },
          py::arg("factor") = 0.5f, py::arg("iterations") = 5, py::arg("scale") = 1.0f,
          py::arg("smooth_type") = "simple", py::arg("only_smooth") = false,
          "factor: any finite number, even outside of 0 to 1.\n"
          "iterations: if 0 or less, nothing happens.\n"
          "scale: multiplies what is added.\n"
          "smooth_type: \"simple\" or \"length_weighted\".\n"
          "only_smooth: nothing is added.\n"
          "What smoothing removes from the rest shape is kept from frame to frame while factor, iterations and "
          "smooth_type stay the same. Raises ValueError for an unknown name, for numbers that are not "
          "finite, and without rest positions unless only_smooth.");

  py::class_<Smooth, std::shared_ptr<Smooth>>(
      module, "Smooth",
      "Blender's Smooth modifier, to the bit: moves vertices towards the mean of the midpoints of "
      "their edges. A vertex without edges has the mean 0. Immutable; several threads may use one "
      "at once.")
      .def(py::init(&make_smooth), py::arg("topology"), py::arg("weights") = py::none(), py::arg("invert") = false,
           (std::string("topology: a Topology of V vertices.\n") + kGroup +
            "All but topology is copied. Vertices of weight 0 or less stay, and cost nothing. "
            "Raises "
            "ValueError for sizes that do not fit and for numbers that are not finite.")
               .c_str())
      .def_property_readonly("vertex_count", &Smooth::vertex_count, "V.")
      .def(
          "stage",
          [](const std::shared_ptr<Smooth>& self, float factor, int iterations, bool use_x, bool use_y, bool use_z) {
            return StageOfPython(std::shared_ptr<const Smooth>(self), {factor, iterations, use_x, use_y, use_z});
          },
          py::arg("factor") = 0.5f, py::arg("iterations") = 1, py::arg("use_x") = true, py::arg("use_y") = true,
          py::arg("use_z") = true,
          "factor: any finite number, even outside of 0 to 1.\n"
          "iterations: if 0 or less, nothing happens.\n"
          "use_x, use_y, use_z: the axes along which vertices move.\n"
          "Raises ValueError for a factor that is not finite.");

  py::class_<Hook, std::shared_ptr<Hook>>(
      module, "Hook",
      "Blender's Hook modifier: moves vertices by a matrix, x += part (M x - x), part = strength "
      "falloff weight. Immutable; several threads may use one at once.")
      .def(py::init(&make_hook), py::arg("vertex_count"), py::arg("vertices") = py::none(),
           py::arg("weights") = py::none(), py::arg("invert") = false,
           (std::string(
                "vertex_count: V.\n"
                "vertices: (H,) integers, the hooked vertices; one that is listed twice is moved twice. None: all "
                "that have a weight.\n") +
            kGroup +
            "All are copied. Without vertices and weights nothing is hooked, as in Blender. Raises "
            "ValueError for a vertex out of range, for sizes that do not fit and for numbers that "
            "are not finite.")
               .c_str())
      .def_property_readonly("vertex_count", &Hook::vertex_count, "V.")
      .def(
          "stage",
          [](const std::shared_ptr<Hook>& self, const py::array& matrix, float strength, const std::string& falloff,
             float radius, const std::array<float, 3>& center, const std::optional<py::array>& uniform) {
            return StageOfPython(std::shared_ptr<const Hook>(self),
                                 hook_settings(matrix, strength, falloff, radius, center, uniform));
          },
          py::arg("matrix"), py::arg("strength") = 1.0f, py::arg("falloff") = "none", py::arg("radius") = 0.0f,
          py::arg("center") = std::array<float, 3>{}, py::arg("uniform") = py::none(),
          "matrix: (4, 4), M, in the space of the mesh.\n"
          "strength: any finite number.\n"
          "falloff: how the strength falls from the center to the radius: \"none\", \"constant\", "
          "\"linear\", \"smooth\", \"sharp\", \"root\", \"sphere\" or \"inverse_square\".\n"
          "radius: 0 is no falloff.\n"
          "center: x, y, z in the space of the mesh.\n"
          "uniform: (3, 3): a transform in which distances are measured. None: the space of the mesh.\n"
          "Raises ValueError for an unknown falloff, for shapes that do not fit and for "
          "numbers "
          "that are not finite.");
}

}  // namespace sinew::bindings
