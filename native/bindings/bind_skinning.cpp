#include <pybind11/stl.h>

#include <memory>
#include <optional>

#include "arrays.h"
#include "methods.h"
#include "sinew/group_influences.h"
#include "sinew/skinning.h"
#include "skinned.h"

namespace sinew::bindings {
namespace {

py::array linear(const Skin& skin, const py::array& matrices, const py::object& out) {
  return skinned(skin, matrices, out, [&](auto stack, auto positions) { skin_linear(skin, stack, positions); });
}

py::array dual_quaternion(const Skin& skin, const py::array& matrices, const py::object& out,
                          const std::string& stretch, const std::optional<py::array>& rest_frames) {
  std::vector<Matrix4<double>> frames;
  if (rest_frames) frames = copied_matrices("rest_frames", *rest_frames, "(J, 4, 4)");
  const StretchRule rule{stretch_named(stretch), frames};
  return skinned(skin, matrices, out,
                 [&](auto stack, auto positions) { skin_dual_quaternion(skin, stack, positions, rule); });
}

std::shared_ptr<Skin> make_skin(const py::array& rest_positions, const py::array& offsets, const py::array& joints,
                                const py::array& weights, std::ptrdiff_t joint_count) {
  check_counts(rest_positions.size() / 3, joints.size(), joint_count);
  const auto points = points_of<float>("rest_positions", rest_positions);
  const auto first = list_of<std::int64_t>("offsets", offsets);
  const auto numbers = list_of<std::int32_t>("joints", joints);
  const auto shares = list_of<float>("weights", weights);
  const py::gil_scoped_release release;
  return std::make_shared<Skin>(points, first, numbers, shares, joint_count);
}

std::shared_ptr<Skin> skin_of_state(const py::tuple& state) {
  if (state.size() != 5 || !py::isinstance<py::int_>(state[4])) throw InputError("this is not the state of a Skin");
  const auto array = [&](const char* name, int i) { return given_array(name, state[i]); };
  return make_skin(array("rest_positions", 0), array("offsets", 1), array("joints", 2), array("weights", 3),
                   state[4].cast<std::ptrdiff_t>());
}

void skin_jobs(const std::vector<py::tuple>& tuples) {
  std::vector<SkinningJob> jobs;
  std::vector<std::vector<Matrix4<double>>> rest_frames(tuples.size());
  for (const py::tuple& tuple : tuples) {
    const std::string where = "job " + std::to_string(jobs.size());
    try {
      if (tuple.size() != 4 && tuple.size() != 6 && tuple.size() != 7) {
        throw InputError("expected (skin, matrices, out, method[, stretch, rest_frames[, data]])");
      }
      const auto& skin = tuple[0].cast<const Skin&>();
      const py::array matrices = given_array("matrices", tuple[1]);
      const auto stack = matrix_stack<const float>("matrices", matrices);
      const std::span<float> positions =
          written_span<float>("out", given_array("out", tuple[2]), positions_shape(skin, matrices));
      SkinningJob job{&skin, stack, positions, method_named(tuple[3].cast<std::string>()), {}};
      if (tuple.size() > 4) {
        auto& frames = rest_frames[jobs.size()];
        if (!tuple[5].is_none())
          frames = copied_matrices("rest_frames", given_array("rest_frames", tuple[5]), "(J, 4, 4)");
        job.rule = {stretch_named(tuple[4].cast<std::string>()), frames};
      }
      if (tuple.size() == 7) job.data = tuple[6].cast<const MethodData*>();
      jobs.push_back(job);
    } catch (const py::cast_error&) {
      throw py::type_error(where + ": expected (Skin, array, array, str[, str, array[, MethodData]])");
    } catch (const InputError& error) {
      throw InputError(where + ": " + error.what());
    }
  }
  const py::gil_scoped_release release;
  skin_all(jobs);
}

py::tuple influences_of_groups(const py::array& offsets, const py::array& groups, const py::array& weights,
                               const py::array& joint_of_group, bool normalize) {
  const auto first = list_of<std::int64_t>("offsets", offsets);
  const auto numbers = list_of<std::int32_t>("groups", groups);
  const auto shares = list_of<float>("weights", weights);
  const std::vector<std::int32_t> joints = list_of<std::int32_t>("joint_of_group", joint_of_group);
  GroupInfluences own;
  {
    const py::gil_scoped_release release;
    own = group_influences(first, numbers, shares, joints, normalize);
  }
  const auto count = std::ssize(own.joints);
  return py::make_tuple(given_away(std::move(own.offsets), {offsets.shape(0)}),
                        given_away(std::move(own.joints), {count}), given_away(std::move(own.weights), {count}),
                        own.unweighted_count, own.unnormalized_count);
}

}  // namespace

void bind_skinning(py::module_& module) {
  py::class_<Skin, std::shared_ptr<Skin>>(
      module, "Skin", "The mesh at rest and what moves each vertex. Immutable except for set_rest_positions.")
      .def(py::init(&make_skin), py::arg("rest_positions"), py::arg("offsets"), py::arg("joints"), py::arg("weights"),
           py::arg("joint_count"),
           "rest_positions: (V, 3), space of the mesh.\n"
           "offsets: (V + 1,) integers; vertex v has the influences offsets[v] up to "
           "offsets[v + 1].\n"
           "joints: (N,) integers, each in 0 to J - 1.\n"
           "weights: (N,), used as they are; those of a vertex should sum to 1.\n"
           "joint_count: J, how many matrices a frame has.\n"
           "All influences are kept, in their order. A vertex without any, or with only zeros, stays at rest.\n"
           "Raises ValueError for sizes that do not fit, a joint that does not exist, a number "
           "that is not finite.")
      .def(py::pickle(
          [](const py::object& self) {
            return py::make_tuple(self.attr("rest_positions"), self.attr("offsets"), self.attr("joints"),
                                  self.attr("weights"), self.attr("joint_count"));
          },
          &skin_of_state))
      .def_static("from_dense", &skin_from_dense, py::arg("rest_positions"), py::arg("weights"),
                  "A skin from a dense table of weights.\n\n"
                  "rest_positions: (V, 3), space of the mesh.\n"
                  "weights: (V, J), column j for joint j; exact zeros are left out.\n"
                  "Raises ValueError as the constructor does.")
      .def_property_readonly("vertex_count", &Skin::vertex_count, "V.")
      .def_property_readonly("joint_count", &Skin::joint_count, "J.")
      .def_property_readonly("influence_count", &Skin::influence_count, "N.")
      .def_property_readonly("most_influences", &Skin::most_influences, "The most influences that a vertex has.")
      .def_property_readonly("unweighted_count", &Skin::unweighted_count, "How many vertices nothing moves.")
      .def_property_readonly("largest_sum_error", &Skin::largest_sum_error,
                             "The largest |sum of weights - 1| of a vertex that something moves.")
      .def_property_readonly(
          "rest_positions",
          [](py::object self) {
            const auto& skin = self.cast<const Skin&>();
            return view(skin.rest_positions().data(), {skin.vertex_count(), 3}, {3, 1}, self);
          },
          "(V, 3) float32, read-only, space of the mesh.")
      .def_property_readonly(
          "offsets", [](py::object self) { return view_list(self.cast<const Skin&>().offsets(), self); },
          "(V + 1,) int64, read-only: where each vertex's influences begin.")
      .def_property_readonly(
          "joints", [](py::object self) { return view_list(self.cast<const Skin&>().joints(), self); },
          "(N,) int32, read-only.")
      .def_property_readonly(
          "weights", [](py::object self) { return view_list(self.cast<const Skin&>().weights(), self); },
          "(N,) float32, read-only.")
      .def(
          "set_rest_positions",
          [](Skin& self, const py::array& positions) {
            const auto points = points_of<float>("positions", positions);
            const py::gil_scoped_release release;
            self.set_rest_positions(points);
          },
          py::arg("positions"),
          "Sets another rest shape, for example after a change of shape keys; influences stay. Do not call it while "
          "another thread skins with it.\n\n"
          "positions: (V, 3), space of the mesh; copied.\n"
          "Raises ValueError, and changes nothing, for another number of vertices or a number that "
          "is not finite.")
      .def("__repr__", [](const Skin& self) {
        return "<Skin of " + std::to_string(self.vertex_count()) + " vertices, " + std::to_string(self.joint_count()) +
               " joints, " + std::to_string(self.influence_count()) + " influences>";
      });

  module.def("group_influences", &influences_of_groups, py::arg("offsets"), py::arg("groups"), py::arg("weights"),
             py::arg("joint_of_group"), py::arg("normalize") = true,
             "Converts weights of vertex groups to influences, as Blender's Armature modifier does.\n\n"
             "offsets: (V + 1,) integers; vertex v has the entries offsets[v] up to offsets[v + 1].\n"
             "groups: (M,) integers, the group of each entry; one that does not exist moves nothing.\n"
             "weights: (M,).\n"
             "joint_of_group: (G,) integers, the joint of each group, negative if it moves nothing.\n"
             "normalize: weights of groups that move something are divided by their sum; False: they stay as they "
             "are, for dual quaternions, whose sums are divided anyway.\n"
             "Zeros are left out, and a vertex whose weights sum to 1e-4 or less stays at rest.\n"
             "Returns offsets (V + 1,) int64, joints (N,) int32 and weights (N,) float32, as Skin takes them; how many "
             "vertices no joint moves; and of how many the weights, as given, are more than 0.05 from a sum of 1.\n"
             "Raises ValueError for sizes that do not fit.");
  module.def(
      "skin_linear", &linear, py::arg("skin"), py::arg("matrices"), py::arg("out") = py::none(),
      (std::string("Linear blend skinning: v' = sum_j w_j M(j) v.\n\n") + kSkinArguments + kSkinReturns).c_str());
  module.def("skin_dual_quaternion", &dual_quaternion, py::arg("skin"), py::arg("matrices"),
             py::arg("out") = py::none(), py::arg("stretch") = "polar", py::arg("rest_frames") = py::none(),
             (std::string("Dual quaternion skinning (Kavan et al. 2008).\n\n") + kSkinArguments +
              "stretch: what happens to scale and shear: \"polar\", decomposed and blended "
              "linearly; \"frame\", along the axes of the joint's rest frame, as Blender 3.4 does; "
              "\"frame_each\", each joint on its own, as Blender 4.0 and later do.\n"
              "rest_frames: with \"frame\" and \"frame_each\", (J, 4, 4): each joint's rest transform relative to the "
              "space of the mesh, without scale; None with \"polar\".\n" +
              kSkinReturns)
                 .c_str());
  module.def("skin_all", &skin_jobs, py::arg("jobs"),
             "Skins several meshes at once, with all threads working on all of them.\n\n"
             "jobs: tuples (skin, matrices, out, method), optionally followed by stretch and rest_frames (for dual "
             "quaternions), and then by data. matrices and out are as in skin_linear, but out is not None; method and "
             "data are as in Layer.\n"
             "The same bits as one call per job. Raises ValueError, and writes nothing, if a shape or dtype "
             "does not fit or two results overlap.");
}

}  // namespace sinew::bindings
