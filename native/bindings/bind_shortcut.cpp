#include <pybind11/stl.h>

#include <array>
#include <memory>
#include <optional>

#include "arrays.h"
#include "memory.h"
#include "sinew/deformer.h"
#include "stages.h"

// A frame in which nothing but the pose has changed, in one call. Behind the evaluation of a rig of
// hundreds of bones the caches are cold, and what Python would do in a few microseconds takes a
// hundred: each of its objects is a miss.

namespace sinew::bindings {
namespace {

/// Memory that has to be as it was when it was first looked at.
class Watched {
 public:
  explicit Watched(const std::vector<std::pair<Address, std::size_t>>& regions) {
    for (const auto& [address, size] : regions) {
      regions_.push_back({address, seen_.size(), size});
      const auto* const bytes = reinterpret_cast<const char*>(address);
      seen_.insert(seen_.end(), bytes, bytes + size);
    }
  }

  /// One after the other, and no further than the first that has changed: it may be what says that
  /// the next one's memory is still there.
  bool holds() const {
    for (const Region& region : regions_) {
      if (std::memcmp(reinterpret_cast<const void*>(region.address), seen_.data() + region.first, region.size) != 0) {
        return false;
      }
    }
    return true;
  }

 private:
  struct Region {
    Address address;
    std::size_t first, size;
  };
  std::vector<Region> regions_;
  std::vector<char> seen_;
};

/// The bones of one armature that move a layer.
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
      if (joint_counts[b] < 1 || first_joints[b] + joint_counts[b] > joints) {
        throw InputError("the layer has too few joints for the bones");
      }
      bones.push_back({static_cast<std::int32_t>(b), first_joints[b], joint_counts[b]});
    }
  }

  Address at;  ///< of the address of the pose
  std::ptrdiff_t bone_count;
  std::vector<Bone> bones;
  std::vector<float> matrices;  ///< those of bones that do not deform stay the identity
};

/// Where the members of a pose lie, in bytes.
struct PoseLayout {
  std::ptrdiff_t list, array;  ///< of its bones: first and last; addresses in that order
  PoseBoneLayout bone;
};

struct Switch {
  Address address;
  std::int32_t clear, set;
};

class Shortcut {
 public:
  Shortcut(py::object deformer, const std::vector<std::pair<Address, std::size_t>>& watched,
           const std::vector<std::tuple<Address, std::vector<std::int32_t>, std::vector<std::int32_t>>>& poses,
           const std::array<std::ptrdiff_t, 6>& layout,
           const std::vector<std::tuple<Address, std::int32_t, std::int32_t>>& switches)
      : owner_(std::move(deformer)),
        deformer_(owner_.cast<const Deformer&>()),
        watched_(watched),
        layout_{layout[0], layout[1], {layout[2], layout[3], layout[4], layout[5]}} {
    if (poses.size() != deformer_.layers().size()) {
      throw InputError("poses has " + std::to_string(poses.size()) + " entries; the deformer has " +
                       std::to_string(deformer_.layers().size()) + " layers");
    }
    for (const auto& [at, first_joints, joint_counts] : poses) {
      const Layer& layer = *deformer_.layers()[sources_.size()];
      sources_.emplace_back(at, first_joints, joint_counts, layer.skin().joint_count());
    }
    for (const auto& [address, clear, set] : switches) switches_.push_back({address, clear, set});
    poses_.resize(sources_.size());
  }

  bool holds() const { return watched_.holds(); }

