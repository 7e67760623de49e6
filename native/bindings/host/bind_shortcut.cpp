#include <pybind11/stl.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <optional>

#include "arrays.h"
#include "host/memory.h"
#include "host/watched.h"
#include "sinew/deformer.h"
#include "stages.h"

// Deforms a frame in which only the pose has changed, in one call. After Blender has evaluated a rig with hundreds of
// bones, the caches are cold. Python code that otherwise takes a few microseconds then takes a hundred, because each
// object is a cache miss.

namespace sinew::bindings {
namespace {

/// A struct's address, the index of its parent, the index of the parent's region that vouches for it, and its regions:
/// offsets and sizes.
using StructToWatch =
    std::tuple<Address, std::ptrdiff_t, std::size_t, std::vector<std::pair<std::ptrdiff_t, std::size_t>>>;

/// The addresses of shape keys, the offsets of KeySource, for each key the number of the key that it is relative to, and
/// the reference key's own points.
using GivenKeys = std::tuple<std::vector<Address>, std::array<std::ptrdiff_t, 5>, std::vector<std::int16_t>, py::array>;

Watched watched_of(const std::vector<StructToWatch>& given) {
  std::vector<WatchedStruct> structs;
  for (const auto& [address, parent, voucher, regions] : given) {
    structs.push_back({address, parent, voucher, {}});
    for (const auto& [offset, size] : regions) structs.back().regions.push_back({offset, size});
  }
  return Watched(structs);
}

bool is_flat(const Matrix4<float>& place) { return place.cast<double>().determinant() == 0; }

/// Returns the transform from armature space to mesh space; nullopt if they are the same.
std::optional<Matrix4<double>> space_between(const Matrix4<float>& mesh, const Matrix4<float>& armature) {
  if (mesh == armature) return std::nullopt;
  return mesh.cast<double>().inverse() * armature.cast<double>();
}

Matrix4<float> placed(const char* name, const py::array& array) {
  require_shape(name, array, "(4, 4)");
  require_dtype<float>(name, array);
  const auto numbers = py::array_t<float, py::array::c_style>(array);
  return Matrix4<float>::Map(numbers.data()).transpose();
}

/// The bones of an armature that move a layer.
struct PoseSource {
  struct Bone {
    std::int32_t number, first_joint, joint_count;
  };

  PoseSource(Address pose_at, const std::vector<std::int32_t>& first_joints,
             const std::vector<std::int32_t>& joint_counts, std::ptrdiff_t joints)
      : at(pose_at), bone_count(std::ssize(first_joints)), matrices(16 * joints, 0.0f) {
    if (first_joints.empty() || first_joints.size() != joint_counts.size()) {
      throw InputError("first_joints and joint_counts need one number per bone each");
    }
    for (std::ptrdiff_t j = 0; j < joints; ++j) {
      for (int i = 0; i < 4; ++i) matrices[16 * j + 5 * i] = 1.0f;
    }
    for (std::size_t b = 0; b < first_joints.size(); ++b) {
      if (first_joints[b] < 0) continue;
      if (joint_counts[b] < 1 || joint_counts[b] > joints - first_joints[b]) {
        throw InputError("the layer has too few joints for the bones");
      }
      bones.push_back({static_cast<std::int32_t>(b), first_joints[b], joint_counts[b]});
    }
  }

  Address at;  ///< where the address of the pose is stored
  std::ptrdiff_t bone_count;
  std::vector<Bone> bones;
  std::vector<float> matrices;  ///< identity for bones that do not deform
  std::vector<Address> seen;    ///< the bones' addresses when the list was last walked; they may be gone
  bool is_split = false;        ///< whether the layer splits its motions as Blender does

  /// Whether how a motion is split depends on how Blender has rounded.
  bool depends_on_rounding() const {
    if (!is_split) return false;
    return std::ranges::any_of(bones, [this](const Bone& bone) {
      if (bone.joint_count < 2) return false;
      for (std::int32_t j = 0; j < bone.joint_count; ++j) {
        if (is_nearly_flat(matrices.data() + 16 * (bone.first_joint + j))) return true;
      }
      return false;
    });
  }
};

/// Offsets of the members of a pose, in bytes.
struct PoseLayout {
  std::ptrdiff_t list;   ///< of bones: first and last
  std::ptrdiff_t array;  ///< of their addresses, in the same order; -1 if there is none
  PoseBoneLayout bone;
};

struct Switch {
  Address address;
  std::int32_t clear, set;
};

/// Bits that must stay as they were.
struct Kept {
  Address address;
  std::int32_t bits, before;
};

/// The shape keys of an evaluated mesh. The deformed shape is written into the coordinates of the first key.
struct KeySource {
  std::vector<Address> keys;
  /// as in KeyLayout, then the offsets of the address of a key's points and of their number
  std::array<std::ptrdiff_t, 5> layout;
  std::vector<std::int16_t> relative;  ///< for each key, the number of the key that it is relative to
  std::vector<float> values;
  std::optional<py::array> base_owner;
  std::span<const float> base;  ///< the first key's own coordinates

