#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <string>

#include "arrays.h"
#include "host/memory.h"

// Blender stores weights, poses and shape keys in arrays and linked lists of its own structs. Its Python API returns
// their entries one by one; these functions read all of them at once, by address. The caller passes the member offsets
// (addon/sinew/host/contract.py, which checks them against Blender's own description). Here, only the counts and
// pointers in the structs are checked.

namespace sinew::bindings {
namespace {

template <class T>
py::array_t<T> array_of(const std::vector<T>& values) {
  return py::array_t<T>(static_cast<py::ssize_t>(values.size()), values.data());
}

/// A vertex is {Entry* entries; int count; int flag}, an entry is {unsigned group; float weight}.
py::tuple read_weights(Address vertices, std::ptrdiff_t count) {
  constexpr std::ptrdiff_t kVertex = 16, kEntry = 8;
  if (count < 0) throw InputError("count is " + std::to_string(count) + "; expected 0 or more");
  std::vector<std::int64_t> offsets(count + 1, 0);
  std::vector<std::int32_t> groups;
  std::vector<float> weights;
  {
    const py::gil_scoped_release release;
    for (std::ptrdiff_t v = 0; v < count; ++v) {
      const auto own = read<std::int32_t>(vertices + v * kVertex + 8);
      offsets[v + 1] = offsets[v] + std::max(own, 0);
    }
    groups.resize(offsets[count]);
    weights.resize(offsets[count]);
    for (std::ptrdiff_t v = 0; v < count; ++v) {
      const auto entries = read<Address>(vertices + v * kVertex);
      for (auto i = offsets[v]; i < offsets[v + 1]; ++i) {
        const Address entry = entries + (i - offsets[v]) * kEntry;
        groups[i] = read<std::int32_t>(entry);
        weights[i] = read<float>(entry + 4);
      }
    }
  }
  const py::ssize_t entries = offsets[count];
  return py::make_tuple(given_away(std::move(offsets), {count + 1}), given_away(std::move(groups), {entries}),
                        given_away(std::move(weights), {entries}));
}

/// Replaces the entries of all vertices, whose counts stay. Their layout is that of read_weights.
void write_weights(Address vertices, const py::array_t<std::int64_t>& offsets, const py::array_t<std::int32_t>& groups,
                   const py::array_t<float>& weights) {
  constexpr std::ptrdiff_t kVertex = 16, kEntry = 8;
  const auto first = offsets.unchecked<1>();
  const auto group = groups.unchecked<1>();
  const auto weight = weights.unchecked<1>();
  const py::ssize_t count = first.shape(0) - 1;
  if (count < 0) throw InputError("offsets is empty; expected V + 1 numbers");
  if (first(0) != 0 || first(count) != group.shape(0) || group.shape(0) != weight.shape(0)) {
    throw InputError("offsets, groups and weights do not fit together");
  }
  const py::gil_scoped_release release;
  for (py::ssize_t v = 0; v < count; ++v) {  // before anything is written
    const auto own = std::max(read<std::int32_t>(vertices + v * kVertex + 8), 0);
    if (own != first(v + 1) - first(v)) {
      throw InputError("vertex " + std::to_string(v) + " has " + std::to_string(own) + " weights; expected " +
                       std::to_string(first(v + 1) - first(v)));
    }
  }
  for (py::ssize_t v = 0; v < count; ++v) {
    const auto entries = read<Address>(vertices + v * kVertex);
    for (auto i = first(v); i < first(v + 1); ++i) {
      const Address entry = entries + (i - first(v)) * kEntry;
      write(entry, group(i));
      write(entry + 4, weight(i));
    }
  }
}

/// A vertex is {Attachment* attachments; int count; int vertex}, an attachment is
/// {int* corners; int count; int kind; float* weights; float distance; float influence}.
py::tuple read_surface_binding(Address vertices, std::ptrdiff_t count) {
  constexpr std::ptrdiff_t kVertex = 16, kAttachment = 32;
  constexpr std::int32_t kPolygon = 1;
  if (count < 0) throw InputError("count is " + std::to_string(count) + "; expected 0 or more");
  std::vector<std::int32_t> bound, offsets{0}, kinds, corner_offsets{0}, corners;
  std::vector<float> weights, distances, influences;
  {
    const py::gil_scoped_release release;
    for (std::ptrdiff_t v = 0; v < count; ++v) {
      const Address vertex = vertices + v * kVertex;
      const auto first = read<Address>(vertex);
      const std::int32_t own = first == 0 ? 0 : read<std::int32_t>(vertex + 8);
      bound.push_back(read<std::int32_t>(vertex + 12));
      for (std::int32_t i = 0; i < own; ++i) {
        const Address at = first + i * kAttachment;
        const auto size = std::max(read<std::int32_t>(at + 8), 0), kind = read<std::int32_t>(at + 12);
        const auto indices = read<Address>(at), numbers = read<Address>(at + 16);
        for (std::int32_t c = 0; c < size; ++c) corners.push_back(read<std::int32_t>(indices + 4 * c));
        for (std::int32_t c = 0; c < (kind == kPolygon ? size : 3); ++c) {
          weights.push_back(read<float>(numbers + 4 * c));
        }
        kinds.push_back(kind);
        distances.push_back(read<float>(at + 24));
        influences.push_back(read<float>(at + 28));
        corner_offsets.push_back(static_cast<std::int32_t>(corners.size()));
      }
      offsets.push_back(static_cast<std::int32_t>(kinds.size()));
    }
  }
  const auto given = [](auto numbers) {
    const auto size = static_cast<py::ssize_t>(numbers.size());
    return given_away(std::move(numbers), {size});
  };
  return py::make_tuple(given(std::move(bound)), given(std::move(offsets)), given(std::move(kinds)),
                        given(std::move(corner_offsets)), given(std::move(corners)), given(std::move(weights)),
                        given(std::move(distances)), given(std::move(influences)));
}

/// layout: offsets in a pose bone of the address of the next bone, its motion, its number of segments, and the address
/// of the segments' motions.
void read_pose(Address bone, const py::array_t<std::int32_t>& first_joints,
               const py::array_t<std::int32_t>& joint_counts, const std::array<std::ptrdiff_t, 4>& layout,
               const py::array& out) {
  const PoseBoneLayout members{layout[0], layout[1], layout[2], layout[3]};
  const auto first = first_joints.unchecked<1>();
  const auto counts = joint_counts.unchecked<1>();
  if (counts.shape(0) != first.shape(0))
    throw InputError("first_joints and joint_counts need one number per bone each");
  const py::ssize_t joints = out.ndim() == 3 ? out.shape(0) : 0;
  auto* const matrices = reinterpret_cast<char*>(written_span<float>("out", out, {joints, 4, 4}).data());
  for (py::ssize_t b = 0; b < first.shape(0); ++b, bone = read<Address>(bone + members.next)) {
    if (bone == 0) throw InputError("the pose has fewer bones than the skin was made for");
    if (first(b) < 0) continue;
    if (counts(b) < 1 || counts(b) > joints - first(b)) throw InputError("out has too few matrices for the joints");
    if (!copy_motions(bone, members, counts(b), matrices + first(b) * kMatrix)) {
      throw InputError("a bone has other segments than the skin was made for; make the skin again");
    }
  }
  if (bone != 0) throw InputError("the pose has more bones than the skin was made for");
}

py::array_t<std::int64_t> list_addresses(Address first, std::ptrdiff_t count) {
  std::vector<std::int64_t> addresses;
  for (; first != 0 && std::ssize(addresses) < count; first = read<Address>(first)) {
    addresses.push_back(static_cast<std::int64_t>(first));
  }
  return array_of(addresses);
}

bool is_any_flat(const py::array_t<float, py::array::c_style>& motions,
                 const py::array_t<std::int32_t, py::array::c_style>& first_joints,
                 const py::array_t<std::int32_t, py::array::c_style>& joint_counts) {
  require_shape("motions", motions, "(J, 4, 4)");
  const auto firsts = first_joints.unchecked<1>(), counts = joint_counts.unchecked<1>();
  if (counts.shape(0) != firsts.shape(0))
    throw InputError("first_joints and joint_counts need one number per bone each");
  for (py::ssize_t b = 0; b < firsts.shape(0); ++b) {
    if (firsts(b) < 0 || counts(b) < 2) continue;
    if (counts(b) > motions.shape(0) - firsts(b)) throw InputError("motions has too few matrices for the joints");
    for (std::int32_t j = firsts(b); j < firsts(b) + counts(b); ++j) {
      if (is_nearly_flat(motions.data(j, 0, 0))) return true;
    }
  }
  return false;
}

/// layout: as in KeyLayout.
py::array_t<float> read_and_silence_keys(const std::vector<Address>& keys,
                                         const std::array<std::ptrdiff_t, 3>& layout) {
  std::vector<float> values(keys.size(), 0.0f);
  silence_keys(keys, {layout[0], layout[1], layout[2]}, values);
  return array_of(values);
}

/// layout: as in KeyLayout.
void restore_silent_keys(const std::vector<Address>& keys, const std::array<std::ptrdiff_t, 3>& layout,
                         const std::vector<std::int16_t>& numbers) {
  if (keys.size() != numbers.size()) throw InputError("numbers needs one number per key");
  restore_keys(keys, {layout[0], layout[1], layout[2]}, numbers);
}

}  // namespace

void bind_described(py::module_& host);
void bind_struct_values(py::module_& host);
void bind_places(py::module_& host);
void bind_pose_record(py::module_& host);
void bind_stored_curves(py::module_& host);
void bind_shortcut(py::module_& host);

void bind_host(py::module_& parent) {
  py::module_ module = parent.def_submodule("host", "Blender's own memory, for the add-on; of no use outside Blender.");
  module.def("read_weights", &read_weights, py::arg("vertices"), py::arg("count"),
             "Reads the weights of one of Blender's meshes.\n\n"
             "vertices: address of its array of deform vertices; count: V.\n"
             "Returns offsets (V + 1,) int64, groups (N,) int32 and weights (N,) float32, in the "
             "order in which Blender stores them.");
  module.def("write_weights", &write_weights, py::arg("vertices"), py::arg("offsets"), py::arg("groups"),
             py::arg("weights"),
             "Replaces the weights of one of Blender's meshes, without changing how many each vertex has.\n\n"
             "vertices: address of its array of deform vertices; offsets (V + 1,) int64, groups (N,) int32 and weights "
             "(N,) float32, as read_weights returns them.\n"
             "Raises ValueError, before anything is written, if a vertex has a different number of weights.");
  module.def("read_surface_binding", &read_surface_binding, py::arg("vertices"), py::arg("count"),
             "Reads what one of Blender's Surface Deform modifiers was bound with.\n\n"
             "vertices: address of its array of vertices; count: B, of them.\n"
             "Returns what SurfaceDeform takes: vertices (B,), offsets (B + 1,), attachments (N,), corner_offsets "
             "(N + 1,) and corners, int32; corner_weights, distances (N,) and influences (N,), float32.");
  module.def("read_pose", &read_pose, py::arg("bone"), py::arg("first_joints"), py::arg("joint_counts"),
             py::arg("layout"), py::arg("out"),
             "Reads the motions of the bones of one of Blender's poses, from rest to pose, armature space.\n\n"
             "bone: address of its first bone; first_joints, joint_counts: (B,) int32, for each bone the "
             "index of its first matrix in out, -1 for none, and how many matrices it has: 1, or for a B-bone "
             "the number of its segments + 1.\n"
             "layout: byte offsets in a bone of the next one's address, its motion, its number of "
             "segments, the address of the segments' motions.\n"
             "out: (J, 4, 4) float32, column by column as in Blender, C-contiguous.\n"
             "Raises ValueError if the pose has different bones or segments.");
  module.def(
      "is_any_flat", &is_any_flat, py::arg("motions"), py::arg("first_joints"), py::arg("joint_counts"),
      "Whether a segment of any B-bone is flattened along an axis, but for rounding. What rotation Blender takes "
      "from its motion then depends on how Blender has rounded.\n\n"
      "motions: (J, 4, 4) float32, first_joints, joint_counts: (B,) int32, as read_pose takes and fills them.");
  module.def("list_addresses", &list_addresses, py::arg("first"), py::arg("count"),
             "Returns the addresses, int64, of at most count structs of one of Blender's lists, in which each "
             "begins with the address of the next.");
  module.def("silence_keys", &read_and_silence_keys, py::arg("keys"), py::arg("layout"),
             "Keeps Blender from adding evaluated shape keys to the reference key: makes them relative to a key that "
             "does not exist.\n\n"
             "keys: (K,) int64, addresses, first the reference key, which is not changed; layout: byte offsets in a "
             "key of its flags, its value and the number of the key to which it is relative.\n"
             "Returns (K,) float32: their values, 0 for the reference and for muted keys.");
  module.def("restore_keys", &restore_silent_keys, py::arg("keys"), py::arg("layout"), py::arg("numbers"),
             "Undoes silence_keys.\n\n"
             "numbers: for each key, that of the key to which it is relative.\n"
             "Raises ValueError if there is not one for each key.");
  bind_described(module);
  bind_struct_values(module);
  bind_places(module);
  bind_pose_record(module);
  bind_stored_curves(module);
  bind_shortcut(module);
}

}  // namespace sinew::bindings