  void deform(const py::object& out, const std::vector<std::optional<py::array_t<double, py::array::c_style>>>& spaces,
              const py::sequence& stages, const std::optional<py::array>& milliseconds) {
    const auto positions = written_span<float>("out", given_array("out", out), {deformer_.vertex_count(), 3});
    const std::vector<Stage> in_order = stages_of(stages);
    std::span<double> times;
    if (milliseconds) {
      times = written_span<double>("milliseconds", *milliseconds, {std::ssize(in_order) + 1});
    }
    if (spaces.size() != sources_.size()) throw InputError("spaces needs one entry per layer");
    for (std::size_t i = 0; i < sources_.size(); ++i) {
      poses_[i].mesh_from_armature.reset();
      if (!spaces[i]) continue;
      if (spaces[i]->size() != 16) wrong_shape("space", *spaces[i], "(4, 4)");
      poses_[i].mesh_from_armature = Matrix4<double>::Map(spaces[i]->data()).transpose();
    }
    const py::gil_scoped_release release;
    for (std::size_t i = 0; i < sources_.size(); ++i) {
      gather(sources_[i]);
      const std::ptrdiff_t joints = std::ssize(sources_[i].matrices) / 16;
      poses_[i].matrices = {sources_[i].matrices.data(), 1, joints, 16 * joints, 16, 1, 4};
    }
    deformer_.deform(poses_, positions, {}, {}, in_order, times);
    for (const Switch& each : switches_) {
      write(each.address, (read<std::int32_t>(each.address) & ~each.clear) | each.set);
    }
  }

 private:
  void gather(PoseSource& source) const {
    const auto pose = read<Address>(source.at);
    const auto bones = pose == 0 ? 0 : read<Address>(pose + layout_.array);
    const auto bone = [&](std::ptrdiff_t number) { return read<Address>(bones + number * sizeof(Address)); };
    // Both ends of the list tell that the array is that of these bones.
    if (bones == 0 || bone(0) != read<Address>(pose + layout_.list) ||
        bone(source.bone_count - 1) != read<Address>(pose + layout_.list + sizeof(Address))) {
      throw InputError("the pose has other bones than the skin was made for; make the skin again");
    }
    char* const matrices = reinterpret_cast<char*>(source.matrices.data());
    for (const PoseSource::Bone& each : source.bones) {
      char* const to = matrices + each.first_joint * kMatrix;
      if (!copy_motions(bone(each.number), layout_.bone, each.joint_count, to)) {
        throw InputError("a bone has other segments than the skin was made for; make the skin again");
      }
    }
  }

  py::object owner_;
  const Deformer& deformer_;
  Watched watched_;
  PoseLayout layout_;
  std::vector<PoseSource> sources_;
  std::vector<Switch> switches_;
  std::vector<LayerPose> poses_;
};

}  // namespace

void bind_shortcut(py::module_& host) {
  py::class_<Shortcut>(host, "Shortcut",
                       "A frame in which nothing but the pose has changed. Of one evaluated object: "
                       "for one thread at a time.")
      .def(py::init<py::object, const std::vector<std::pair<Address, std::size_t>>&,
                    const std::vector<std::tuple<Address, std::vector<std::int32_t>, std::vector<std::int32_t>>>&,
                    const std::array<std::ptrdiff_t, 6>&,
                    const std::vector<std::tuple<Address, std::int32_t, std::int32_t>>&>(),
           py::arg("deformer"), py::arg("watched"), py::arg("poses"), py::arg("layout"), py::arg("switches"),
           "deformer: a Deformer without keys or whose keys add nothing.\n"
           "watched: (address, size) of memory that says that all is as now, looked at in this "
           "order.\n"
           "poses: a layer each, (address at which the address of the pose stands, first_joints, "
           "joint_counts), these as in read_pose.\n"
           "layout: byte offsets in a pose of its list of bones and its array of their addresses, "
           "then what read_pose takes.\n"
           "switches: (address of an int32, bits to clear, bits to set).\n"
           "Raises ValueError for sizes that do not fit.")
      .def("holds", &Shortcut::holds, "Whether what is watched is as it was.")
      .def("deform", &Shortcut::deform, py::arg("out"), py::arg("spaces"), py::arg("stages") = py::tuple(),
           py::arg("milliseconds") = py::none(),
           "To be called if it holds: reads the poses, deforms, and sets the switches.\n\n"
           "out: (V, 3) float32; spaces: (4, 4) float64 or None a layer; stages; milliseconds: as "
           "Deformer.deform has them.\n"
           "Raises ValueError, with the switches as they were, if a pose has other bones or "
           "segments.");
}

}  // namespace sinew::bindings
