#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>

#include "arrays.h"
#include "sinew/automatic_weights.h"
#include "sinew/dmat.h"
#include "sinew/rig.h"

namespace sinew::bindings {
namespace {

using Path = std::filesystem::path;

std::optional<Convention> convention_of(const std::optional<std::string>& name) {
  if (!name) return std::nullopt;
  if (*name == "bone") return Convention::bone;
  if (*name == "joint") return Convention::joint;
  throw InputError("the convention is \"" + *name + "\"; expected \"bone\" or \"joint\"");
}

const char* convention_name(Convention convention) { return convention == Convention::bone ? "bone" : "joint"; }

QuaternionOrder order_of(const std::string& name) {
  if (name == "wxyz") return QuaternionOrder::wxyz;
  if (name == "xyzw") return QuaternionOrder::xyzw;
  throw InputError("the quaternion order is \"" + name + "\"; expected \"wxyz\" or \"xyzw\"");
}

Eigen::MatrixXd copied_table(const char* name, const py::array& array) {
  require_shape(name, array, "(rows, columns)");
  const std::vector<double> numbers = copied<double>(name, array);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return RowMajor::Map(numbers.data(), array.shape(0), array.shape(1));
}

Eigen::MatrixX3d copied_row_points(const char* name, const py::array& array) {
  require_shape(name, array, "(J, 3)");
  return copied_table(name, array);
}

/// Moves a matrix into an array that numpy owns.
py::array moved(Eigen::MatrixXd&& matrix) {
  auto* owned = new Eigen::MatrixXd(std::move(matrix));
  const py::capsule owner(owned, [](void* p) { delete static_cast<Eigen::MatrixXd*>(p); });
  return py::array(py::dtype::of<double>(), {owned->rows(), owned->cols()},
                   {static_cast<py::ssize_t>(sizeof(double)), static_cast<py::ssize_t>(sizeof(double)) * owned->rows()},
                   owned->data(), owner);
}

Rig rig_from_arrays(const py::array& positions, const py::array& face_offsets, const py::array& face_vertices,
                    const RigSkeleton& skeleton, const py::array& weights, const std::optional<PoseClip>& poses,
                    const std::optional<py::array>& animation, const std::optional<py::array>& face_materials,
                    const std::vector<std::string>& material_names, const std::string& material_library) {
  Rig rig{PolygonMesh{}, skeleton, copied_table("weights", weights), poses, std::nullopt};
  PolygonMesh& mesh = rig.mesh;
  mesh.positions = points_of<float>("positions", positions);
  mesh.face_offsets = list_of<std::int32_t>("face_offsets", face_offsets);
  mesh.face_vertices = list_of<std::int32_t>("face_vertices", face_vertices);
  if (face_materials) {
    mesh.face_materials = list_of<std::int32_t>("face_materials", *face_materials);
  }
  mesh.material_names = material_names;
  mesh.material_library = material_library;
  if (animation) {
    auto matrices = copied_matrices("animation", *animation, "(F, J, 4, 4)");
    rig.animation = MatrixClip{animation->shape(0), std::move(matrices)};
  }
  check_rig(rig);
  return rig;
}

void bind_rig_skeleton(py::module_& module) {
  py::class_<RigSkeleton, Skeleton>(
      module, "RigSkeleton",
      "A skeleton as a .bf or .tgf file describes it: a Skeleton whose rest transforms are "
      "translations, with a bone to draw and a column of weights for each joint.")
      .def(py::init([](const py::array& parents, const py::array& heads, const py::array& tails,
                       const py::array& weight_columns, std::vector<std::string> names, const std::string& convention) {
             return RigSkeleton(list_of<std::int32_t>("parents", parents), copied_row_points("heads", heads),
                                copied_row_points("tails", tails),
                                list_of<std::int32_t>("weight_columns", weight_columns), std::move(names),
                                *convention_of(convention));
           }),
           py::arg("parents"), py::arg("heads"), py::arg("tails"), py::arg("weight_columns"),
           py::arg("names") = std::vector<std::string>(), py::arg("convention") = "joint",
           "parents: (J,) integers, each joint's parent, -1 for a root; a parent may come after "
           "its child.\n"
           "heads: (J, 3), world: where each joint turns, the translation of A(j).\n"
           "tails: (J, 3), world: where its bone is drawn to.\n"
           "weight_columns: (J,) integers, the joint's column of weights, or -1; no column may "
           "belong to two joints.\n"
           "names: J unique names; if empty, they are made from the joints' numbers.\n"
           "convention: \"joint\", a row of the file stands for a joint and turns about it; or "
           "\"bone\", for the bone that ends there and turns about the parent's place.\n"
           "Raises ValueError if the parts do not fit each other, for a cycle, and for a number that is not finite.")
      .def_property_readonly(
          "heads", [](py::object self) { return view_matrix(self.cast<const RigSkeleton&>().heads(), self); },
          "(J, 3) float64, read-only, world: where each joint turns.")
      .def_property_readonly(
          "tails", [](py::object self) { return view_matrix(self.cast<const RigSkeleton&>().tails(), self); },
          "(J, 3) float64, read-only, world: where its bone is drawn to.")
      .def_property_readonly(
          "weight_columns",
          [](py::object self) { return view_list(self.cast<const RigSkeleton&>().weight_columns(), self); },
          "(J,) int32, read-only: the joint's column of weights, or -1.")
      .def_property_readonly("names", &RigSkeleton::names, "J unique names.")
      .def_property_readonly(
          "convention", [](const RigSkeleton& self) { return convention_name(self.convention()); },
          "\"bone\" or \"joint\".");
}

void bind_rig(py::module_& module) {
  py::class_<Rig>(module, "Rig", "Mesh, skeleton, weights and poses that belong together.")
      .def(py::init(&rig_from_arrays), py::arg("positions"), py::arg("face_offsets"), py::arg("face_vertices"),
           py::arg("skeleton"), py::arg("weights"), py::arg("poses") = py::none(), py::arg("animation") = py::none(),
           py::arg("face_materials") = py::none(), py::arg("material_names") = std::vector<std::string>(),
           py::arg("material_library") = "",
           "positions: (V, 3), rest positions.\n"
           "face_offsets: (faces + 1,) integers, where each face's vertices begin.\n"
           "face_vertices: (C,), vertex numbers, face after face.\n"
           "skeleton: J joints.\n"
           "weights: (V, columns), a column for each joint that has a weight column.\n"
           "poses: of J joints, or None.\n"
           "animation: (F, J, 4, 4), skinning matrices, or None.\n"
           "face_materials: (faces,) integers into material_names, -1 for none; or None.\n"
           "material_names: in order of first use.\n"
           "material_library: the file that describes the materials, or an empty string.\n"
           "Raises ValueError if the parts do not fit each other.")
      .def_property_readonly(
          "positions",
          [](py::object self) {
            const auto& mesh = self.cast<const Rig&>().mesh;
            return view(mesh.positions.data(), {mesh.vertex_count(), 3}, {3, 1}, self);
          },
          "(V, 3) float32, read-only: rest positions.")
      .def_property_readonly(
          "face_offsets", [](py::object self) { return view_list(self.cast<const Rig&>().mesh.face_offsets, self); },
          "(faces + 1,) int32, read-only: where each face's vertices begin.")
      .def_property_readonly(
          "face_vertices", [](py::object self) { return view_list(self.cast<const Rig&>().mesh.face_vertices, self); },
          "int32, read-only: vertex numbers, face after face.")
      .def_property_readonly(
          "face_materials",
          [](py::object self) { return view_list(self.cast<const Rig&>().mesh.face_materials, self); },
          "(faces,) int32, read-only: index into material_names, or -1. Empty if the file has no materials.")
      .def_property_readonly(
          "material_names", [](const Rig& self) { return self.mesh.material_names; }, "In order of first use.")
      .def_property_readonly(
          "material_library", [](const Rig& self) { return self.mesh.material_library; },
          "The file that describes the materials, or an empty string.")
      .def_property_readonly(
          "skeleton", [](const Rig& self) -> const RigSkeleton& { return self.skeleton; },
          py::return_value_policy::reference_internal, "The RigSkeleton.")
      .def_property_readonly(
          "weights", [](py::object self) { return view_matrix(self.cast<const Rig&>().weights, self); },
          "(V, columns) float64, read-only: column c belongs to the joint whose weight column is "
          "c.")
      .def_property_readonly(
          "clamped_weights", [](const Rig& self) { return self.clamped_weights; },
          "How many weights of the file were below 0 or above 1, see read_rig.")
      .def_property_readonly(
          "poses", [](const Rig& self) { return self.poses; }, "PoseClip, or None.")
      .def_property_readonly(
          "animation",
          [](py::object self) -> py::object {
            const auto& animation = self.cast<const Rig&>().animation;
            if (!animation) return py::none();
            const py::array flat = view_matrices(animation->matrices, self);
            const py::ssize_t joints = self.cast<const Rig&>().skeleton.joint_count();
            return flat.attr("reshape")(animation->frames, joints, 4, 4);
          },
          "(F, J, 4, 4) float64, read-only: skinning matrices, or None.");
}

/// Weights by the bones of the joints that have a column, V x columns.
Eigen::MatrixXd weights_from_bones(const PolygonMesh& mesh, const RigSkeleton& skeleton) {
  std::vector<double> heads, tails;
  std::vector<std::int32_t> columns;
  for (std::ptrdiff_t j = 0; j < skeleton.joint_count(); ++j) {
    if (skeleton.weight_columns()[j] < 0) continue;
    columns.push_back(skeleton.weight_columns()[j]);
    for (int axis = 0; axis < 3; ++axis) {
      heads.push_back(skeleton.heads()(j, axis));
      tails.push_back(skeleton.tails()(j, axis));
    }
  }
  if (columns.empty()) throw InputError("no joint has a column of weights, so none can be made from the bones");
  const std::int32_t last = *std::ranges::max_element(columns);
  if (last >= std::ssize(columns)) {
    throw InputError("a joint has weight column " + std::to_string(last) + "; expected 0 to " +
                     std::to_string(columns.size() - 1) + ", since that many joints have one");
  }
  const std::vector<double> positions(mesh.positions.begin(), mesh.positions.end());
  const auto made = automatic_weights(positions, mesh.face_offsets, mesh.face_vertices, {heads, tails, columns});
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(mesh.vertex_count(), last + 1);
  for (std::ptrdiff_t v = 0; v < mesh.vertex_count(); ++v) {
    for (const auto& [joint, weight] : made->weights.row(v)) weights(v, joint) = weight;
  }
  return weights;
}

Rig py_read_rig(const Path& folder, const std::optional<Path>& skeleton, const std::optional<Path>& mesh,
                const std::optional<Path>& weights, const std::optional<Path>& pose,
                const std::optional<std::string>& convention, const std::string& quaternion_order) {
  RigPaths paths = find_rig(folder);
  if (skeleton) paths.skeleton = folder / *skeleton;
  if (mesh) paths.mesh = folder / *mesh;
  const bool is_made = weights == Path("auto");
  if (weights && !is_made) paths.weights = folder / *weights;
  if (pose) paths.poses = folder / *pose;
  return read_rig(paths, convention_of(convention), order_of(quaternion_order),
                  is_made ? WeightsMaker(weights_from_bones) : WeightsMaker());
}

void py_write_rig(const Path& folder, const Rig& rig, const Path& skeleton) {
  write_rig(
      {folder / "mesh.obj", folder / skeleton, folder / "weights.dmat", folder / "pose.dmat", folder / "anim.dmat"},
      rig);
}

}  // namespace

void bind_files(py::module_& module) {
  module.def(
      "read_dmat",
      [](const Path& path) {
        Eigen::MatrixXd matrix;
        {
          const py::gil_scoped_release release;
          matrix = read_dmat(path);
        }
        return moved(std::move(matrix));
      },
      py::arg("path"),
      "Reads a .dmat file, text or binary, as float64 (rows, columns). Raises ValueError, naming the "
      "file, if it cannot be read.");
  module.def(
      "write_dmat",
      [](const Path& path, const py::array& array, bool binary) {
        const Eigen::MatrixXd matrix = copied_table("array", array);
        const py::gil_scoped_release release;
        write_dmat(path, matrix, binary);
      },
      py::arg("path"), py::arg("array"), py::arg("binary") = false,
      "Writes a file that read_dmat reads back bit for bit.\n\n"
      "array: (rows, columns), real numbers, written as float64.\n"
      "binary: as little-endian float64 instead of text.\n"
      "Raises ValueError if the file cannot be written.");
  bind_rig_skeleton(module);
  bind_rig(module);
  module.def(
      "read_skeleton",
      [](const Path& path, const std::optional<std::string>& convention) {
        return read_skeleton(path, convention_of(convention));
      },
      py::call_guard<py::gil_scoped_release>(), py::arg("path"), py::arg("convention") = py::none(),
      "Reads a .bf or .tgf file as a RigSkeleton.\n\n"
      "convention: \"bone\" or \"joint\" overrides the one that a .bf file indicates (\"bone\" if the "
      "weight index of a root is -1); a .tgf file is always \"bone\".\n"
      "Raises ValueError, naming file and line, for what cannot be read.");
  module.def("write_skeleton", &write_skeleton, py::call_guard<py::gil_scoped_release>(), py::arg("path"),
             py::arg("skeleton"),
             "Writes a .bf or .tgf file, depending on the path's ending. Raises ValueError if the format cannot hold "
             "the skeleton or the file cannot be written.");
  module.def("read_rig", &py_read_rig, py::call_guard<py::gil_scoped_release>(), py::arg("folder"), py::kw_only(),
             py::arg("skeleton") = py::none(), py::arg("mesh") = py::none(), py::arg("weights") = py::none(),
             py::arg("pose") = py::none(), py::arg("convention") = py::none(), py::arg("quaternion_order") = "wxyz",
             "Reads a rig folder: mesh.obj, weights.dmat, skeleton.bf or skeleton.tgf and, if they "
             "exist, pose.dmat and anim.dmat. Weights below 0 or above 1, which Blender's vertex groups "
             "cannot hold, become 0 or 1, and the weights of their vertices are divided by their sum; clamped_weights "
             "is how many there were. (read_dmat returns the weights as they are in the file.)\n\n"
             "skeleton, mesh, weights, pose: other names for the files, relative to the folder. weights=\"auto\": made "
             "from the bones by automatic_weights, instead of read.\n"
             "convention: as in read_skeleton.\n"
             "quaternion_order: \"wxyz\" or \"xyzw\", of the pose file; Euler angles in it are "
             "degrees.\n"
             "Raises ValueError, naming the file, for what cannot be read or does not fit the other "
             "files.");
  module.def("write_rig", &py_write_rig, py::call_guard<py::gil_scoped_release>(), py::arg("folder"), py::arg("rig"),
             py::kw_only(), py::arg("skeleton") = "skeleton.bf",
             "Writes a rig into an existing folder, under the names that read_rig looks for.\n\n"
             "skeleton: the name of its file, ending in .bf or .tgf.\n"
             "Raises ValueError if the format cannot hold the skeleton or a file cannot be "
             "written.");
}

}  // namespace sinew::bindings
