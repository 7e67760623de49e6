#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "arrays.h"
#include "sinew/bvh.h"

namespace sinew::bindings {
namespace {

using Path = std::filesystem::path;
using Eigen::Quaterniond;
using Eigen::Vector3d;

std::vector<Vector3d> copied_points(const char* name, const py::array& array, const char* shape) {
  require_shape(name, array, shape);
  const std::vector<double> numbers = copied<double>(name, array);
  std::vector<Vector3d> points;
  points.reserve(numbers.size() / 3);
  for (std::size_t i = 0; i < numbers.size(); i += 3) points.emplace_back(numbers.data() + i);
  return points;
}

BvhClip clip_of(std::vector<std::string> names, const py::array& parents, const py::array& offsets, double frame_time,
                const py::array& locations, const py::array& rotations, const std::optional<py::array>& ends) {
  auto rest = copied_points("offsets", offsets, "(J, 3)");
  const auto joints = std::to_string(rest.size());
  auto moved = copied_points("locations", locations, ("(F, " + joints + ", 3)").c_str());
  require_shape("rotations", rotations, "(F, " + joints + ", 4)");
  const std::vector<double> numbers = copied<double>("rotations", rotations);
  std::vector<Quaterniond> turned;
  turned.reserve(numbers.size() / 4);
  for (std::size_t i = 0; i < numbers.size(); i += 4) {
    turned.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2], numbers[i + 3]);
  }
  std::vector<Vector3d> tips(rest.size(), Vector3d::Zero());
  if (ends) tips = copied_points("ends", *ends, "(J, 3)");
  return BvhClip(list_of<std::int32_t>("parents", parents), std::move(rest), std::move(tips), std::move(names),
                 frame_time, std::move(moved), std::move(turned));
}

py::array view_points(const std::vector<Vector3d>& points, std::vector<py::ssize_t> shape, const py::object& owner) {
  std::vector<py::ssize_t> strides{1};
  for (auto size = shape.rbegin(); size + 1 != shape.rend(); ++size)
    strides.insert(strides.begin(), strides[0] * *size);
  return view(points.empty() ? nullptr : points.front().data(), std::move(shape), std::move(strides), owner);
}

py::array rotations_of(const BvhClip& clip) {
  py::array_t<double> array({clip.frame_count(), clip.skeleton().joint_count(), std::ptrdiff_t{4}});
  double* out = array.mutable_data();
  for (const Quaterniond& q : clip.rotations()) {
    for (const double number : {q.w(), q.x(), q.y(), q.z()}) *out++ = number;
  }
  return array;
}

py::array local_of(const BvhClip& clip) {
  py::array_t<double> array({clip.frame_count(), clip.skeleton().joint_count(), std::ptrdiff_t{4}, std::ptrdiff_t{4}});
  double* out = array.mutable_data();
  for (std::size_t i = 0; i < clip.rotations().size(); ++i, out += 16) {
    Matrix4<double> matrix = Matrix4<double>::Identity();
    matrix.topLeftCorner<3, 3>() = clip.rotations()[i].toRotationMatrix();
    matrix.topRightCorner<3, 1>() = clip.locations()[i];
    Matrix4<double>::Map(out) = matrix.transpose();
  }
  return array;
}

void bind_clip(py::module_& module) {
  py::class_<BvhClip>(module, "BvhClip",
                      "F frames of J joints as a .bvh file has them: without rest rotations and scales. Immutable.")
      .def(py::init(&clip_of), py::arg("names"), py::arg("parents"), py::arg("offsets"), py::arg("frame_time"),
           py::arg("locations"), py::arg("rotations"), py::arg("ends") = py::none(),
           "names: J names.\n"
           "parents: (J,) integers, each joint's parent, -1 for a root.\n"
           "offsets: (J, 3), at rest: where each joint is relative to its parent, or to the world for a root.\n"
           "frame_time: seconds from one frame to the next.\n"
           "locations: (F, J, 3), on top of the offset, relative to the parent.\n"
           "rotations: (F, J, 4), quaternions w x y z, relative to the parent; they are normalized.\n"
           "ends: (J, 3), at rest: where the bone of a joint without children ends, relative to the joint; all 0 if "
           "None.\n"
           "Raises ValueError if the parts do not fit each other, for a cycle, for no frame, and for a number that is "
           "not finite.")
      .def_property_readonly("names", &BvhClip::names, "J names.")
      .def_property_readonly("skeleton", &BvhClip::skeleton, py::return_value_policy::reference_internal,
                             "The Skeleton, whose rest transforms are translations.")
      .def_property_readonly(
          "offsets",
          [](py::object self) {
            const auto& clip = self.cast<const BvhClip&>();
            return view_points(clip.offsets(), {clip.skeleton().joint_count(), 3}, self);
          },
          "(J, 3) float64, read-only, at rest: where each joint is relative to its parent.")
      .def_property_readonly(
          "ends",
          [](py::object self) {
            const auto& clip = self.cast<const BvhClip&>();
            return view_points(clip.ends(), {clip.skeleton().joint_count(), 3}, self);
          },
          "(J, 3) float64, read-only, at rest: where the bone of a joint without children ends, relative to it.")
      .def_property_readonly("frame_time", &BvhClip::frame_time, "Seconds from one frame to the next.")
      .def_property_readonly("frame_count", &BvhClip::frame_count, "F.")
      .def_property_readonly(
          "locations",
          [](py::object self) {
            const auto& clip = self.cast<const BvhClip&>();
            return view_points(clip.locations(), {clip.frame_count(), clip.skeleton().joint_count(), 3}, self);
          },
          "(F, J, 3) float64, read-only: on top of the offset, relative to the parent.")
      .def_property_readonly("rotations", &rotations_of, "(F, J, 4) float64, w x y z, unit length. A copy.")
      .def_property_readonly("local", &local_of,
                             "(F, J, 4, 4) float64: T(j), as forward_kinematics takes them. A copy.");
}

}  // namespace

void bind_bvh(py::module_& module) {
  bind_clip(module);
  module.def("read_bvh", &read_bvh, py::call_guard<py::gil_scoped_release>(), py::arg("path"),
             "Reads a .bvh file as a BvhClip. Axes and units are the file's. Raises ValueError, naming file and line, "
             "for what cannot be read.");
  module.def("write_bvh", &write_bvh, py::call_guard<py::gil_scoped_release>(), py::arg("path"), py::arg("clip"),
             "Writes a .bvh file that read_bvh reads back as the same motion, to rounding, with joints in depth-first "
             "order. Roots, and joints that have a location, get position channels.\n\n"
             "clip: a BvhClip.\n"
             "Raises ValueError for a name that the format cannot hold, and if the file cannot be written.");
}

}  // namespace sinew::bindings
