#include <pybind11/stl.h>

#include <memory>
#include <optional>

#include "arrays.h"
#include "given_weights.h"
#include "interruptible.h"
#include "sinew/decompose.h"

namespace sinew::bindings {
namespace {

std::shared_ptr<Decomposition> decomposed(const py::array& rest, const py::array& frames, const py::array& face_offsets,
                                          const py::array& face_vertices, std::int32_t bones,
                                          const std::optional<py::array>& heads,
                                          const std::optional<py::array>& matrices, const py::object& weights,
                                          const DecompositionSettings& settings, OrNone<Progress> progress) {
  require_shape("frames", frames, "(F, V, 3)");
  const Numbers<float> own_rest = points_of<float>("rest", rest);
  if (frames.shape(1) != rest.shape(0)) {
    throw InputError("frames has " + std::to_string(frames.shape(1)) + " vertices in each frame, rest has " +
                     std::to_string(rest.shape(0)) + "; expected the same vertices in the same order");
  }
  const Numbers<float> own_frames("frames", frames);
  const std::vector<std::int32_t> offsets = list_of<std::int32_t>("face_offsets", face_offsets);
  const std::vector<std::int32_t> corners = list_of<std::int32_t>("face_vertices", face_vertices);
  DecompositionStart start;
  if (bones < 0) throw InputError("bones is " + std::to_string(bones) + "; expected one at least");
  start.joint_count = bones;
  std::vector<double> own_heads;
  if (heads) own_heads = points_of<double>("heads", *heads);
  start.heads = own_heads;
  std::vector<Matrix4<double>> own_matrices;
  if (matrices) {
    own_matrices = copied_matrices("matrices", *matrices, "(F, J, 4, 4)");
    if (matrices->shape(0) != frames.shape(0)) {
      throw InputError("matrices has " + std::to_string(matrices->shape(0)) + " frames, frames has " +
                       std::to_string(frames.shape(0)));
    }
    if (own_matrices.empty()) throw InputError("matrices has no joints; expected one at least");
  }
  start.matrices = own_matrices;
  if (!weights.is_none()) start.weights = *given_table("weights", weights, "(V, J)");
  return interruptible(progress, [&](Progress* own) {
    auto made = decompose({own_rest, own_frames, offsets, corners}, start, settings, own);
    return made ? std::make_shared<Decomposition>(std::move(*made)) : nullptr;
  });
}

template <auto member>
py::array decomposition_list(const py::object& self) {
  return view_list(self.cast<const Decomposition&>().*member, self);
}

py::array decomposition_poses(const py::object& self) {
  const auto& made = self.cast<const Decomposition&>();
  const auto joints = made.joint_count();
  const auto frames = std::ssize(made.poses) / joints;
  return view(made.poses.front().data(), {frames, joints, 4, 4}, {16 * joints, 16, 1, 4}, self);
}

}  // namespace

void bind_decompose(py::module_& module) {
  py::class_<Decomposition, std::shared_ptr<Decomposition>> bound(
      module, "Decomposition", "Joints, weights and motions that play a deformation, from decompose. Immutable.");
  bind_entries(bound, "joints", ", with sum 1 at each vertex; given ones as they were.");
  bound.def_property_readonly("joint_count", &Decomposition::joint_count, "J.")
      .def_property_readonly(
          "rest", [](const py::object& self) { return view_matrices(self.cast<const Decomposition&>().rest, self); },
          "(J, 4, 4), read-only: the joints at rest, unturned, at `heads` or in the middle of what they move.")
      .def_property_readonly(
          "poses", &decomposition_poses,
          "(F, J, 4, 4), read-only: skinning matrices. poses[f, j] @ rest[j] is the joint in frame f.")
      .def_readonly(
          "rms", &Decomposition::rms,
          "The root of the mean square distance between what skinning gives and the frames, over all vertices "
          "and frames, in the unit of the positions.")
      .def_readonly("mean", &Decomposition::mean, "The mean distance.")
      .def_readonly("largest", &Decomposition::largest, "The largest distance.")
      .def_property_readonly("vertex_rms", &decomposition_list<&Decomposition::vertex_rms>,
                             "(V,) float32, read-only: of each vertex, over the frames.")
      .def_property_readonly("vertex_largest", &decomposition_list<&Decomposition::vertex_largest>,
                             "(V,) float32, read-only: the largest distance of each vertex.")
      .def_readonly("iterations", &Decomposition::iterations, "How many were done.");

  module.def(
      "decompose",
      [](const py::array& rest, const py::array& frames, const py::array& face_offsets, const py::array& face_vertices,
         std::int32_t bones, const std::optional<py::array>& heads, const std::optional<py::array>& matrices,
         const py::object& weights, int max_influences, int iterations, double smoothing, bool local, double tolerance,
         OrNone<Progress> progress) {
        return decomposed(rest, frames, face_offsets, face_vertices, bones, heads, matrices, weights,
                          {max_influences, iterations, smoothing, local, tolerance}, progress);
      },
      py::arg("rest"), py::arg("frames"), py::arg("face_offsets"), py::arg("face_vertices"), py::kw_only(),
      py::arg("bones") = 0, py::arg("heads") = py::none(), py::arg("matrices") = py::none(),
      py::arg("weights") = py::none(), py::arg("max_influences") = 8, py::arg("iterations") = 30,
      py::arg("smoothing") = 1e-4, py::arg("local") = true, py::arg("tolerance") = 1e-3,
      py::arg("progress") = py::none(),
      "Smooth skinning decomposition: finds joints and weights whose linear skinning plays a deformation, such as a "
      "vertex cache, cloth or Direct Delta Mush.\n\n"
      "Minimizes sum |x_fv - sum_j w_vj M_fj u_v|^2 over rigid motions M and over weights w, which are not negative "
      "and "
      "sum to 1, in turns (Le and Deng 2012). A motion is a weighted Procrustes problem, the weights of a vertex are "
      "least "
      "squares on a simplex. Weights are kept smooth by a term smoothing F size^2 |w - w*|^2, where w* = (I + L)^-1 w, "
      "L "
      "counts neighbors by how little the distance to them changes (Le and Deng 2014), and size is the root mean "
      "square "
      "distance from the centroid. Parts that no face connects are tied where they are nearest; coincident vertices "
      "that "
      "move alike get equal weights.\n\n"
      "rest: (V, 3), the mesh at rest.\n"
      "frames: (F, V, 3), the same vertices in each frame, in the same space and unit. One frame at least.\n"
      "face_offsets: (faces + 1,) integers, where the corners of each face begin; empty: there are no faces.\n"
      "face_vertices: (C,) integers, the vertices around each face, face after face.\n"
      "Exactly one of these says what is known:\n"
      "bones: at most so many joints are found, up to 2,048, with weights and motions. Fewer if fewer give the frames "
      "exactly.\n"
      "heads: (J, 3), where joints begin: each vertex belongs to the nearest one, then weights and motions are found. "
      "Together with matrices or weights: only the positions in `rest` of the result.\n"
      "matrices: (F, J, 4, 4), skinning matrices of any kind: weights for them are found.\n"
      "weights: (V, J), 0 or more, a WeightTable or a Skin: rigid motions for these weights are found.\n\n"
      "max_influences: 1 to 64, the most weights of a vertex. Those go that raise its error least.\n"
      "iterations: 1 to 10,000, how many at most.\n"
      "smoothing: 0 to 1, see above.\n"
      "local: vertices follow only joints that move something near them. False: any joint is tried at every vertex, "
      "for "
      "less error with more influences and time.\n"
      "tolerance: 0 to 1, ends when three iterations one after the other lower the error by less than this share.\n"
      "progress: a Progress that another thread watches, or None. If it is cancelled, None is returned. Ctrl C cancels "
      "it, too. rest and frames must not change meanwhile.\n"
      "Returns a Decomposition: the same bits for any number of threads. Raises ValueError for sizes that do not fit, "
      "vertices that do not exist, numbers that are not finite, settings out of range, and if nothing or too much is "
      "known.");
}

}  // namespace sinew::bindings