  KeyLayout of_key() const { return {layout[0], layout[1], layout[2]}; }

  /// Reads the keys' values, and has Blender add none of the keys.
  void read_values() { silence_keys(keys, of_key(), values); }

  /// Makes the keys what they were. points: of the first key.
  void restore(float* points) const {
    restore_keys(keys, of_key(), relative);
    std::ranges::copy(base, points);
  }

  /// Returns the coordinates of the first key, or null if its number of points is not count.
  float* points(std::ptrdiff_t count) const {
    if (read<std::int32_t>(keys[0] + layout[4]) != count) return nullptr;
    return reinterpret_cast<float*>(read<Address>(keys[0] + layout[3]));
  }
};

/// Where Blender stores a matrix from object space to world space: its address and -1, or the address at which the
/// address of a struct is stored, and the matrix's offset in that struct.
using Place = std::pair<Address, std::ptrdiff_t>;
using Places = std::pair<Place, Place>;  ///< the mesh's and an armature's

Matrix4<float> matrix_at(const Place& place) {
  const auto& [at, offset] = place;
  return Matrix4<float>::Map(reinterpret_cast<const float*>(offset < 0 ? at : read<Address>(at) + offset));
}

class Shortcut {
 public:
  Shortcut(py::object deformer, const std::vector<StructToWatch>& watched,
           const std::vector<std::tuple<Address, std::vector<std::int32_t>, std::vector<std::int32_t>>>& poses,
           const std::array<std::ptrdiff_t, 6>& layout, std::vector<Places> places,
           const std::vector<std::tuple<Address, std::int32_t, std::int32_t>>& switches, const py::sequence& stages,
           const std::optional<GivenKeys>& keys, const std::optional<py::array>& rest_positions,
           const std::vector<std::pair<Address, std::int32_t>>& kept, std::vector<Address> bones)
      : owner_(std::move(deformer)),
        deformer_(owner_.cast<const Deformer&>()),
        watched_(watched_of(watched)),
        bones_(std::move(bones)),
        layout_{layout[0], layout[1], {layout[2], layout[3], layout[4], layout[5]}},
        places_(std::move(places)),
        stage_owners_(py::list(stages)),
        stages_(stages_of(py::tuple(stage_owners_))),
        rest_owner_(rest_positions),
        milliseconds_(deformer_.step_count(stages_.size()) + 1, 0.0) {
    const std::vector<const Layer*> layers = all_layers();
    if (poses.size() != layers.size() || places_.size() != layers.size()) {
      throw InputError("poses and places have " + std::to_string(poses.size()) + " and " +
                       std::to_string(places_.size()) + " entries; the deformer and the stages have " +
                       std::to_string(layers.size()) + " layers");
    }
    for (const auto& [at, first_joints, joint_counts] : poses) {
      sources_.emplace_back(at, first_joints, joint_counts, layers[sources_.size()]->skin().joint_count());
      sources_.back().is_split = layers[sources_.size() - 1]->method() == SkinningMethod::dual_quaternion;
    }
    for (const auto& [address, clear, set] : switches) switches_.push_back({address, clear, set});
    for (const auto& [address, bits] : kept) kept_.push_back({address, bits, read<std::int32_t>(address) & bits});
    if (keys) {
      const auto& [addresses, offsets, relative, base] = *keys;
      if (addresses.empty()) throw InputError("keys has no address; expected one per key");
      if (relative.size() != addresses.size()) throw InputError("keys needs one number per key");
      keys_ = {addresses, offsets, relative, std::vector<float>(addresses.size(), 0.0f), base, {}};
      keys_.base = numbers_span("keys", *keys_.base_owner, "(V, 3)");
      if (std::ssize(keys_.base) != 3 * deformer_.vertex_count()) {
        throw InputError("the reference key's points are not those of the deformer's vertices");
      }
    }
    for (const Address mark : bones_) marks_.push_back(read<std::uint8_t>(mark));
    if (rest_owner_) rest_ = numbers_span("rest_positions", *rest_owner_, "(V, 3)");
    poses_.resize(sources_.size());
    pose_stages();
  }

