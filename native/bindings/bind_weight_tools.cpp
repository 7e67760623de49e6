#include <pybind11/stl.h>

#include <optional>

#include "arrays.h"
#include "sinew/weight_tools.h"

namespace sinew::bindings {
namespace {

/// A table of weights, which must not change while it is read: Python runs other threads meanwhile.
struct TableOfPython {
  TableOfPython(const char* name, const py::array& array) : numbers(checked(name, array)) {
    table = {numbers, array.shape(0), array.shape(1)};
  }
  std::vector<py::ssize_t> shape() const { return {table.vertices, table.bones}; }

  Numbers<float> numbers;
  WeightTable table;

 private:
  static Numbers<float> checked(const char* name, const py::array& array) {
    if (array.ndim() != 2) wrong_shape(name, array, "(V, B)");
    return {name, array};
  }
};

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

std::vector<float> points_or_none(const std::optional<py::array>& positions) {
  if (!positions) return {};
  return points_of<float>("positions", *positions);
}

py::array smoothed(const py::array& weights, const py::array& face_offsets, const py::array& face_vertices,
                   double strength, int steps, double factor, const std::optional<py::array>& mask,
                   const std::optional<py::array>& locked, const std::optional<py::array>& positions) {
  const TableOfPython table("weights", weights);
  const FacesOfPython faces("face_offsets", face_offsets, "face_vertices", face_vertices);
  const std::vector<float> own_mask = mask_or_none(mask), own_positions = points_or_none(positions);
  std::vector<std::int32_t> own_locked;
  if (locked) own_locked = list_of<std::int32_t>("locked", *locked);
  std::vector<float> made;
  {
    const py::gil_scoped_release release;
    made = smooth_weights(table.table, faces.view(), {strength, steps, factor, own_mask, own_locked, own_positions});
  }
  return given_away(std::move(made), table.shape());
}

py::tuple reduced(const py::array& weights, const py::array& positions, const py::array& matrices, int max_influences,
                  int rings, const std::optional<py::array>& face_offsets,
                  const std::optional<py::array>& face_vertices) {
  const TableOfPython table("weights", weights);
  const std::vector<float> own_positions = points_of<float>("positions", positions);
  std::vector<Matrix4<double>> own = copied_matrices("matrices", matrices, 4);
  const auto frames = matrices.shape(0), joints = matrices.shape(1);
  const py::array no_faces = py::array_t<std::int32_t>(0);
  const FacesOfPython faces("face_offsets", face_offsets.value_or(no_faces), "face_vertices",
                            face_vertices.value_or(no_faces));
  ReducedWeights made;
  {
    const py::gil_scoped_release release;
    const Matrix4<double> none = Matrix4<double>::Identity();
    made = reduce_weights(table.table, own_positions,
                          MatrixStack<const double>::of(own.empty() ? &none : own.data(), frames, joints), faces.view(),
                          {max_influences, rings});
  }
  return py::make_tuple(given_away(std::move(made.weights), table.shape()),
                        given_away(std::move(made.largest), {table.table.vertices}),
                        given_away(std::move(made.mean), {table.table.vertices}));
}

py::array mirrored(const py::array& weights, const py::array& positions, const py::array& face_offsets,
                   const py::array& face_vertices, const py::array& pairs, int axis, double origin, bool from_positive,
                   double middle, const std::optional<py::array>& mask) {
  const TableOfPython table("weights", weights);
  const std::vector<float> own_positions = points_of<float>("positions", positions);
  const FacesOfPython faces("face_offsets", face_offsets, "face_vertices", face_vertices);
  const std::vector<std::int32_t> own_pairs = list_of<std::int32_t>("pairs", pairs);
  const std::vector<float> own_mask = mask_or_none(mask);
  std::vector<float> made;
  {
    const py::gil_scoped_release release;
    made = mirror_weights(table.table, own_positions, faces.view(), own_pairs,
                          {axis, origin, from_positive, middle, own_mask});
  }
  return given_away(std::move(made), table.shape());
}

py::tuple transferred(const py::array& source_positions, const py::array& source_face_offsets,
                      const py::array& source_face_vertices, const py::array& source_weights,
                      const py::array& positions, const py::array& face_offsets, const py::array& face_vertices,
                      double distance, double angle, bool flipped) {
  const TableOfPython table("source_weights", source_weights);
  const std::vector<float> from = points_of<float>("source_positions", source_positions);
  const FacesOfPython source_faces("source_face_offsets", source_face_offsets, "source_face_vertices",
                                   source_face_vertices);
  const std::vector<float> to = points_of<float>("positions", positions);
  const FacesOfPython faces("face_offsets", face_offsets, "face_vertices", face_vertices);
  TransferredWeights made;
  {
    const py::gil_scoped_release release;
    made = transfer_weights(from, source_faces.view(), table.table, to, faces.view(), {distance, angle, flipped});
  }
  const auto vertices = static_cast<py::ssize_t>(positions.shape(0));
  py::array matched = given_away(std::move(made.matched), {vertices});
  return py::make_tuple(given_away(std::move(made.weights), {vertices, table.table.bones}),
                        matched.attr("view")(py::dtype::of<bool>()));
}

constexpr const char* kTable = "weights: (V, B), 0 or more, a column for each bone.\n";
constexpr const char* kTableFaces =
    "face_offsets: (faces + 1,) integers, where the corners of each face begin.\n"
    "face_vertices: (C,) integers, the vertices around each face, face after face.\n";

}  // namespace

void bind_weight_tools(py::module_& module) {
  module.def(
      "smooth_weights", &smoothed, py::arg("weights"), py::arg("face_offsets"), py::arg("face_vertices"), py::kw_only(),
      py::arg("strength") = 0.0, py::arg("steps") = 5, py::arg("factor") = 0.5, py::arg("mask") = py::none(),
      py::arg("locked") = py::none(), py::arg("positions") = py::none(),
      (std::string("Smooths the weights of all bones along the edges of faces. The sum of a vertex's weights is "
                   "smoothed alike, so that sums of 1 stay.\n\n") +
       kTable + kTableFaces +
       "strength: 0 to 1,000,000. If above 0, in one solve: (I + t L) w' = w, where t is the strength and L w is "
       "w less the mean of the neighbors; it reaches about sqrt(t) edges. 0: in steps.\n"
       "steps: 0 to 10,000, how many times w is moved towards the mean of the neighbors.\n"
       "factor: 0 to 1, how far each step goes.\n"
       "mask: (V,), booleans or numbers from 0, which stays, to 1: multiplies the factor. With a strength, vertices "
       "below 0.5 stay. None: all are smoothed.\n"
       "locked: integers, bones whose weights stay. The others' are scaled to the sum that they had.\n"
       "positions: (V, 3): vertices that coincide get equal weights. None: they are smoothed apart.\n"
       "Returns (V, B) float32. Vertices without faces stay. Raises ValueError for sizes that do not fit, vertices "
       "and bones that do not exist, numbers that are not finite, settings out of range.")
          .c_str());

  module.def(
      "reduce_weights", &reduced, py::arg("weights"), py::arg("positions"), py::arg("matrices"), py::kw_only(),
      py::arg("max_influences") = 4, py::arg("rings") = 0, py::arg("face_offsets") = py::none(),
      py::arg("face_vertices") = py::none(),
      (std::string("Leaves each vertex at most max_influences weights, chosen by how far it moves in given poses "
                   "without the others. What is kept is fitted anew by least squares, not negative, with the sum "
                   "of before, unless that makes the largest move longer.\n\n") +
       kTable +
       "positions: (V, 3), rest positions.\n"
       "matrices: (F, B, 4, 4), skinning matrices: a clip, or test poses. One at least.\n"
       "max_influences: 1 to 64.\n"
       "rings: 0 to 64: the weights of a bone fade out over so many edges towards vertices that have lost it, "
       "against seams. Above 0 it needs faces.\n"
       "face_offsets, face_vertices: (faces + 1,) and (C,) integers, or None.\n"
       "Returns (weights, largest, mean): (V, B) float32, and (V,) float32 each, how far each vertex moves over "
       "the poses, in the unit of positions; 0 where nothing changed. Raises ValueError for sizes that do not fit "
       "and numbers that are not finite.")
          .c_str());

  module.def(
      "mirror_weights", &mirrored, py::arg("weights"), py::arg("positions"), py::arg("face_offsets"),
      py::arg("face_vertices"), py::arg("pairs"), py::kw_only(), py::arg("axis") = 0, py::arg("origin") = 0.0,
      py::arg("from_positive") = true, py::arg("middle") = 1e-5, py::arg("mask") = py::none(),
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
       "Returns (V, B) float32. Raises ValueError for sizes that do not fit, pairs that do not agree, no faces on "
       "the side that is copied, numbers that are not finite.")
          .c_str());

