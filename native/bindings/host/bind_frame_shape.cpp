#include <pybind11/stl.h>

#include "arrays.h"
#include "host/frame_shape.h"
#include "layer_poses.h"
#include "stages.h"

namespace sinew::bindings {
namespace {

std::shared_ptr<FrameShape> shape_of(std::uint64_t identity, const py::sequence& poses,
                                     const std::optional<py::array>& key_values, const py::sequence& stages,
                                     const py::array& positions) {
  std::vector<LayerPose> layer_poses;
  for (const py::handle pose : poses) layer_poses.push_back(pose_of(pose, layer_poses.size()));
  std::span<const float> values;
  if (key_values) values = numbers_span("key_values", *key_values, "(K,)");
  const std::span<const float> numbers = numbers_span("positions", positions, "(V, 3)");
  const auto digest = digest_of(identity, layer_poses, values, stages_of(stages));
  return digest ? std::make_shared<FrameShape>(*digest, numbers) : nullptr;
}

}  // namespace

void bind_frame_shape(py::module_& host) {
  py::class_<FrameShape, std::shared_ptr<FrameShape>>(
      host, "FrameShape", "The shape of a mesh on one frame, and a digest of what it was computed from. Immutable.")
      .def_property_readonly(
          "positions",
          [](const py::object& self) {
            const auto& own = self.cast<const FrameShape&>();
            return view(own.positions.get(), {static_cast<py::ssize_t>(own.count / 3), 3}, {3, 1}, self);
          },
          "(V, 3) float32, read-only.")
      .def_property_readonly(
          "nbytes", [](const FrameShape& self) { return self.count * sizeof(float) + sizeof self; },
          "How much memory it needs.")
      .def(
          "is_of_same", [](const FrameShape& self, const FrameShape& other) { return self.digest == other.digest; },
          py::arg("other"), "Whether another one was computed from the same.");
  host.def("shape_of", &shape_of, py::arg("identity"), py::arg("poses"), py::arg("key_values"), py::arg("stages"),
           py::arg("positions"),
           "Copies a shape that Deformer.deform has computed.\n\n"
           "identity: a number that no other deformer, stages and rest shape have.\n"
           "poses, key_values, stages: as in Deformer.deform.\n"
           "positions: (V, 3) float32, C-contiguous.\n"
           "Returns a FrameShape; None if a stage follows the shape of another object, which cannot be compared.");
}

}  // namespace sinew::bindings