  /// The bits are read only if the watched memory is unchanged: otherwise they may no longer exist.
  bool holds() const {
    return watched_.holds() && std::ranges::all_of(kept_, [](const Kept& each) {
             return (read<std::int32_t>(each.address) & each.bits) == each.before;
           });
  }

  /// Whether Blender has not copied the bones of any armature again. Only while the watched memory is unchanged.
  bool has_bones() const {
    return std::ranges::equal(bones_, marks_, {}, [](Address mark) { return read<std::uint8_t>(mark); });
  }

  /// Replaces a stage by one of the same kind. Throws InputError for another one, and if there is no such stage.
  void set_stage(std::size_t number, const py::object& given) {
    const std::vector<Stage> stage = stages_of(py::make_tuple(given));
    if (number >= stages_.size()) {
      throw InputError("there is no stage " + std::to_string(number) + "; there are " + std::to_string(stages_.size()));
    }
    if (stage[0].index() != stages_[number].index() || std::holds_alternative<Staged<MixedLayers>>(stage[0])) {
      throw InputError("stage " + std::to_string(number) +
                       " can only be replaced by one of the same kind, and not if " + "it has layers");
    }
    stage_owners_[number] = given;
    stages_[number] = stage[0];
  }

  /// Returns false if the full code must compute this frame.
  /// out: address of R x 3 floats; 0: the first key's points.
  bool deform(Address out) {
    // Other Python threads keep running, but waiting for them again takes longer than a small mesh does.
    std::optional<py::gil_scoped_release> release;
    if (!is_quick()) release.emplace();
    const Watch watch;
    if (!holds() || !has_bones()) return false;
    for (std::size_t i = 0; i < sources_.size(); ++i) {
      if (!place(i)) return false;
      gather(sources_[i]);
      if (sources_[i].depends_on_rounding()) return false;
      const std::ptrdiff_t joints = std::ssize(sources_[i].matrices) / 16;
      poses_[i].matrices = {sources_[i].matrices.data(), 1, joints, 16 * joints, 16, 1, 4};
    }
    auto* positions = reinterpret_cast<float*>(out);
    if (!keys_.keys.empty()) {
      float* const points = keys_.points(deformer_.vertex_count());
      if (!points) return false;
      if (positions == nullptr && deformer_.result_count() != deformer_.vertex_count()) return false;
      keys_.read_values();
      if (positions == nullptr) positions = points;
    }
    if (positions == nullptr) throw InputError("out is 0, and there are no shape keys; pass an address");
    const auto count = static_cast<std::size_t>(3 * deformer_.result_count());
    milliseconds_[0] = watch.milliseconds();
    const std::span<const LayerPose> own(poses_.data(), deformer_.layers().size());
    deformer_.deform(own, {positions, count}, keys_.values, rest_, stages_, std::span(milliseconds_).subspan(1));
    for (const Switch& each : switches_) {
      write(each.address, (read<std::int32_t>(each.address) & ~each.clear) | each.set);
    }
    return true;
  }

  /// Restores switches and keys after an evaluation. Returns false if the full code must do it.
  bool restore() const {
    if (!holds()) return false;
    if (!keys_.keys.empty()) {
      float* const points = keys_.points(deformer_.vertex_count());
      if (!points) return false;
      keys_.restore(points);
    }
    for (const Switch& each : switches_) {
      write(each.address, read<std::int32_t>(each.address) & ~(each.clear | each.set));
    }
    return true;
  }

  const std::vector<double>& milliseconds() const { return milliseconds_; }

 private:
  class Watch {
   public:
    double milliseconds() const {
      return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_).count();
    }

   private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  };

  bool is_quick() const {
    constexpr std::ptrdiff_t kFew = 2000;
    return deformer_.vertex_count() < kFew && stages_.empty() && keys_.keys.empty();
  }

  /// Returns the layers of the deformer, then those of the stages.
  std::vector<const Layer*> all_layers() const {
    std::vector<const Layer*> found;
    const auto add = [&](const auto& layers) {
      for (const auto& layer : layers) found.push_back(layer.get());
    };
    add(deformer_.layers());
    for (const Stage& stage : stages_) {
      if (const auto* mixed = std::get_if<Staged<MixedLayers>>(&stage)) add(mixed->stage->layers());
    }
    return found;
  }

