#include <pybind11/stl.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>

#include "arrays.h"
#include "given_weights.h"
#include "interruptible.h"
#include "sinew/automatic_weights.h"

namespace sinew::bindings {
namespace {

WeightMethod weight_method_named(const std::string& name) {
  if (name == "heat") return WeightMethod::heat;
  if (name == "volume") return WeightMethod::volume;
  if (name == "nearest") return WeightMethod::nearest;
  throw InputError("there is no method \"" + name + "\"; expected heat, volume or nearest");
}

RigidFollow rigid_follow_named(const std::string& name) {
  if (name == "attachment") return RigidFollow::attachment;
  if (name == "bone") return RigidFollow::bone;
  throw InputError("there is no rigid_follow \"" + name + "\"; expected attachment or bone");
}

std::vector<std::int32_t> integers_or_none(const char* name, const std::optional<py::array>& array) {
  if (!array) return {};
  return list_of<std::int32_t>(name, *array);
}

std::shared_ptr<AutomaticWeights> compute_weights(
    const py::array& positions, const py::array& face_offsets, const py::array& face_vertices, const py::array& heads,
    const py::array& tails, const std::optional<py::array>& joints, const std::string& method, int resolution,
    double stiffness, int max_influences, double least_weight, const std::optional<py::array>& fixed_vertices,
    const py::object& fixed_weights, const std::optional<py::array>& rigid_parts, double rigid_size,
    const std::string& rigid_follow, OrNone<Progress> progress) {
  // Copied, since the computation runs without the GIL.
  const std::vector<double> points = points_of<double>("positions", positions);
  const std::vector<std::int32_t> offsets = list_of<std::int32_t>("face_offsets", face_offsets);
  const std::vector<std::int32_t> corners = list_of<std::int32_t>("face_vertices", face_vertices);
  const std::vector<double> from = points_of<double>("heads", heads), to = points_of<double>("tails", tails);
  const std::vector<std::int32_t> of_bones = integers_or_none("joints", joints);
  if (joints && of_bones.empty() && !from.empty()) throw InputError("joints is empty; expected one for each bone");
  const std::vector<std::int32_t> fixed = integers_or_none("fixed_vertices", fixed_vertices);
  const std::vector<std::int32_t> rigid = integers_or_none("rigid_parts", rigid_parts);
  if (fixed_vertices.has_value() == fixed_weights.is_none()) {
    throw InputError("fixed_vertices and fixed_weights belong together; expected both or neither");
  }
  const WeightTable given =
      fixed_weights.is_none() ? WeightTable() : *given_table("fixed_weights", fixed_weights, "(F, J)");
  const WeightSettings settings{
      weight_method_named(method),     resolution, stiffness, max_influences, least_weight, rigid, rigid_size,
      rigid_follow_named(rigid_follow)};
  return interruptible(progress, [&](Progress* own) {
    auto result = automatic_weights(points, offsets, corners, {from, to, of_bones}, {fixed, given}, settings, own);
    return result ? std::make_shared<AutomaticWeights>(std::move(*result)) : nullptr;
  });
}

/// Keeps the weights that it reports on.
struct WeightReport {
  std::shared_ptr<const AutomaticWeights> weights;

