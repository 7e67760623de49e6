#include <pybind11/stl.h>

#include <memory>
#include <optional>

#include "arrays.h"
#include "methods.h"
#include "sinew/skinning.h"
#include "skinned.h"

namespace sinew::bindings {
namespace {

py::array blended(const Skin& skin, const BlendShares& shares, const py::array& matrices, const py::object& out,
                  const std::string& stretch, const std::optional<py::array>& rest_frames) {
  std::vector<Matrix4<double>> frames;
  if (rest_frames) frames = copied_matrices("rest_frames", *rest_frames, 3);
  const StretchRule rule{stretch_named(stretch), frames};
  return skinned(skin, matrices, out,
                 [&](auto stack, auto positions) { skin_blended(skin, shares, stack, positions, rule); });
}

}  // namespace

void bind_method_data(py::module_& module) {
  py::class_<MethodData, std::shared_ptr<MethodData>>(
      module, "MethodData", "What a method has of its own for each vertex: the base of BlendShares. Immutable.")
      .def_property_readonly(
          "method", [](const MethodData& self) { return name_of(self.method()); }, "The one method that takes it.")
      .def_property_readonly("vertex_count", &MethodData::vertex_count, "V.");

  py::class_<BlendShares, MethodData, std::shared_ptr<BlendShares>>(
      module, "BlendShares", "How much of dual quaternion skinning each vertex has, for the method \"blended\".")
      .def(py::init([](const py::array& shares) { return BlendShares(list_of<float>("shares", shares)); }),
           py::arg("shares"),
           "shares: (V,), each from 0, linear skinning, to 1, dual quaternion skinning; both to the bit. Copied.\n"
           "Raises ValueError, naming the vertex, for a share that is not from 0 to 1.")
      .def_property_readonly(
          "shares", [](py::object self) { return view_list(self.cast<const BlendShares&>().shares(), self); },
          "(V,) float32, read-only.");

  module.def("skin_blended", &blended, py::arg("skin"), py::arg("shares"), py::arg("matrices"),
             py::arg("out") = py::none(), py::arg("stretch") = "polar", py::arg("rest_frames") = py::none(),
             (std::string("Linear and dual quaternion skinning, blended: v' = linear + share (dual quaternion - "
                          "linear).\n\n"
                          "shares: a BlendShares of V vertices.\n") +
              kSkinArguments + "stretch, rest_frames: as in skin_dual_quaternion.\n" + kSkinReturns)
                 .c_str());
}

}  // namespace sinew::bindings