  module.def(
      "transfer_weights", &transferred, py::arg("source_positions"), py::arg("source_face_offsets"),
      py::arg("source_face_vertices"), py::arg("source_weights"), py::arg("positions"), py::arg("face_offsets"),
      py::arg("face_vertices"), py::kw_only(), py::arg("distance") = 0.05, py::arg("angle") = 30.0,
      py::arg("flipped") = false,
      "Copies weights from a surface to another one, as from a body to clothes. A vertex is matched if the closest "
      "point "
      "of the source is near and faces the same way; it gets the weights there. The others get the smoothest weights "
      "that "
      "agree with these (L M^-1 L w = 0, L the Laplacian of cotangents, clamped to 0.01..20, M the areas; after "
      "Abdrashitov et al. 2023), and where some would be negative, the nearest ones that are not. A part of the target "
      "without a match follows one point rigidly: the nearest of another part that has weights, or of the source. The "
      "unit does not matter.\n\n"
      "source_positions: (V, 3).\n"
      "source_face_offsets, source_face_vertices: (faces + 1,) and (C,) integers. One face at least.\n"
      "source_weights: (V, B), 0 or more.\n"
      "positions: (W, 3), in the same space.\n"
      "face_offsets, face_vertices: (faces + 1,) and (C,) integers. Vertices without faces are parts of their own.\n"
      "distance: above 0, share of the diagonal of the target's bounding box.\n"
      "angle: 0 to 180 degrees, between the normals.\n"
      "flipped: normals may also be opposite, as those of inner layers.\n"
      "Returns (weights, matched): (W, B) float32, 0 or more, with sum 1, and (W,) bool. Vertices that coincide get "
      "equal "
      "weights. The same bits for any number of threads. Raises ValueError for sizes that do not fit, vertices that do "
      "not "
      "exist, a source without faces or weights, numbers that are not finite, settings out of range.");
}

}  // namespace sinew::bindings
