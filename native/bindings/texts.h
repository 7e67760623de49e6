/// What messages say of Python's objects: never long, whatever these hold.
#pragma once

#include <pybind11/pybind11.h>

#include <cstddef>
#include <string>
#include <string_view>

namespace sinew::bindings {

namespace py = pybind11;

/// The longest text of an error, in bytes.
inline constexpr std::size_t kLongestText = 2000;

/// Returns a UTF-8 text, with dots in place of what is too much in the middle.
inline std::string shortened(std::string text, std::size_t most = kLongestText) {
  if (text.size() <= most) return text;
  const auto is_inside = [&](std::size_t at) { return (static_cast<unsigned char>(text[at]) & 0xC0) == 0x80; };
  std::size_t begin = most / 2, end = text.size() - most / 2 + 5;
  while (begin > 0 && is_inside(begin)) --begin;
  while (end < text.size() && is_inside(end)) ++end;
  return text.replace(begin, end - begin, " ... ");
}

/// A text of Blender's, which may be no UTF-8, as Blender's API gives it.
inline py::str text_of(std::string_view text) {
  const auto size = static_cast<py::ssize_t>(text.size());
  PyObject* const found = PyUnicode_DecodeUTF8(text.data(), size, "surrogateescape");
  if (found == nullptr) throw py::error_already_set();
  return py::reinterpret_steal<py::str>(found);
}

/// What an object is, for messages: "a list", "an int", "None".
inline std::string type_text(const py::handle& object) {
  if (object.is_none()) return "None";
  const std::string name = py::str(py::type::handle_of(object).attr("__name__"));
  return (name.find_first_of("aeiou") == 0 ? "an " : "a ") + name;
}

/// What an object says of itself, for messages: a few words, whatever it holds.
inline std::string value_text(const py::handle& object) {
  try {
    return shortened(py::str(py::module_::import("reprlib").attr("repr")(object)), 200);
  } catch (const py::error_already_set&) {  // its own __repr__ fails, or it is nested too deeply
  }
  return type_text(object);
}

}  // namespace sinew::bindings