  std::ptrdiff_t count(WeightWay way) const { return std::ranges::count(weights->ways, way); }
};

template <WeightWay way>
std::ptrdiff_t count_of(const WeightReport& self) {
  return self.count(way);
}

}  // namespace

void bind_automatic_weights(py::module_& module) {
  py::class_<WeightReport>(module, "WeightReport", "What automatic_weights did. Immutable.")
      .def_property_readonly(
          "vertex_count", [](const WeightReport& self) { return std::ssize(self.weights->ways); }, "V.")
      .def_property_readonly(
          "part_count", [](const WeightReport& self) { return self.weights->part_count; },
          "How many connected parts the mesh has; coincident vertices are connected.")
      .def_property_readonly("surface_count", &count_of<WeightWay::surface>,
                             "How many vertices have weights from heat on the surface.")
      .def_property_readonly("volume_count", &count_of<WeightWay::volume>,
                             "How many have them from heat in the volume: those of fragments and loose vertices.")
      .def_property_readonly("nearest_count", &count_of<WeightWay::nearest>,
                             "How many follow the nearest bone through the air.")
      .def_property_readonly("fixed_count", &count_of<WeightWay::fixed>,
                             "How many were given, with those that coincide with them.")
      .def_property_readonly("rigid_count", &count_of<WeightWay::rigid>, "How many are in rigid parts.")
      .def_property_readonly(
          "bones_outside",
          [](const WeightReport& self) {
            return given_away(std::vector(self.weights->bones_outside), {std::ssize(self.weights->bones_outside)});
          },
          "(N,) int32: bones of which nothing is inside the mesh, ascending. A copy.")
      .def_property_readonly(
          "voxel_size", [](const WeightReport& self) { return self.weights->voxel_size; },
          "In the unit of the positions; 0 if all of them are equal.")
      .def_property_readonly(
          "seconds", [](const WeightReport& self) { return self.weights->seconds; }, "How long it took.");

  py::class_<AutomaticWeights, std::shared_ptr<AutomaticWeights>> bound(
      module, "AutomaticWeights", "Weights for a Skin, from automatic_weights. Immutable.");
  bind_entries(bound, "joints", ", with sum 1 at each vertex.");
  bound
      .def_property_readonly(
          "ways",
          [](const py::object& self) {
            const auto& ways = self.cast<const AutomaticWeights&>().ways;
            return view(reinterpret_cast<const std::uint8_t*>(ways.data()), {std::ssize(ways)}, {1}, self);
          },
          "(V,) uint8, read-only: how each vertex got its weights: 0 surface, 1 volume, 2 nearest, 3 fixed, 4 rigid.")
      .def_property_readonly(
          "parts", [](const py::object& self) { return view_list(self.cast<const AutomaticWeights&>().parts, self); },
          "(V,) int32, read-only: the connected part of each vertex.")
      .def_property_readonly(
          "report", [](const std::shared_ptr<AutomaticWeights>& self) { return WeightReport{self}; },
          "The WeightReport.");

  module.def(
      "automatic_weights", &compute_weights, py::arg("positions"), py::arg("face_offsets"), py::arg("face_vertices"),
      py::arg("heads"), py::arg("tails"), py::kw_only(), py::arg("joints") = py::none(), py::arg("method") = "heat",
      py::arg("resolution") = 128, py::arg("stiffness") = 8.0, py::arg("max_influences") = 0,
      py::arg("least_weight") = 0.01, py::arg("fixed_vertices") = py::none(), py::arg("fixed_weights") = py::none(),
      py::arg("rigid_parts") = py::none(), py::arg("rigid_size") = 0.0, py::arg("rigid_follow") = "attachment",
      py::arg("progress") = py::none(),
      "Computes weights for any mesh and any bones by heat diffusion, for a Skin. Every vertex gets some.\n\n"
      "With positions scaled to size 1 and coincident vertices welded, L the Laplacian of the surface (cotangents, "
      "clamped to 0..20) and A the area of each vertex: (L + A H) w_j = A H p_j, H_i = stiffness / d_i^2, where d_i is "
      "the distance to the nearest bone through the solid, longer for bones that are not behind the surface (divided "
      "by "
      "((cos + 1.001) / 2)^1.5), and p_ij is 1 if that bone is j. Near ties are shared. After Baran and Popovic 2007, "
      "with "
      "distances through voxels in place of visibility. A voxel is solid where the surface meets it or the generalized "
      "winding number is above 1/2 or below -1/2. For parts of fewer than 16 triangles or smaller than four voxels, "
      "and "
      "for loose vertices, the same equation is solved among the voxels.\n\n"
      "positions: (V, 3), finite, in any unit and space.\n"
      "face_offsets: (faces + 1,) integers, where the corners of each face begin; empty: there are no faces.\n"
      "face_vertices: (C,) integers, the vertices around each face, face after face; a polygon counts as a fan of "
      "triangles.\n"
      "heads, tails: (B, 3), the ends of the bones, in the space of the positions. One bone at least. Lengths may be "
      "0.\n"
      "joints: (B,) integers, the joint of each bone; several bones may share one, as segments do. None: bone b is "
      "joint "
      "b. J is one more than the largest.\n"
      "method: \"heat\"; \"volume\" for heat among voxels at all vertices, which is softer in folds and continuous "
      "from "
      "part to part; \"nearest\" for the nearest bone through the air.\n"
      "resolution: 8 to 256, voxels along the longest side of the mesh; a bulky mesh gets fewer.\n"
      "stiffness: 0.001 to 1,000,000, how closely weights follow the nearest bone. Blender's bone heat is about 4.\n"
      "max_influences: the largest number for a vertex; 0: any.\n"
      "least_weight: 0 to 0.5, smaller weights are left out. Then each vertex's weights are divided by their sum.\n"
      "fixed_vertices: (F,) integers, those whose weights are given; the others are solved for around them.\n"
      "fixed_weights: (F, J), or a WeightTable, 0 or more with a sum above 0 in each row.\n"
      "rigid_parts: (V,) integers: all vertices with the same number, 0 or more, get the same weights; -1: no part.\n"
      "rigid_size: 0 to 1: connected parts whose bounding box has a diagonal shorter than this share of the mesh's are "
      "rigid, too.\n"
      "rigid_follow: \"attachment\": a rigid part gets the weights of the closest point of the rest of the surface; "
      "\"bone\": it follows one bone.\n"
      "progress: a Progress that another thread watches, or None. If it is cancelled, None is returned. Ctrl C cancels "
      "it, too.\n"
      "Returns AutomaticWeights: the same bits for any number of threads. Raises ValueError for sizes that do not fit, "
      "vertices that do not exist, numbers that are not finite, no bones, settings out of range.");
}

}  // namespace sinew::bindings
