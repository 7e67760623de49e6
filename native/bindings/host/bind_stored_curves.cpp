#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <string>

#include "arrays.h"
#include "host/memory.h"

// The stored keyframes of F-curves, copied to find out later which of the curves an edit has changed.

namespace sinew::bindings {
namespace {

/// Offsets in an F-curve and in a keyframe, in bytes.
struct CurveLayout {
  std::ptrdiff_t keys, count, path, modifiers, samples, extrapolation, index, flag;
  std::uint16_t ignored;  // bits of the flag
  std::ptrdiff_t key_size, frame;
  std::vector<std::array<std::ptrdiff_t, 2>> members;  // offset and size of all in a keyframe that values depend on
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

Curve curve_at(Address at, const CurveLayout& layout, std::size_t width) {
  Curve curve;
  const auto path = read<Address>(at + layout.path);
  if (path != 0) curve.settings = reinterpret_cast<const char*>(path);
  curve.settings += '\0';
  append(curve.settings, at + layout.extrapolation, sizeof(std::int16_t));
  append(curve.settings, at + layout.index, sizeof(std::int32_t));
  const auto flag = static_cast<std::uint16_t>(read<std::uint16_t>(at + layout.flag) & ~layout.ignored);
  curve.settings.append(reinterpret_cast<const char*>(&flag), sizeof flag);
  curve.is_local = read<Address>(at + layout.modifiers) == 0 && read<Address>(at + layout.samples) == 0;
  auto key = read<Address>(at + layout.keys);
  const auto count = key == 0 ? 0 : std::max(read<std::int32_t>(at + layout.count), 0);
  curve.keys.reserve(count * width);
  curve.frames.reserve(count);
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
    curves_.reserve(curves.size());
    for (const Address curve : curves) curves_.push_back(curve_at(curve, layout, static_cast<std::size_t>(width_)));
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

  /// What a rig's description says of curves, see docs/rigs.md.
  py::list described() const {
    const py::str path("path"), index("index"), keys("keys"), modifiers("modifiers"), extrapolated("is_extrapolated");
    py::list found;
    for (const Curve& curve : curves_) {
      const char* const settings = curve.settings.data() + std::strlen(curve.settings.data()) + 1;
      const auto at = reinterpret_cast<Address>(settings);
      py::dict row;
      row[path] = text_of(curve.settings.data());
      row[index] = py::int_(read<std::int32_t>(at + sizeof(std::int16_t)));
      row[keys] = rows(curve);
      if (!curve.is_local) row[modifiers] = py::none();
      if (read<std::int16_t>(at) == 1) row[extrapolated] = py::bool_(true);
      found.append(std::move(row));
    }
    return found;
  }

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
  py::array_t<float> rows(const Curve& curve) const {
    constexpr py::ssize_t kPoints = 9;  // left handle, keyframe, right handle
    constexpr py::ssize_t kWidth = (kPoints + 3) * sizeof(float) + 2;
    constexpr py::ssize_t kColumns = 11;
    if (width_ != kWidth) throw InputError("a keyframe's members are others than those of a rig's description");
    py::array_t<float> rows({static_cast<py::ssize_t>(curve.frames.size()), kColumns});
    float* row = rows.mutable_data();
    const char* key = curve.keys.data();
    for (std::size_t k = 0; k < curve.frames.size(); ++k, key += kWidth, row += kColumns) {
      std::array<float, kPoints> points;
      std::array<float, 3> back_amplitude_period;
      std::memcpy(points.data(), key, sizeof points);
      const char* const choices = key + sizeof points;
      std::memcpy(back_amplitude_period.data(), choices + 2, sizeof back_amplitude_period);
      for (int point = 0; point < 3; ++point) std::copy_n(points.data() + 3 * point, 2, row + 2 * point);
      row[6] = back_amplitude_period[1];
      row[7] = back_amplitude_period[2];
      row[8] = back_amplitude_period[0];
      row[9] = static_cast<float>(choices[0]);
      row[10] = static_cast<float>(choices[1]);
    }
    return rows;
  }

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
                    std::ptrdiff_t, std::ptrdiff_t, std::uint16_t, std::ptrdiff_t, std::ptrdiff_t, Members>(),
           py::arg("keys"), py::arg("count"), py::arg("path"), py::arg("modifiers"), py::arg("samples"),
           py::arg("extrapolation"), py::arg("index"), py::arg("flag"), py::arg("ignored"), py::arg("key_size"),
           py::arg("frame"), py::arg("members"),
           "keys, count, path, modifiers, samples, extrapolation, index, flag: byte offsets in a curve of the address "
           "of its keyframes, their number, the address of its path, those of its first modifier and of its samples, "
           "whether it is extrapolated, the number of what it sets, and its flag.\n"
           "ignored: bits of the flag that do not matter.\n"
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
      .def(
          "described", &StoredCurves::described,
          "Returns what a rig's description says of the curves: path, index, keys, (K, 11) float32, and "
          "is_extrapolated "
          "if that is so; but modifiers are None where there are any, or samples. The layout's members must be points, "
          "interpolation, easing, back, amplitude and period.")
      .def("keys", &StoredCurves::keys, py::arg("number"),
           "Returns all that a curve's values depend on of its K keyframes, (K, N) uint8.");
}

}  // namespace sinew::bindings
