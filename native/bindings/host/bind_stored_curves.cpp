#include <pybind11/stl.h>

#include <array>
#include <optional>
#include <string>

#include "arrays.h"
#include "host/memory.h"

// The stored keyframes of F-curves, copied to find out later which of the curves an edit has changed.

namespace sinew::bindings {
namespace {

/// Offsets in an F-curve and in a keyframe, in bytes.
struct CurveLayout {
  std::ptrdiff_t keys, count, path, modifiers, samples, flag;
  std::uint16_t ignored;                                // bits of the flag
  std::vector<std::array<std::ptrdiff_t, 2>> settings;  // offset and size of all else that values depend on
  std::ptrdiff_t key_size, frame;
  std::vector<std::array<std::ptrdiff_t, 2>> members;  // the same of a keyframe
};

struct Curve {
  std::string settings, keys;
  std::vector<float> frames;
  bool is_local;  // no modifiers, no samples

  bool operator==(const Curve&) const = default;
};

void append(std::string& to, Address from, std::ptrdiff_t size) {
  to.append(reinterpret_cast<const char*>(from), static_cast<std::size_t>(size));
}

Curve curve_at(Address at, const CurveLayout& layout) {
  Curve curve;
  const auto path = read<Address>(at + layout.path);
  if (path != 0) curve.settings = reinterpret_cast<const char*>(path);
  curve.settings += '\0';
  for (const auto& [offset, size] : layout.settings) append(curve.settings, at + offset, size);
  const auto flag = static_cast<std::uint16_t>(read<std::uint16_t>(at + layout.flag) & ~layout.ignored);
  curve.settings.append(reinterpret_cast<const char*>(&flag), sizeof flag);
  curve.is_local = read<Address>(at + layout.modifiers) == 0 && read<Address>(at + layout.samples) == 0;
  auto key = read<Address>(at + layout.keys);
  const auto count = key == 0 ? 0 : read<std::int32_t>(at + layout.count);
  for (std::int32_t k = 0; k < count; ++k, key += static_cast<Address>(layout.key_size)) {
    for (const auto& [offset, size] : layout.members) append(curve.keys, key + offset, size);
    curve.frames.push_back(read<float>(key + layout.frame));
  }
  return curve;
}

class StoredCurves {
 public:
  StoredCurves(const std::vector<Address>& curves, const CurveLayout& layout) {
    for (const auto& member : layout.members) width_ += member[1];
    for (const Address curve : curves) curves_.push_back(curve_at(curve, layout));
  }

  std::size_t size() const { return curves_.size(); }

  std::optional<std::vector<std::size_t>> differing(const StoredCurves& other) const {
    if (other.curves_.size() != curves_.size()) return std::nullopt;
    std::vector<std::size_t> found;
    for (std::size_t i = 0; i < curves_.size(); ++i) {
      if (curves_[i] != other.curves_[i]) found.push_back(i);
    }
    return found;
  }

  bool is_local(std::size_t i) const { return of(i).is_local; }

  py::bytes settings(std::size_t i) const { return of(i).settings; }

  py::array_t<float> frames(std::size_t i) const {
    const auto& frames = of(i).frames;
    return py::array_t<float>(static_cast<py::ssize_t>(frames.size()), frames.data());
  }

  py::array_t<std::uint8_t> keys(std::size_t i) const {
    const Curve& curve = of(i);
    const auto count = static_cast<py::ssize_t>(curve.frames.size());
    return py::array_t<std::uint8_t>({count, static_cast<py::ssize_t>(width_)},
                                     reinterpret_cast<const std::uint8_t*>(curve.keys.data()));
  }

 private:
  const Curve& of(std::size_t i) const {
    if (i >= curves_.size()) {
      throw InputError("there are " + std::to_string(curves_.size()) + " curves, no number " + std::to_string(i));
    }
    return curves_[i];
  }

  std::vector<Curve> curves_;
  std::ptrdiff_t width_ = 0;
};

}  // namespace

void bind_stored_curves(py::module_& host) {
  using Members = std::vector<std::array<std::ptrdiff_t, 2>>;
  py::class_<CurveLayout>(host, "CurveLayout", "Where in an F-curve the memory is on which its values depend.")
      .def(py::init<std::ptrdiff_t, std::ptrdiff_t, std::ptrdiff_t, std::ptrdiff_t, std::ptrdiff_t, std::ptrdiff_t,
                    std::uint16_t, Members, std::ptrdiff_t, std::ptrdiff_t, Members>(),
           py::arg("keys"), py::arg("count"), py::arg("path"), py::arg("modifiers"), py::arg("samples"),
           py::arg("flag"), py::arg("ignored"), py::arg("settings"), py::arg("key_size"), py::arg("frame"),
           py::arg("members"),
           "keys, count, path, modifiers, samples, flag: byte offsets in a curve of the address of its keyframes, "
           "their number, the address of its path, those of its first modifier and of its samples, and its flag.\n"
           "ignored: bits of the flag that do not matter; settings: (offset, size) in bytes of what else does.\n"
           "key_size, frame: the size of a keyframe and the offset of its frame in it, in bytes; members: (offset, "
           "size) of all that values depend on.");
  py::class_<StoredCurves>(host, "StoredCurves", "What is stored in C F-curves. A copy, immutable.")
      .def(py::init<const std::vector<Address>&, const CurveLayout&>(), py::arg("curves"), py::arg("layout"),
           "curves: their addresses.")
      .def("__len__", &StoredCurves::size)
      .def("differing", &StoredCurves::differing, py::arg("other"),
           "Returns the numbers of the curves that differ, or None if there are more or fewer of them.")
      .def("is_local", &StoredCurves::is_local, py::arg("number"), "Whether a curve has no modifiers and no samples.")
      .def("settings", &StoredCurves::settings, py::arg("number"),
           "Returns all that a curve's values depend on, except for keyframes, modifiers and samples.")
      .def("frames", &StoredCurves::frames, py::arg("number"),
           "Returns the frames of a curve's K keyframes, (K,) float32.")
      .def("keys", &StoredCurves::keys, py::arg("number"),
           "Returns all that a curve's values depend on of its K keyframes, (K, N) uint8.");
}

}  // namespace sinew::bindings
