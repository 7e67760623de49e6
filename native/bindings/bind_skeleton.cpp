#include <pybind11/stl.h>

#include "arrays.h"
#include "sinew/forward_kinematics.h"
#include "sinew/local_transforms.h"
#include "sinew/pose_clip.h"

namespace sinew::bindings {
namespace {

template <class T>
py::array empty_like_stack(const MatrixStack<const T>& stack, bool has_frames, py::dtype dtype) {
  std::vector<py::ssize_t> shape{stack.joints, 4, 4};
  if (has_frames) shape.insert(shape.begin(), stack.frames);
  return py::array(dtype, shape);
}

/// Calls compute(in, out) on views of the arrays and returns out, which is created if it is None.
template <class In, class Out, class Compute>
py::array into(const char* name, const py::array& in, const py::object& out, const Compute& compute) {
  const auto source = matrix_stack<const In>(name, in);
  const py::array result =
      out.is_none() ? empty_like_stack(source, in.ndim() == 4, py::dtype::of<Out>()) : given_array("out", out);
  const auto target = matrix_stack<Out>("out", result);
  {
    const py::gil_scoped_release release;
    compute(source, target);
  }
  return result;
}

/// Checks the dtype for functions that compute in the dtype of their argument.
void require_float_or_double(const char* name, const py::array& array) {
  if (!py::isinstance<py::array_t<float>>(array) && !py::isinstance<py::array_t<double>>(array)) {
    throw InputError(std::string(name) + " is " + dtype_text(array) + "; expected float32 or float64");
  }
}

py::array py_forward_kinematics(const Skeleton& skeleton, const py::array& local, const py::object& out) {
  require_float_or_double("local", local);
  const auto run = [&](auto source, auto target) { forward_kinematics(skeleton, source, target); };
  if (py::isinstance<py::array_t<float>>(local)) return into<float, float>("local", local, out, run);
  return into<double, double>("local", local, out, run);
}

py::array py_skinning_matrices(const Skeleton& skeleton, const py::array& world, const py::object& out) {
  require_float_or_double("world", world);
  const auto run = [&](auto source, auto target) { skinning_matrices(skeleton, source, target); };
  if (py::isinstance<py::array_t<float>>(world)) return into<float, float>("world", world, out, run);
  return into<double, float>("world", world, out, run);
}

py::tuple py_local_transforms(const Skeleton& skeleton, const py::array& world,
                              const std::optional<std::vector<bool>>& may_move) {
  require_float_or_double("world", world);
  std::vector<std::uint8_t> moves;
  if (may_move) moves.assign(may_move->begin(), may_move->end());
  const auto split = [&](auto stack) {
    const py::gil_scoped_release release;
    return local_transforms(skeleton, stack, moves);
  };
  const bool is_float = py::isinstance<py::array_t<float>>(world);
  const LocalTransforms found = is_float ? split(matrix_stack<const float>("world", world, "(F, J, 4, 4)"))
                                         : split(matrix_stack<const double>("world", world, "(F, J, 4, 4)"));
  const auto shaped = [&](const std::vector<double>& numbers, py::ssize_t count) {
    return py::array_t<double>({world.shape(0), world.shape(1), count}, numbers.data());
  };
  py::array_t<double> played({world.shape(0), world.shape(1), py::ssize_t{4}, py::ssize_t{4}});
  const auto stack = matrix_stack<double>("played", played);
  for (std::ptrdiff_t i = 0; i < std::ssize(found.played); ++i) {
    stack.at(i / skeleton.joint_count(), i % skeleton.joint_count()) = found.played[i];
  }
  return py::make_tuple(shaped(found.locations, 3), shaped(found.rotations, 4), shaped(found.scales, 3), played);
}

/// Copies (..., J, 4) numbers, w x y z, into quaternions.
std::vector<Eigen::Quaterniond> copied_rotations(const py::array& array, const char* shape) {
  require_shape("rotations", array, shape);
  const std::vector<double> numbers = copied<double>("rotations", array);
  std::vector<Eigen::Quaterniond> quaternions;
  quaternions.reserve(numbers.size() / 4);
  for (std::size_t i = 0; i < numbers.size(); i += 4) {
    quaternions.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2], numbers[i + 3]);
  }
  return quaternions;
}

py::array_t<double> rotation_array(std::span<const Eigen::Quaterniond> rotations, std::vector<py::ssize_t> shape) {
  py::array_t<double> array(std::move(shape));
  double* out = array.mutable_data();
  for (const Eigen::Quaterniond& q : rotations) {
    for (const double number : {q.w(), q.x(), q.y(), q.z()}) *out++ = number;
  }
  return array;
}

py::array_t<double> clip_sample(const PoseClip& clip, double time, bool loop) {
  std::vector<Eigen::Quaterniond> rotations(clip.joint_count());
  clip.sample(time, loop, rotations);
  return rotation_array(rotations, {clip.joint_count(), 4});
}

py::array py_rotation_transforms(const py::array& rotations, const py::object& out) {
  const auto quaternions = copied_rotations(rotations, "(J, 4)");
  const py::array result = out.is_none() ? py::array_t<double>({rotations.shape(0), py::ssize_t{4}, py::ssize_t{4}})
                                         : given_array("out", out);
  rotation_transforms<double>(quaternions, matrix_stack<double>("out", result, "(J, 4, 4)"));
  return result;
}

}  // namespace