  /// Has the stages of layers use the poses of this object, which come behind those of the deformer's layers.
  void pose_stages() {
    std::size_t first = deformer_.layers().size();
    for (Stage& stage : stages_) {
      auto* const mixed = std::get_if<Staged<MixedLayers>>(&stage);
      if (!mixed) continue;
      const std::size_t own = mixed->stage->layers().size();
      mixed->settings.poses = std::span(poses_).subspan(first, own);
      first += own;
    }
  }

  /// Sets the transform from armature space to mesh space of layer i. Returns false if an object's matrix is singular.
  bool place(std::size_t i) {
    const Matrix4<float> mesh = matrix_at(places_[i].first), armature = matrix_at(places_[i].second);
    if (is_flat(mesh) || is_flat(armature)) return false;
    poses_[i].mesh_from_armature = space_between(mesh, armature);
    return true;
  }

  void gather(PoseSource& source) const {
    const auto pose = read<Address>(source.at);
    if (layout_.array < 0) return walk(source, pose);
    const auto bones = pose == 0 ? 0 : read<Address>(pose + layout_.array);
    const auto bone = [&](std::ptrdiff_t number) { return read<Address>(bones + number * sizeof(Address)); };
    // If both ends of the list match, the array contains the same bones.
    if (bones == 0 || bone(0) != read<Address>(pose + layout_.list) ||
        bone(source.bone_count - 1) != read<Address>(pose + layout_.list + sizeof(Address))) {
      refuse_pose();
    }
    auto* const matrices = reinterpret_cast<char*>(source.matrices.data());
    for (const PoseSource::Bone& each : source.bones) copy(bone(each.number), each, matrices);
  }

  /// The same for a pose without an array. Bones are far apart in memory, so those that were next the last time are
  /// fetched ahead; what is read is the list as it is now.
  void walk(PoseSource& source, Address pose) const {
    constexpr std::size_t kAhead = 16;
    source.seen.resize(source.bone_count + kAhead, 0);
    auto* const matrices = reinterpret_cast<char*>(source.matrices.data());
    auto used = source.bones.begin();
    Address bone = pose == 0 ? 0 : read<Address>(pose + layout_.list);
    for (std::ptrdiff_t b = 0; b < source.bone_count; ++b, bone = read<Address>(bone + layout_.bone.next)) {
      if (bone == 0) refuse_pose();
      for (const std::ptrdiff_t member : {layout_.bone.next, layout_.bone.motion}) {
        __builtin_prefetch(reinterpret_cast<const void*>(source.seen[b + kAhead] + member));
      }
      source.seen[b] = bone;
      if (used == source.bones.end() || used->number != b) continue;
      copy(bone, *used, matrices);
      ++used;
    }
    if (bone != 0) refuse_pose();
  }

  void copy(Address bone, const PoseSource::Bone& of, char* matrices) const {
    if (!copy_motions(bone, layout_.bone, of.joint_count, matrices + of.first_joint * kMatrix)) {
      throw InputError("a bone has other segments than the skin was made for; make the skin again");
    }
  }

  [[noreturn]] static void refuse_pose() {
    throw InputError("the pose has other bones than the skin was made for; make the skin again");
  }

  py::object owner_;
  const Deformer& deformer_;
  Watched watched_;
  std::vector<Address> bones_;  ///< of the marks
  std::vector<std::uint8_t> marks_;
  PoseLayout layout_;
  std::vector<Places> places_;
  py::list stage_owners_;  // a copy
  std::vector<Stage> stages_;
  std::optional<py::array> rest_owner_;
  std::span<const float> rest_;
  KeySource keys_;
  std::vector<PoseSource> sources_;
  std::vector<Switch> switches_;
  std::vector<Kept> kept_;
  std::vector<LayerPose> poses_;
  std::vector<double> milliseconds_;
};

}  // namespace

