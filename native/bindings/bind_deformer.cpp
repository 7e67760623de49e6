#include <pybind11/stl.h>

#include <memory>
#include <optional>

#include "arrays.h"
#include "layer_poses.h"
#include "methods.h"
#include "sinew/deformer.h"
#include "stages.h"

namespace sinew::bindings {
namespace {

std::shared_ptr<Bends> make_bends(const py::array& vertices, const py::array& offsets, const py::array& bones,
                                  const py::array& weights, const py::array& first_joints, const py::array& segments,
                                  const py::array& axes) {
  require_shape("axes", axes, "(B, 4)");
  const auto bent = list_of<std::int64_t>("vertices", vertices), begin = list_of<std::int64_t>("offsets", offsets);
  const auto own = list_of<std::int32_t>("bones", bones);
  const auto shares = list_of<float>("weights", weights);
  const std::vector<std::int32_t> first = list_of<std::int32_t>("first_joints", first_joints),
                                  counts = list_of<std::int32_t>("segments", segments);
  const Numbers<double> rows("axes", axes);
  const py::gil_scoped_release release;
  return std::make_shared<Bends>(bent, begin, own, shares, first, counts, rows);
}

std::shared_ptr<Layer> make_layer(std::shared_ptr<Skin> skin, const std::string& method, const std::string& stretch,
                                  const std::optional<py::array>& rest_frames, const std::optional<py::array>& mask,
                                  const std::optional<py::array>& share, const OrNone<Bends>& bends,
                                  const std::optional<py::array>& split_space, const OrNone<MethodData>& data,
                                  bool refuse_half_turns) {
  std::vector<Matrix4<double>> frames;
  if (rest_frames) frames = copied_matrices("rest_frames", *rest_frames, "(J, 4, 4)");
  std::optional<Matrix4<double>> space;
  if (split_space) space = matrix_of<4, 4, double>("split_space", *split_space);
  const StretchRule rule{stretch_named(stretch), frames, refuse_half_turns};
  const SkinningMethod how = method_named(method);
  const OptionalNumbers own_mask("mask", mask), own_share("share", share);
  const py::gil_scoped_release release;
  return std::make_shared<Layer>(std::move(skin), how, rule, own_mask, own_share, bends.value_or(nullptr), space,
                                 data.value_or(nullptr));
}

std::shared_ptr<ShapeKeys> make_keys(const std::vector<py::array>& positions, const py::object& relative_to,
                                     const std::optional<std::vector<std::optional<py::array>>>& weights) {
  std::vector<Numbers<float>> shapes;
  std::vector<std::span<const float>> spans;
  shapes.reserve(positions.size());
  for (std::size_t k = 0; k < positions.size(); ++k) {
    const std::string name = "positions[" + std::to_string(k) + "]";
    spans.push_back(shapes.emplace_back(points_of<float>(name.c_str(), positions[k])));
  }
  std::vector<OptionalNumbers> groups;
  std::vector<std::optional<std::span<const float>>> group_spans;
  if (weights) {
    groups.reserve(weights->size());
    for (std::size_t k = 0; k < weights->size(); ++k) {
      const std::string name = "weights[" + std::to_string(k) + "]";
      group_spans.push_back(groups.emplace_back(name.c_str(), (*weights)[k]));
    }
    // For the library, an empty list means that no key has weights.
    if (groups.empty()) throw InputError("weights has 0 entries; expected one per key, or None");
  }
  const auto numbers = py::array::ensure(relative_to);  // may be a list
  if (!numbers) {
    PyErr_Clear();
    throw InputError("relative_to is not a list of numbers");
  }
  const std::vector<std::int64_t> relative = list_of<std::int64_t>("relative_to", numbers);
  const py::gil_scoped_release release;
  return std::make_shared<ShapeKeys>(spans, relative, group_spans);
}

/// The poses that a stage of layers refers to, and the arrays that they refer to.
struct PosedLayers {
  std::shared_ptr<const MixedLayers> layers;
  py::tuple kept;
  std::vector<LayerPose> poses;
};

StageOfPython stage_of_layers(const std::shared_ptr<MixedLayers>& layers, const py::sequence& poses) {
  const auto posed = std::make_shared<PosedLayers>(PosedLayers{layers, py::tuple(poses), {}});
  for (const py::handle pose : posed->kept) posed->poses.push_back(pose_of(pose, posed->poses.size()));
  return StageOfPython(*layers, {posed->poses}, posed);
}

void deform(const Deformer& deformer, const py::sequence& poses, const py::object& out,
            const std::optional<py::array>& key_values, const std::optional<py::array>& rest_positions,
            const py::sequence& stages, const std::optional<py::array>& milliseconds) {
  // Lists may change while the GIL is released, but their elements must stay alive.
  const py::tuple kept_poses(poses), kept_stages(stages);
  std::vector<LayerPose> layer_poses;
  for (const py::handle pose : kept_poses) layer_poses.push_back(pose_of(pose, layer_poses.size()));
  const std::span<float> positions = written_span<float>("out", given_array("out", out), {deformer.result_count(), 3});
  std::span<const float> values, rest;
  if (key_values) values = numbers_span("key_values", *key_values, "(K,)");
  if (rest_positions) rest = numbers_span("rest_positions", *rest_positions, "(V, 3)");
  if (key_values && rest_positions) {
    throw InputError("there are key_values and rest_positions; expected one");
  }
  const std::vector<Stage> in_order = stages_of(kept_stages);
  std::span<double> times;
  if (milliseconds) {
    times = written_span<double>("milliseconds", *milliseconds,
                                 {static_cast<std::ptrdiff_t>(deformer.step_count(in_order.size()))});
  }
  const py::gil_scoped_release release;
  deformer.deform(layer_poses, positions, values, rest, in_order, times);
}

}  // namespace

void bind_deformer(py::module_& module) {
  py::class_<Bends, std::shared_ptr<Bends>>(
      module, "Bends",
      "Influences of bones with segments, which are split between the two ends of the segment that a vertex is at: N "
      "vertices with M influences of B bones. Immutable.")
      .def(py::init(&make_bends), py::arg("vertices"), py::arg("offsets"), py::arg("bones"), py::arg("weights"),
           py::arg("first_joints"), py::arg("segments"), py::arg("axes"),
           "vertices: (N,) integers, ascending: the vertices with an influence of a bone with "
           "segments.\n"
           "offsets: (N + 1,) integers: vertices[i] has the influences offsets[i] to "
           "offsets[i + 1].\n"
           "bones: (M,) integers in 0..B-1: all influences of these vertices, not yet split, in stored order.\n"
           "weights: (M,) float32.\n"
           "first_joints: (B,) integers, the first joint of each bone.\n"
           "segments: (B,) integers: 1 is an ordinary bone with one joint, n > 1 one with n + 1.\n"
           "axes: (B, 4) float64: a point p of the armature's space lies at share axes[b, :3] . p + "
           "axes[b, 3] of the bone's length, 0 at the head and 1 at the tail; points beyond count as at the end.\n"
           "All are copied. Raises ValueError for sizes that do not fit and for numbers that are "
           "out of range or not finite.")
      .def_property_readonly(
          "vertex_count", [](const Bends& self) { return std::ssize(self.vertices()); }, "N.")
      .def_property_readonly("influence_count", &Bends::influence_count, "M.");

  py::register_local_exception<HalfTurn>(module, "HalfTurn", PyExc_ValueError).doc() =
      "Joints are half a turn apart, see Layer.";

  py::class_<Layer, std::shared_ptr<Layer>>(
      module, "Layer", "What one armature does to a mesh. Immutable, except for changes to its skin.")
      .def(py::init(&make_layer), py::arg("skin"), py::arg("method"), py::arg("stretch") = "polar",
           py::arg("rest_frames") = py::none(), py::arg("mask") = py::none(), py::arg("share") = py::none(),
           py::arg("bends") = py::none(), py::arg("split_space") = py::none(), py::arg("data") = py::none(),
           py::arg("refuse_half_turns") = false,
           "skin: a Skin of V vertices and J joints; several layers may share it.\n"
           "method: \"linear\" or \"dual_quaternion\"; or, with data, \"blended\", \"rotation_centers\" or "
           "\"direct_delta_mush\".\n"
           "stretch: of dual quaternions, as in skin_dual_quaternion.\n"
           "rest_frames: (J, 4, 4), as in skin_dual_quaternion, but relative to the armature.\n"
           "mask: (V,), how much of the motion each vertex gets: "
           "p' = p + mask (skinned(p) - p). None: all of it.\n"
           "share: (V,), for a layer that is mixed in: shape += share (own - shape). The first layer has "
           "no share, and every other layer has one.\n"
           "bends: a Bends: influences that are split in the skin as at its rest positions and in split_space. On each "
           "frame, those of vertices that shape keys move are split again at their new place; with other rest "
           "positions, or in another space, all are.\n"
           "split_space: (4, 4), the space in which the skin was split, None if it is the pose's.\n"
           "data: the method's own data for each vertex: a BlendShares, a RotationCenters or a DirectDeltaMush, which "
           "bends do not change; None for a method without data.\n"
           "refuse_half_turns: with dual quaternions, whoever deforms raises HalfTurn, a ValueError, if joints that "
           "move the same vertices, or some beside them, are half a turn apart, but for rounding, on which it then "
           "depends which way lies between them.\n"
           "All except skin, bends and data are copied. Raises ValueError for sizes that do not fit and for "
           "numbers that are not finite.")
      .def_property_readonly(
          "vertex_count", [](const Layer& self) { return self.skin().vertex_count(); }, "V.")
      .def_property_readonly(
          "joint_count", [](const Layer& self) { return self.skin().joint_count(); }, "J.");

  py::class_<MixedLayers, std::shared_ptr<MixedLayers>>(
      module, "MixedLayers",
      "Layers as a stage, as Blender's Armature modifiers behind others: all start from the shape that the stage gets, "
      "and their results are mixed by their shares. Immutable; several threads may use one at once.")
      .def(py::init([](const std::vector<std::shared_ptr<Layer>>& layers) {
             return std::make_shared<MixedLayers>(
                 std::vector<std::shared_ptr<const Layer>>(layers.begin(), layers.end()));
           }),
           py::arg("layers"),
           "layers: one or more Layer objects, mixed in this order. The rest positions of their skins have no effect, "
           "and bends are split where the vertices are in the shape that the stage gets. Raises ValueError if there "
           "are none, if their numbers of vertices differ, if the first has a share, or if another has none.")
      .def_property_readonly("vertex_count", &MixedLayers::vertex_count, "V.")
      .def("stage", &stage_of_layers, py::arg("poses"),
           "poses: (matrices, space) per layer, as in Deformer.deform. The arrays are kept, not copied. Raises "
           "ValueError if a shape or dtype does not fit.");

  py::class_<ShapeKeys, std::shared_ptr<ShapeKeys>>(
      module, "ShapeKeys",
      "Relative shape keys, as Blender adds them, to the bit. Of each key only the differences are stored. "
      "Immutable.")
      .def(py::init(&make_keys), py::arg("positions"), py::arg("relative_to"), py::arg("weights") = py::none(),
           "positions: K arrays (V, 3), the first of which is the base. They are read once and not kept.\n"
           "relative_to: (K,) integers, the key that each one is relative to; a key that is relative to a missing one "
           "adds nothing.\n"
           "weights: K entries, each None or (V,): how much each vertex takes of the key.\n"
           "Raises ValueError for sizes that differ and for numbers that are not finite.")
      .def_property_readonly("count", &ShapeKeys::count, "K.")
      .def_property_readonly("vertex_count", &ShapeKeys::vertex_count, "V.")
      .def_property_readonly("delta_count", &ShapeKeys::delta_count,
                             "How many vertices of all keys are stored because they differ.")
      .def_property_readonly(
          "base",
          [](py::object self) {
            const auto& keys = self.cast<const ShapeKeys&>();
            return view(keys.base().data(), {keys.vertex_count(), 3}, {3, 1}, self);
          },
          "(V, 3) float32, read-only: the first key.");

  py::class_<Deformer>(module, "Deformer",
                       "Everything that happens to one mesh in a frame: shape keys, skinning layers with their masks "
                       "and mix, and the stages after them. Immutable; several threads may use one at once.")
      .def(py::init([](const std::vector<std::shared_ptr<Layer>>& layers, const OrNone<ShapeKeys>& keys,
                       std::optional<std::ptrdiff_t> vertex_count, const OrNone<Stencils>& stencils) {
             if (!vertex_count) {
               return Deformer({layers.begin(), layers.end()}, keys.value_or(nullptr), stencils.value_or(nullptr));
             }
             if (!layers.empty() || keys) {
               throw InputError("there is a vertex_count beside layers or keys; expected one");
             }
             return Deformer(*vertex_count, stencils.value_or(nullptr));
           }),
           py::arg("layers") = py::list(), py::arg("keys") = py::none(), py::arg("vertex_count") = py::none(),
           py::arg("stencils") = py::none(),
           "layers: Layer objects, mixed in this order; none at all if there are keys.\n"
           "keys: ShapeKeys, or None: the rest positions of the first layer's skin are deformed.\n"
           "vertex_count: V, in place of both, for stages alone.\n"
           "stencils: Stencils of V vertices, which make the result from the shape behind the stages, or None.\n"
           "Raises ValueError if their numbers of vertices differ, if the first layer has a share, or if another layer "
           "has none.")
      .def_property_readonly("vertex_count", &Deformer::vertex_count, "V.")
      .def_property_readonly("result_count", &Deformer::result_count,
                             "R, the number of vertices of the result: V without stencils.")
      .def(
          "deform", &deform, py::arg("poses"), py::arg("out"), py::arg("key_values") = py::none(),
          py::arg("rest_positions") = py::none(), py::arg("stages") = py::tuple(), py::arg("milliseconds") = py::none(),
          "Deforms one frame.\n\n"
          "poses: (matrices, space) per layer: matrices (J, 4, 4) float32, as in skin_linear, in the "
          "space of the armature; space (4, 4) float64, from there to the mesh's, None if they are the same.\n"
          "out: (R, 3) float32, C-contiguous, space of the mesh: where to write.\n"
          "key_values: (K,) float32, the value of each key, 0 for those that are muted; None: 0 for all.\n"
          "rest_positions: (V, 3) float32, C-contiguous, in place of those of the skin and of the keys; must not "
          "overlap out.\n"
          "stages: Stage objects, which work on the result in this order.\n"
          "milliseconds: (S + 1,) float64, S the number of stages, C-contiguous: receives the time that keys and "
          "layers took, then that of each stage; with stencils (S + 2,), the last of which is theirs; None: nothing is "
          "written.\n"
          "If a method cannot include the space in its matrices (dual quaternions: one that shears or scales "
          "unevenly), the points are transformed one by one. A space without an inverse gets zeros for it, as in "
          "Blender. Raises ValueError, and writes nothing, if a shape or dtype does not fit.");
}

}  // namespace sinew::bindings
