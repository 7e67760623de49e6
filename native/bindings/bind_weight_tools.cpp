#include <pybind11/stl.h>

#include <memory>
#include <optional>

#include "arrays.h"
#include "given_weights.h"
#include "interruptible.h"
#include "sinew/weight_tools.h"

namespace sinew::bindings {
namespace {

/// Returns what a tool has made in the form in which the weights came: a WeightTable, or (V, B) float32.
py::object in_form_of(const py::object& given, WeightTable made) {
  if (py::isinstance<WeightTable>(given)) return py::cast(std::make_shared<WeightTable>(std::move(made)));
  return py::cast(made).attr("dense")();
}

struct FacesOfPython {
  FacesOfPython(const char* offsets_name, const py::array& own_offsets, const char* vertices_name,
                const py::array& own_vertices)
      : offsets(list_of<std::int32_t>(offsets_name, own_offsets)),
        vertices(list_of<std::int32_t>(vertices_name, own_vertices)) {}
  Faces view() const { return {offsets, vertices}; }

  std::vector<std::int32_t> offsets, vertices;
};

std::vector<float> mask_or_none(const std::optional<py::array>& mask) {
  if (!mask) return {};
  const py::array own = mask->dtype().kind() == 'b' ? py::array(mask->attr("astype")("float32")) : *mask;
  std::vector<float> numbers = list_of<float>("mask", own);
  if (numbers.empty()) throw InputError("mask has no numbers; expected one for each vertex");
  return numbers;
}

std::vector<std::int32_t> locked_or_none(const std::optional<py::array>& locked) {
  if (!locked) return {};
  return list_of<std::int32_t>("locked", *locked);
}

/// What a tool returns, or None.
using Returned = std::optional<py::object>;

Returned smoothed(const py::object& weights, const py::array& face_offsets, const py::array& face_vertices,
                  double strength, int steps, double factor, const std::optional<py::array>& mask,
                  const std::optional<py::array>& locked, const std::optional<py::array>& positions,
                  OrNone<Progress> progress) {
  const auto table = given_table("weights", weights);
  const FacesOfPython faces("face_offsets", face_offsets, "face_vertices", face_vertices);
  const std::vector<float> own_mask = mask_or_none(mask);
  const std::vector<std::int32_t> own_locked = locked_or_none(locked);
  std::vector<float> own_positions;
  if (positions) own_positions = points_of<float>("positions", *positions);
  auto made = interruptible(progress, [&](Progress* own) {
    return smooth_weights(*table, faces.view(), {strength, steps, factor, own_mask, own_locked, own_positions}, own);
  });
  if (!made) return std::nullopt;
  return in_form_of(weights, std::move(*made));
}

Returned reduced(const py::object& weights, const py::array& positions, const py::array& matrices, int max_influences,
                 int rings, const std::optional<py::array>& face_offsets, const std::optional<py::array>& face_vertices,
                 const std::optional<py::array>& locked, OrNone<Progress> progress) {
  const auto table = given_table("weights", weights);
  const std::vector<float> own_positions = points_of<float>("positions", positions);
  std::vector<Matrix4<double>> own_matrices = copied_matrices("matrices", matrices, "(F, J, 4, 4)");
  const auto frames = matrices.shape(0), joints = matrices.shape(1);
  const py::array no_faces = py::array_t<std::int32_t>(0);
  const FacesOfPython faces("face_offsets", face_offsets.value_or(no_faces), "face_vertices",
                            face_vertices.value_or(no_faces));
  const std::vector<std::int32_t> own_locked = locked_or_none(locked);
  auto made = interruptible(progress, [&](Progress* own) {
    const Matrix4<double> none = Matrix4<double>::Identity();
    const Matrix4<double>* const first = own_matrices.empty() ? &none : own_matrices.data();
    return reduce_weights(*table, own_positions, MatrixStack<const double>::of(first, frames, joints), faces.view(),
                          {max_influences, rings, own_locked}, own);
  });
  if (!made) return std::nullopt;
  return py::make_tuple(in_form_of(weights, std::move(made->weights)),
                        given_away(std::move(made->largest), {table->vertices()}),
                        given_away(std::move(made->mean), {table->vertices()}));
}

Returned mirrored(const py::object& weights, const py::array& positions, const py::array& face_offsets,
                  const py::array& face_vertices, const py::array& pairs, int axis, double origin, bool from_positive,
                  double middle, const std::optional<py::array>& mask, OrNone<Progress> progress) {
  const auto table = given_table("weights", weights);
  const std::vector<float> own_positions = points_of<float>("positions", positions);
  const FacesOfPython faces("face_offsets", face_offsets, "face_vertices", face_vertices);
  const std::vector<std::int32_t> own_pairs = list_of<std::int32_t>("pairs", pairs);
  const std::vector<float> own_mask = mask_or_none(mask);
  auto made = interruptible(progress, [&](Progress* own) {
    return mirror_weights(*table, own_positions, faces.view(), own_pairs,
                          {axis, origin, from_positive, middle, own_mask}, own);
  });
  if (!made) return std::nullopt;
  return in_form_of(weights, std::move(*made));
}

Returned transferred(const py::array& source_positions, const py::array& source_face_offsets,
                     const py::array& source_face_vertices, const py::object& source_weights,
                     const py::array& positions, const py::array& face_offsets, const py::array& face_vertices,
                     double distance, double angle, bool flipped, OrNone<Progress> progress) {
  const auto table = given_table("source_weights", source_weights);
  const std::vector<float> from = points_of<float>("source_positions", source_positions);
  const FacesOfPython source_faces("source_face_offsets", source_face_offsets, "source_face_vertices",
                                   source_face_vertices);
  const std::vector<float> to = points_of<float>("positions", positions);
  const FacesOfPython faces("face_offsets", face_offsets, "face_vertices", face_vertices);
  auto made = interruptible(progress, [&](Progress* own) {
    return transfer_weights(from, source_faces.view(), *table, to, faces.view(), {distance, angle, flipped}, own);
  });
  if (!made) return std::nullopt;
  py::array matched = given_away(std::move(made->matched), {std::ssize(to) / 3});
  return py::make_tuple(in_form_of(source_weights, std::move(made->weights)),
                        matched.attr("view")(py::dtype::of<bool>()));
}

std::shared_ptr<WeightTable> table_from_lists(const py::array& offsets, const py::array& bones,
                                              const py::array& weights, std::ptrdiff_t bone_count) {
  const auto own_offsets = list_of<std::int64_t>("offsets", offsets);
  const auto own_bones = list_of<std::int32_t>("bones", bones);
  const auto own_weights = list_of<float>("weights", weights);
  return std::make_shared<WeightTable>(WeightTable::from_lists(own_offsets, own_bones, own_weights, bone_count));
}

py::array dense(const WeightTable& table) {
  py::array_t<float> made({table.vertices(), table.bones()});
  float* const numbers = made.mutable_data();
  std::fill_n(numbers, made.size(), 0.0f);
  for (std::ptrdiff_t v = 0; v < table.vertices(); ++v) {
    for (const BoneWeight& own : table.row(static_cast<std::size_t>(v)))
      numbers[v * table.bones() + own.bone] = own.weight;
  }
  return made;
}

constexpr const char* kTable = "weights: a WeightTable, or (V, B), 0 or more, a column for each bone.\n";
constexpr const char* kTableFaces =
    "face_offsets: (faces + 1,) integers, where the corners of each face begin.\n"
    "face_vertices: (C,) integers, the vertices around each face, face after face.\n";
constexpr const char* kCommon =
    "progress: a Progress, from which another thread can read how far it is, and cancel; or None.\n"
    "Returns None if progress was cancelled. The same bits for any number of threads. Raises ValueError for sizes that "
    "do "
    "not fit, vertices and bones that do not exist, numbers that are not finite, settings out of range";

}  // namespace

void bind_weight_tools(py::module_& module) {
  py::class_<WeightTable, std::shared_ptr<WeightTable>> table(
      module, "WeightTable",
      "The weights above 0 of V vertices in B bones: N in all, where a table has V x B. What the weight tools are "
      "given "
      "as a WeightTable, they return as one. Immutable.");
  table
      .def(py::init(&table_from_lists), py::arg("offsets"), py::arg("bones"), py::arg("weights"), py::arg("bone_count"),
           "offsets: (V + 1,) integers; vertex v has the entries offsets[v] up to offsets[v + 1].\n"
           "bones: (N,) integers, in any order at a vertex; weights of a bone that it names twice are added.\n"
           "weights: (N,), 0 or more.\n"
           "bone_count: B.\n"
           "Raises ValueError if the parts do not fit each other, for bones that do not exist, and for weights below 0 "
           "or "
           "not finite.")
      .def_static(
          "from_dense", [](const py::array& weights) { return given_table("weights", weights); }, py::arg("weights"),
          "weights: (V, B), 0 or more.")
      .def("dense", &dense, "Returns (V, B) float32.")
      .def_property_readonly("vertex_count", &WeightTable::vertices, "V.")
      .def_property_readonly("bone_count", &WeightTable::bones, "B.");
  bind_entries(table, "bones", ".");

  module.def(
      "smooth_weights", &smoothed, py::arg("weights"), py::arg("face_offsets"), py::arg("face_vertices"), py::kw_only(),
      py::arg("strength") = 0.0, py::arg("steps") = 5, py::arg("factor") = 0.5, py::arg("mask") = py::none(),
      py::arg("locked") = py::none(), py::arg("positions") = py::none(), py::arg("progress") = py::none(),
      (std::string("Smooths the weights of all bones along the edges of faces. The sum of a vertex's weights is "
                   "smoothed alike, so that sums of 1 stay; what is below a millionth of it (with a strength, a "
                   "hundred-thousandth) is left out.\n\n") +
       kTable + kTableFaces +
       "strength: 0 to 1,000,000. If above 0, in one solve: (I + t L) w' = w, where t is the strength and L w is "
       "w less the mean of the neighbors; it reaches about sqrt(t) edges. 0: in steps.\n"
       "steps: 0 to 10,000, how many times w is moved towards the mean of the neighbors.\n"
       "factor: 0 to 1, how far each step goes.\n"
       "mask: (V,), booleans or numbers from 0, which stays, to 1: multiplies the factor. With a strength, vertices "
       "below 0.5 stay. None: all are smoothed.\n"
       "locked: (L,) integers, bones whose weights stay. The others' are scaled to the sum that they had.\n"
       "positions: (V, 3): vertices that coincide get equal weights. None: they are smoothed apart.\n"
       "Returns the weights; those of vertices without faces stay. " +
       kCommon + ".")
          .c_str());

  module.def(
      "reduce_weights", &reduced, py::arg("weights"), py::arg("positions"), py::arg("matrices"), py::kw_only(),
      py::arg("max_influences") = 4, py::arg("rings") = 0, py::arg("face_offsets") = py::none(),
      py::arg("face_vertices") = py::none(), py::arg("locked") = py::none(), py::arg("progress") = py::none(),
      (std::string("Leaves each vertex at most max_influences weights, chosen by how far it moves in given poses "
                   "without the others. What is kept is fitted anew by least squares, not negative, with the sum "
                   "of before, unless that makes the largest move longer.\n\n") +
       kTable +
       "positions: (V, 3), rest positions.\n"
       "matrices: (F, B, 4, 4), skinning matrices: a clip, or test poses. One at least.\n"
       "max_influences: 1 to 64.\n"
       "rings: 0 to 64: the weights of a bone fade out over so many edges towards vertices that have lost it, "
       "against seams. Above 0 it needs faces.\n"
       "face_offsets: (faces + 1,) integers, or None.\n"
       "face_vertices: (C,) integers, or None.\n"
       "locked: (L,) integers, bones whose weights stay, and count. A vertex keeps one other at least.\n"
       "Returns (weights, largest, mean): the weights, and (V,) float32 each, how far each vertex moves over "
       "the poses, in the unit of positions; 0 where nothing changed. " +
       kCommon + ".")
          .c_str());

  module.def(
      "mirror_weights", &mirrored, py::arg("weights"), py::arg("positions"), py::arg("face_offsets"),
      py::arg("face_vertices"), py::arg("pairs"), py::kw_only(), py::arg("axis") = 0, py::arg("origin") = 0.0,
      py::arg("from_positive") = true, py::arg("middle") = 1e-5, py::arg("mask") = py::none(),
      py::arg("progress") = py::none(),
      (std::string("Copies weights from one side to the other. Each vertex gets those of the closest point of the "
                   "mirrored surface, so that both sides may have different vertices.\n\n") +
       kTable + "positions: (V, 3), rest positions.\n" + kTableFaces +
       "pairs: (B,) integers, the bone on the other side of each; a bone in the middle is its own.\n"
       "axis: 0, 1 or 2 for x, y or z.\n"
       "origin: where the mirror is on that axis.\n"
       "from_positive: copies to the negative side; False: the other way.\n"
       "middle: 0 to 1, share of the mesh's longest side: vertices so near the mirror get the mean of their own "
       "and their mirrored weights.\n"
       "mask: (V,), booleans or numbers: vertices below 0.5 stay. None: all may change.\n"
       "Returns the weights. " +
       kCommon + ", pairs that do not agree, no faces on the side that is copied.")
          .c_str());

  module.def(
      "transfer_weights", &transferred, py::arg("source_positions"), py::arg("source_face_offsets"),
      py::arg("source_face_vertices"), py::arg("source_weights"), py::arg("positions"), py::arg("face_offsets"),
      py::arg("face_vertices"), py::kw_only(), py::arg("distance") = 0.05, py::arg("angle") = 30.0,
      py::arg("flipped") = false, py::arg("progress") = py::none(),
      (std::string(
           "Copies weights from a surface to another one, as from a body to clothes. A vertex is matched if the "
           "closest "
           "point of the source has weights, is near and faces the same way; it gets the weights there. The others get "
           "the smoothest weights that agree with these (L M^-1 L w = 0, L the Laplacian of cotangents, clamped to "
           "0.01..20, M the areas; after Abdrashitov et al. 2023), and where some would be negative, the nearest ones "
           "that are not. A part of the target without a match follows one point rigidly: the nearest with weights, of "
           "another part or of the source. The unit does not matter.\n\n"
           "source_positions: (V, 3).\n"
           "source_face_offsets: (source_faces + 1,) integers. One face at least.\n"
           "source_face_vertices: (D,) integers.\n"
           "source_weights: a WeightTable, or (V, B), 0 or more.\n"
           "positions: (W, 3), in the same space.\n"
           "face_offsets: (faces + 1,) integers.\n"
           "face_vertices: (C,) integers. Vertices without faces are parts of their "
           "own.\n"
           "distance: above 0, share of the diagonal of the target's bounding box.\n"
           "angle: 0 to 180 degrees, between the normals.\n"
           "flipped: normals may also be opposite, as those of inner layers.\n"
           "Returns (weights, matched): W rows with sum 1, and (W,) bool. Vertices that coincide get equal weights. ") +
       kCommon + ", a source without faces or weights.")
          .c_str());
}

}  // namespace sinew::bindings
