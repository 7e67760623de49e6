#include <pybind11/stl.h>

#include <memory>

#include "arrays.h"
#include "interruptible.h"
#include "sinew/skinning.h"
#include "skinned.h"

namespace sinew::bindings {
namespace {

LaplacianKind laplacian_named(const std::string& name) {
  if (name == "cotangent") return LaplacianKind::cotangent;
  if (name == "uniform") return LaplacianKind::uniform;
  throw InputError("there is no laplacian \"" + name + "\"; expected cotangent or uniform");
}

std::shared_ptr<DirectDeltaMush> compute(const std::shared_ptr<Skin>& skin, const py::array& face_offsets,
                                         const py::array& face_vertices, double smoothing, double weight_smoothing,
                                         double blend, int iterations, const std::string& laplacian, int variant,
                                         double prune, const OrNone<Progress>& progress) {
  const std::vector<std::int32_t> offsets = list_of<std::int32_t>("face_offsets", face_offsets);
  const std::vector<std::int32_t> corners = list_of<std::int32_t>("face_vertices", face_vertices);
  const MushSettings settings{smoothing, weight_smoothing, blend, iterations, laplacian_named(laplacian), variant,
                              prune};
  return interruptible(progress,
                       [&](Progress* own) { return DirectDeltaMush::compute(skin, offsets, corners, settings, own); });
}

std::shared_ptr<DirectDeltaMush> from_dense(const py::array& rest_positions, const py::array& face_offsets,
                                            const py::array& face_vertices, const py::array& weights, double smoothing,
                                            double weight_smoothing, double blend, int iterations,
                                            const std::string& laplacian, int variant, double prune) {
  return compute(skin_from_dense(rest_positions, weights), face_offsets, face_vertices, smoothing, weight_smoothing,
                 blend, iterations, laplacian, variant, prune, std::nullopt);
}

py::dict arrays_of(const DirectDeltaMush& mush) {
  MushArrays arrays;
  {
    const py::gil_scoped_release release;
    arrays = mush.arrays();
  }
  const auto vertices = mush.vertex_count(), entries = std::ssize(arrays.joints);
  const py::ssize_t width = MushArrays::width_of(arrays.variant);
  py::dict result;
  result["variant"] = arrays.variant;
  result["pruned"] = arrays.pruned;
  result["offsets"] = given_away(std::move(arrays.offsets), {vertices + 1});
  result["joints"] = given_away(std::move(arrays.joints), {entries});
  result["omega"] = given_away(std::move(arrays.omega), {entries, width});
  result["centers"] = given_away(std::move(arrays.centers), {vertices, 3});
  result["scales"] = given_away(std::move(arrays.scales), {vertices});
  return result;
}

std::shared_ptr<DirectDeltaMush> from_arrays(std::shared_ptr<Skin> skin, int variant, double pruned,
                                             const py::array& offsets, const py::array& joints, const py::array& omega,
                                             const py::array& centers, const py::array& scales) {
  require_shape("omega", omega, "(N, 10), (N, 4) or (N, 1)");
  const MushArrays arrays{list_of<std::int64_t>("offsets", offsets),
                          list_of<std::int32_t>("joints", joints),
                          Numbers<float>("omega", omega),
                          points_of<float>("centers", centers),
                          list_of<float>("scales", scales),
                          variant,
                          pruned};
  const py::gil_scoped_release release;
  return std::make_shared<DirectDeltaMush>(std::move(skin), arrays);
}

py::array direct_delta_mush(const DirectDeltaMush& mush, const py::array& matrices, const py::object& out) {
  return skinned(*mush.skin(), matrices, out,
                 [&](auto stack, auto positions) { skin_direct_delta_mush(mush, stack, positions); });
}

constexpr const char* kFaces =
    "face_offsets: (faces + 1,) integers, where the corners of each face begin.\n"
    "face_vertices: (C,) integers, the vertices around each face, face after face; a polygon counts as a fan of "
    "triangles.\n";

constexpr const char* kSettings =
    "smoothing: lambda, 0 to 1,000, how strongly each iteration smooths the shape.\n"
    "weight_smoothing: kappa, 0 to 1,000, the same for the weights that `blend` uses.\n"
    "blend: alpha, 0 to 1, how much of the translation comes from smoothed weights alone.\n"
    "iterations: p, 0 to 1,000, how many times both are smoothed; 0 is linear skinning.\n"
    "laplacian: \"cotangent\", or \"uniform\" for edges that all count the same.\n"
    "variant: what is kept. 0: ten numbers per vertex and joint, the full method. 1: ten, turned by the inverse "
    "transpose of the deformation, which shears. 2: four, turned by blended quaternions, so that translations of "
    "joints no longer turn the surface. 3: four, by blended matrices. 4: one, turned as 2 about the smoothed rest "
    "position. 5: one, linear skinning by the smoothed weights.\n"
    "prune: 0 to 1: for each vertex, joints are left out that together move it by less than this fraction of the "
    "spread of its joints' motions.\n";

}  // namespace

void bind_direct_delta_mush(py::module_& module) {
  py::class_<DirectDeltaMush, MethodData, std::shared_ptr<DirectDeltaMush>>(
      module, "DirectDeltaMush",
      "Direct delta mush (Le and Lewis 2019): a skin prepared for skin_direct_delta_mush and for the method "
      "\"direct_delta_mush\". Immutable.")
      .def(py::init(&from_dense), py::arg("rest_positions"), py::arg("face_offsets"), py::arg("face_vertices"),
           py::arg("weights"), py::arg("smoothing") = 3.0, py::arg("weight_smoothing") = 1.0, py::arg("blend") = 0.8,
           py::arg("iterations") = 20, py::arg("laplacian") = "cotangent", py::arg("variant") = 0,
           py::arg("prune") = 1e-5,
           (std::string("rest_positions: (V, 3), space of the mesh.\n") + kFaces +
            "weights: (V, J), column j for joint j.\n" + kSettings +
            "Takes seconds for large meshes. Raises ValueError for sizes that do not fit, a vertex that does not "
            "exist, a setting out of range, a number that is not finite.")
               .c_str())
      .def_static("compute", &compute, py::arg("skin"), py::arg("face_offsets"), py::arg("face_vertices"),
                  py::arg("smoothing") = 3.0, py::arg("weight_smoothing") = 1.0, py::arg("blend") = 0.8,
                  py::arg("iterations") = 20, py::arg("laplacian") = "cotangent", py::arg("variant") = 0,
                  py::arg("prune") = 1e-5, py::arg("progress") = py::none(),
                  (std::string("The same from a Skin, to be run in a thread of its own.\n\n"
                               "skin: a Skin, which must not change meanwhile.\n") +
                   kFaces + kSettings +
                   "progress: a Progress that another thread watches, or None. If it is cancelled, None is returned. "
                   "Ctrl C cancels it, too.\n"
                   "Raises ValueError as the constructor does.")
                      .c_str())
      .def("arrays", &arrays_of,
           "Returns what was computed, to be saved and passed to from_arrays: variant, pruned; offsets (V + 1,) int64, "
           "where each "
           "vertex's N entries begin; joints (N,) int32; omega (N, 10), (N, 4) or (N, 1) float32: second moment xx xy "
           "xz yy yz zz about the center, first moment x y z, share, or the last of them; centers (V, 3) float32, the "
           "smoothed rest positions; scales (V,) float32.")
      .def_static("from_arrays", &from_arrays, py::arg("skin"), py::arg("variant"), py::arg("pruned"),
                  py::arg("offsets"), py::arg("joints"), py::arg("omega"), py::arg("centers"), py::arg("scales"),
                  "Restores what arrays() returned, for a Skin with the same rest positions and joints.\n\n"
                  "offsets: (V + 1,) integers.\n"
                  "joints: (N,) integers.\n"
                  "omega: (N, 10), (N, 4) or (N, 1).\n"
                  "centers: (V, 3).\n"
                  "scales: (V,).\n"
                  "Raises ValueError for sizes that do not fit, a joint that does not exist, a number that is not "
                  "finite.")
      .def_property_readonly("variant", &DirectDeltaMush::variant, "0 to 5.")
      .def_property_readonly("entry_count", &DirectDeltaMush::entry_count, "N, pairs of a vertex and a joint.")
      .def_property_readonly("bytes", &DirectDeltaMush::bytes, "How many bytes it takes, without its skin.")
      .def_property_readonly("pruned", &DirectDeltaMush::pruned,
                             "The largest error of a vertex because joints were left out, as a fraction of the spread "
                             "of its joints' motions; at most `prune`, except with very many joints.");

  module.def("skin_direct_delta_mush", &direct_delta_mush, py::arg("ddm"), py::arg("matrices"),
             py::arg("out") = py::none(),
             (std::string("Direct delta mush: v' = R v + q - R p, where R is the rotation nearest to how the smoothed "
                          "neighborhood is deformed.\n\n"
                          "ddm: a DirectDeltaMush of V vertices and J joints.\n") +
              kSkinArguments + kSkinReturns)
                 .c_str());
}

}  // namespace sinew::bindings