void bind_shortcut(py::module_& host) {
  py::class_<Shortcut>(host, "Shortcut",
                       "A frame in which only the pose and the values of shape keys have changed. For one "
                       "evaluated object and one thread at a time.")
      .def(
          py::init<py::object, const std::vector<StructToWatch>&,
                   const std::vector<std::tuple<Address, std::vector<std::int32_t>, std::vector<std::int32_t>>>&,
                   const std::array<std::ptrdiff_t, 6>&, std::vector<Places>,
                   const std::vector<std::tuple<Address, std::int32_t, std::int32_t>>&, const py::sequence&,
                   const std::optional<GivenKeys>&, const std::optional<py::array>&,
                   const std::vector<std::pair<Address, std::int32_t>>&, std::vector<Address>>(),
          py::arg("deformer"), py::arg("watched"), py::arg("poses"), py::arg("layout"), py::arg("places"),
          py::arg("switches"), py::arg("stages") = py::tuple(), py::arg("keys") = py::none(),
          py::arg("rest_positions") = py::none(), py::arg("kept") = std::vector<std::pair<Address, std::int32_t>>(),
          py::arg("bones") = std::vector<Address>(),
          "deformer: a Deformer.\n"
          "watched: memory that must stay as it is now for the shortcut to hold: for each struct (address, parent, "
          "voucher, [(offset, size) of each region, in bytes]). A struct is read only after region `voucher` of the "
          "struct `parent`, which comes before it, was found unchanged: a pointer to the struct, or a mark of one "
          "byte. "
          "The first struct has the parent -1.\n"
          "poses: for each layer of the deformer, then of each stage of layers, in order: (address at which the "
          "address of the pose is stored, first_joints, joint_counts), the last two as in read_pose.\n"
          "layout: byte offsets in a pose of its list of bones and its array of their addresses, or -1 if it has none, "
          "then what read_pose takes.\n"
          "places: for each layer, where two matrices of 16 float32 are, column by column: from mesh space to world "
          "space and from armature space to world space. Each is (address, -1), or the address at which the address of "
          "a struct is stored, and the matrix's offset in it in bytes.\n"
          "switches: (address of an int32, bits to clear, bits to set).\n"
          "stages: as in Deformer.deform.\n"
          "keys: (addresses of the shape keys, byte offsets in a key: three as in silence_keys, then of the address of "
          "its points and of their number, for each key the number of the key to which it is relative, (V, 3) float32 "
          "the first key's own points), or None.\n"
          "rest_positions: (V, 3) float32, as in Deformer.deform, or None.\n"
          "kept: (address of an int32, bits of it that must stay as they are now for the shortcut to hold). Read only "
          "while the watched memory is unchanged.\n"
          "bones: addresses of bytes that keep their values while the armatures' bones are as they are now.\n"
          "Raises ValueError for sizes that do not fit, and for a watched struct that its parent does not lead to.")
      .def("holds", &Shortcut::holds, "Whether the watched memory and the kept bits are unchanged.")
      .def("has_bones", &Shortcut::has_bones,
           "Whether the bytes of `bones` are unchanged. Only while the shortcut holds.")
      .def("set_stage", &Shortcut::set_stage, py::arg("number"), py::arg("stage"),
           "Replaces a stage by one with other settings.\n\n"
           "number: which of the stages.\n"
           "stage: a sinew_native.Stage of the same kind, which is not of layers.\n"
           "Raises ValueError for another one, and if there is no such stage.")
      .def("deform", &Shortcut::deform, py::arg("out") = 0,
           "Reads poses, places and values of keys, deforms, and sets the switches.\n\n"
           "out: address of R x 3 float32, C-contiguous, for the shape; 0: into the first key's points.\n"
           "Returns False, and does nothing, if it does not hold, if the first key has another number of points, "
           "if an object's scale is 0 along an axis, or if is_any_flat for a layer of dual quaternions.\n"
           "Raises ValueError, without changing the switches, if a pose has different bones or "
           "segments.")
      .def("restore", &Shortcut::restore,
           "After the evaluation, clears the bits of the switches, and restores the keys.\n\n"
           "Returns False, and does nothing, if it does not hold, or if the first key has another number of points.")
      .def_property_readonly(
          "milliseconds", [](py::object self) { return view_list(self.cast<const Shortcut&>().milliseconds(), self); },
          "(S + 2,) float64, read-only, times in the last frame: reading the pose, keys and layers, each stage; with "
          "stencils "
          "(S + 3,), the last of which is theirs.");
  host.def(
      "space_between",
      [](const py::array& mesh, const py::array& armature) -> std::optional<py::array> {
        const auto space = space_between(placed("mesh", mesh), placed("armature", armature));
        if (!space) return std::nullopt;
        py::array_t<double> result({4, 4});
        Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(result.mutable_data()) = *space;
        return result;
      },
      py::arg("mesh"), py::arg("armature"),
      "Computes the transform from armature space to mesh space.\n\n"
      "mesh, armature: (4, 4) float32, from their space to world space; the mesh's must have an inverse.\n"
      "Returns (4, 4) float64, or None if the two are equal: to the bit what a Shortcut computes.");
}

}  // namespace sinew::bindings