void bind_skeleton(py::module_& module) {
  py::class_<Skeleton>(module, "Skeleton", "The tree of joints and its rest pose. Immutable.")
      .def(py::init([](const py::array& parents, const py::array& rest) {
             return Skeleton(list_of<std::int32_t>("parents", parents), copied_matrices("rest", rest, "(J, 4, 4)"));
           }),
           py::arg("parents"), py::arg("rest"),
           "parents: (J,) integers, each joint's parent, -1 for a root; a parent may come after "
           "its child.\n"
           "rest: (J, 4, 4), R(j), each joint's rest transform relative to its parent, or to the world for a root.\n"
           "Raises ValueError for a parent that does not exist, a cycle, a number that is not "
           "finite, a rest transform that cannot be inverted.")
      .def_property_readonly("joint_count", &Skeleton::joint_count, "J.")
      .def_property_readonly(
          "parents", [](py::object self) { return view_list(self.cast<const Skeleton&>().parents(), self); },
          "(J,) int32, read-only: each joint's parent, -1 for a root.")
      .def_property_readonly(
          "rest", [](py::object self) { return view_matrices(self.cast<const Skeleton&>().rest<double>(), self); },
          "(J, 4, 4) float64, read-only: R(j), relative to the parent.")
      .def_property_readonly(
          "rest_world", [](py::object self) { return view_matrices(self.cast<const Skeleton&>().rest_world(), self); },
          "(J, 4, 4) float64, read-only: A(j), relative to the world.")
      .def_property_readonly(
          "inverse_rest",
          [](py::object self) { return view_matrices(self.cast<const Skeleton&>().inverse_rest(), self); },
          "(J, 4, 4) float64, read-only: A(j)^-1.")
      .def("__repr__",
           [](const Skeleton& self) { return "<Skeleton of " + std::to_string(self.joint_count()) + " joints>"; });

  module.def("forward_kinematics", &py_forward_kinematics, py::arg("skeleton"), py::arg("local"),
             py::arg("out") = py::none(),
             "Computes F(j) = F(parent) R(j) T(j) for each joint of each frame.\n\n"
             "local: T(j), (J, 4, 4) or (F, J, 4, 4), float32 or float64, any strides.\n"
             "out: where to write F(j), shape and dtype of local, any strides; it may be local "
             "itself, but must not overlap it in any other way; made if None.\n"
             "Returns out. Raises ValueError if a shape or dtype does not fit.");
  module.def("skinning_matrices", &py_skinning_matrices, py::arg("skeleton"), py::arg("world"),
             py::arg("out") = py::none(),
             "Computes F(j) A(j)^-1 for each joint of each frame, as the skinning functions expect it.\n\n"
             "world: F(j), (J, 4, 4) or (F, J, 4, 4), float32 or float64, any strides.\n"
             "out: (J, 4, 4) or (F, J, 4, 4) as world, float32, where to write, any strides; made if None.\n"
             "Returns out. Raises ValueError if a shape or dtype does not fit.");
  module.def(
      "local_transforms", &py_local_transforms, py::arg("skeleton"), py::arg("world"), py::arg("may_move") = py::none(),
      "Computes the location, rotation and scale of each joint from which forward_kinematics makes these poses: "
      "what is keyed.\n\n"
      "world: F(j), (F, J, 4, 4), float32 or float64, any strides.\n"
      "may_move: J bools, whether a joint may have a location; all may if None.\n"
      "Returns locations (F, J, 3), rotations (F, J, 4), unit quaternions w x y z, each on the short way from the "
      "frame before, scales (F, J, 3), and F(j) as these play it, (F, J, 4, 4), all float64. A joint that shears "
      "relative to its parent gets the nearest rotation and scale, and its children are relative to that.\n"
      "Raises ValueError if a shape or dtype does not fit, for a number that is not finite, and if a joint that "
      "has children has a scale of 0 along an axis.");

  py::class_<PoseClip>(module, "PoseClip", "P poses of J joint rotations. Immutable.")
      .def(
          py::init([](const py::array& rotations) {
            auto quaternions = copied_rotations(rotations, "(P, J, 4)");
            return PoseClip(rotations.shape(1), std::move(quaternions));
          }),
          py::arg("rotations"),
          "rotations: (P, J, 4), quaternions w x y z, each on top of its joint's rest transform; "
          "they are normalized.\n"
          "Raises ValueError if there is no pose or no joint, and for a quaternion that is not finite or has length 0.")
      .def_property_readonly("joint_count", &PoseClip::joint_count, "J.")
      .def_property_readonly("pose_count", &PoseClip::pose_count, "P.")
      .def_property_readonly(
          "rotations",
          [](const PoseClip& self) {
            return rotation_array(self.rotations(), {self.pose_count(), self.joint_count(), 4});
          },
          "(P, J, 4) float64, w x y z, unit length. A copy.")
      .def("sample", &clip_sample, py::arg("time"), py::arg("loop") = false,
           "Returns the rotations, (J, 4) float64 w x y z, at a time counted in poses, by spherical "
           "interpolation.\n\n"
           "time: 0 is the first pose, P - 1 the last.\n"
           "loop: the first pose follows the last, and time wraps at P; otherwise time is clamped to "
           "the ends.\n"
           "Raises ValueError for a time that is not finite.");
  module.def("rotation_transforms", &py_rotation_transforms, py::arg("rotations"), py::arg("out") = py::none(),
             "Computes T(j) of joints that only rotate.\n\n"
             "rotations: (J, 4), unit quaternions w x y z.\n"
             "out: where to write, (J, 4, 4) float64, any strides; made if None.\n"
             "Returns out. Raises ValueError if a shape or dtype does not fit.");
}

}  // namespace sinew::bindings
