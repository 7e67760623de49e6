#include <pybind11/stl.h>

#include <memory>
#include <optional>

#include "arrays.h"
#include "interruptible.h"
#include "methods.h"
#include "sinew/progress.h"
#include "sinew/skinning.h"
#include "skinned.h"

namespace sinew::bindings {
namespace {

py::array blended(const Skin& skin, const BlendShares& shares, const py::array& matrices, const py::object& out,
                  const std::string& stretch, const std::optional<py::array>& rest_frames) {
  std::vector<Matrix4<double>> frames;
  if (rest_frames) frames = copied_matrices("rest_frames", *rest_frames, "(J, 4, 4)");
  const StretchRule rule{stretch_named(stretch), frames};
  return skinned(skin, matrices, out,
                 [&](auto stack, auto positions) { skin_blended(skin, shares, stack, positions, rule); });
}

py::array rotation_centers(const Skin& skin, const RotationCenters& centers, const py::array& matrices,
                           const py::object& out) {
  return skinned(skin, matrices, out,
                 [&](auto stack, auto positions) { skin_rotation_centers(skin, centers, stack, positions); });
}

std::shared_ptr<RotationCenters> make_centers(const py::array& centers, const py::array& has_center) {
  require_shape("has_center", has_center, "(V,)");
  if (has_center.dtype().kind() != 'b') {
    throw InputError("has_center is " + dtype_text(has_center) + "; expected bool");
  }
  const auto flags = py::array_t<bool, py::array::c_style>(has_center);
  const std::vector<std::uint8_t> numbers(flags.data(), flags.data() + flags.size());
  const auto points = points_of<float>("centers", centers);
  const py::gil_scoped_release release;
  return std::make_shared<RotationCenters>(points, numbers);
}

std::shared_ptr<RotationCenters> compute_centers(const Skin& skin, const py::array& face_offsets,
                                                 const py::array& face_vertices, double sigma,
                                                 OrNone<Progress> progress) {
  const std::vector<std::int32_t> offsets = list_of<std::int32_t>("face_offsets", face_offsets);
  const std::vector<std::int32_t> vertices = list_of<std::int32_t>("face_vertices", face_vertices);
  return interruptible(progress, [&](Progress* own) {
    return std::const_pointer_cast<RotationCenters>(RotationCenters::compute(skin, offsets, vertices, sigma, own));
  });
}

py::array centers_of(const RotationCenters& self) {
  py::array_t<float> centers({self.vertex_count(), std::ptrdiff_t{3}});
  for (std::ptrdiff_t v = 0; v < self.vertex_count(); ++v) {
    for (std::ptrdiff_t i = 3 * v; i < 3 * v + 3; ++i) {
      centers.mutable_data()[i] = self.has_center(v) ? self.centers()[i] : 0;
    }
  }
  return centers;
}

py::array has_center_of(const RotationCenters& self) {
  py::array_t<bool> flags(self.vertex_count());
  for (std::ptrdiff_t v = 0; v < self.vertex_count(); ++v) flags.mutable_data()[v] = self.has_center(v);
  return flags;
}

}  // namespace

void bind_method_data(py::module_& module) {
  py::class_<MethodData, std::shared_ptr<MethodData>>(
      module, "MethodData",
      "A method's own data for each vertex: the base class of BlendShares, RotationCenters and DirectDeltaMush. "
      "Immutable.")
      .def_property_readonly(
          "method", [](const MethodData& self) { return name_of(self.method()); }, "The one method that takes it.")
      .def_property_readonly("vertex_count", &MethodData::vertex_count, "V.");

  py::class_<BlendShares, MethodData, std::shared_ptr<BlendShares>>(
      module, "BlendShares", "The share of dual quaternion skinning of each vertex, for the method \"blended\".")
      .def(py::init([](const py::array& shares) {
             const auto numbers = list_of<float>("shares", shares);
             const py::gil_scoped_release release;
             return std::make_shared<BlendShares>(numbers);
           }),
           py::arg("shares"),
           "shares: (V,), each from 0, linear skinning, to 1, dual quaternion skinning; the ends give exactly the bits "
           "of these two. Copied.\n"
           "Raises ValueError, naming the vertex, for a share that is not from 0 to 1.")
      .def_property_readonly(
          "shares", [](py::object self) { return view_list(self.cast<const BlendShares&>().shares(), self); },
          "(V,) float32, read-only.");

  py::class_<Progress, std::shared_ptr<Progress>>(module, "Progress",
                                                  "The progress of a long computation, and a way to cancel it. Make it "
                                                  "in one thread and pass it to a computation in another.")
      .def(py::init<>(), "Use it for one computation at a time.")
      .def_property_readonly("fraction", &Progress::fraction, "0 to 1.")
      .def_property_readonly("is_cancelled", &Progress::is_cancelled, "Whether cancel() was called.")
      .def("cancel", &Progress::cancel,
           "Ends the computation within about 0.1 s; it then returns None. What solves begins by ordering its matrix, "
           "which cannot be interrupted: 0.2 s for 300,000 vertices, 0.4 s in transfer_weights.");

  py::class_<RotationCenters, MethodData, std::shared_ptr<RotationCenters>>(
      module, "RotationCenters",
      "Optimized centers of rotation (Le and Hodgins 2016), for the method \"rotation_centers\".")
      .def(py::init(&make_centers), py::arg("centers"), py::arg("has_center"),
           "Restores arrays that compute() made before.\n\n"
           "centers: (V, 3), space of the rest mesh.\n"
           "has_center: (V,) bool; a vertex without a center moves linearly, and its row of centers is ignored.\n"
           "Raises ValueError for sizes that do not fit and for a center that is not finite.")
      .def_static(
          "compute", &compute_centers, py::arg("skin"), py::arg("face_offsets"), py::arg("face_vertices"),
          py::arg("sigma") = 0.1, py::arg("progress") = py::none(),
          "For each vertex, the mean of the mesh's surface, weighted by how similar the weights there are to the "
          "vertex's own. The GIL is released.\n\n"
          "skin: V vertices at rest; weights that are not above 0 count as 0. It must not change meanwhile.\n"
          "face_offsets: (faces + 1,) integers, where each face begins in face_vertices.\n"
          "face_vertices: (C,) integers, the vertices around each face; a polygon counts as a fan of triangles.\n"
          "sigma: above 0; the larger it is, the less similar weights need to be.\n"
          "progress: a Progress that another thread watches, or None.\n"
          "A vertex has no center if fewer than two joints move it, or if no triangle has similar weights. Triangles "
          "whose weights differ by less than a sixteenth of sigma are taken together. Returns None if progress was "
          "cancelled, which Ctrl C does, too. Raises ValueError for what does not fit.")
      .def_property_readonly("centers", &centers_of, "(V, 3) float32, zeros for vertices without a center. A copy.")
      .def_property_readonly("has_center", &has_center_of, "(V,) bool. A copy.")
      .def_property_readonly("count", &RotationCenters::count, "How many vertices have a center.");

  module.def("skin_rotation_centers", &rotation_centers, py::arg("skin"), py::arg("centers"), py::arg("matrices"),
             py::arg("out") = py::none(),
             (std::string("Skinning about optimized centers of rotation (Le and Hodgins 2016): "
                          "v' = R (v - p) + sum_j w_j M(j) p.\n\n"
                          "centers: a RotationCenters of V vertices.\n") +
              kSkinArguments + "Scale and shear are blended linearly and applied to v - p first.\n" + kSkinReturns)
                 .c_str());
  module.def(
      "skin_blended", &blended, py::arg("skin"), py::arg("shares"), py::arg("matrices"), py::arg("out") = py::none(),
      py::arg("stretch") = "polar", py::arg("rest_frames") = py::none(),
      (std::string("Linear and dual quaternion skinning, blended: v' = linear + share (dual quaternion - "
                   "linear).\n\n"
                   "shares: a BlendShares of V vertices.\n") +
       kSkinArguments + "stretch: as in skin_dual_quaternion.\nrest_frames: (J, 4, 4), likewise.\n" + kSkinReturns)
          .c_str());
}

}  // namespace sinew::bindings
