#include "json_of.h"

#include <optional>
#include <string>
#include <string_view>

#include "arrays.h"

namespace sinew::bindings {
namespace {

constexpr std::size_t kMostValues = 1 << 22;   // lists may share what they hold
constexpr std::size_t kMostNumbers = 1 << 28;  // in lists and arrays

class Copy {
 public:
  Json of(const py::handle& object, const std::string& name, int depth) {
    PyObject* const own = object.ptr();
    if (PyFloat_CheckExact(own)) return {PyFloat_AS_DOUBLE(own)};
    if (PyBool_Check(own)) return {own == Py_True};
    if (object.is_none()) return {};
    if (PyLong_CheckExact(own)) {
      const double number = PyLong_AsDouble(own);
      if (number != -1 || PyErr_Occurred() == nullptr) return {number};
      PyErr_Clear();
      return {Json::Other{value_text(object)}};
    }
    if (PyUnicode_Check(own)) {
      if (const std::optional<std::string_view> text = utf8_of(object)) return {std::string(*text)};
      return {Json::Other{value_text(object)}};
    }
    if (PyDict_Check(own)) return entries_of(object, name, depth);
    if (PyList_Check(own) || PyTuple_Check(own)) return list_of(object, name, depth);
    if (py::isinstance<py::array>(object)) {
      std::vector<float> numbers = Numbers<float>(name.c_str(), py::reinterpret_borrow<py::array>(object));
      count(numbers_ += numbers.size(), kMostNumbers, "numbers");
      return {std::move(numbers)};
    }
    try {
      return {object.cast<double>()};
    } catch (const py::cast_error&) {
      return {Json::Other{value_text(object)}};
    }
  }

 private:
  static void count(std::size_t number, std::size_t most, const char* what) {
    if (number > most) {
      throw InputError("the rig has too many " + std::string(what) + "; expected at most " + std::to_string(most));
    }
  }

  void go_in(const std::string& name, int depth) {
    if (depth == kMostNested) throw InputError("the rig has lists that are nested without end as \"" + name + "\"");
    count(++values_, kMostValues, "lists and dictionaries");
  }

  /// Of a str, which holds it.
  static std::optional<std::string_view> utf8_of(const py::handle& object) {
    py::ssize_t size = 0;
    const char* const text = PyUnicode_Check(object.ptr()) ? PyUnicode_AsUTF8AndSize(object.ptr(), &size) : nullptr;
    if (text != nullptr) return std::string_view(text, static_cast<std::size_t>(size));
    PyErr_Clear();
    return std::nullopt;
  }

  Json entries_of(const py::handle& object, const std::string& name, int depth) {
    go_in(name, depth);
    Json::Entries entries;
    entries.reserve(PyDict_GET_SIZE(object.ptr()));
    PyObject *key = nullptr, *value = nullptr;
    for (py::ssize_t at = 0; PyDict_Next(object.ptr(), &at, &key, &value) != 0;) {
      const auto held = py::reinterpret_borrow<py::object>(key), held_value = py::reinterpret_borrow<py::object>(value);
      Json::Entry& entry = entries.emplace_back();
      const std::optional<std::string_view> text = utf8_of(held);
      entry.name = text ? std::string(*text) : value_text(held);
      entry.json = of(held_value, entry.name, depth + 1);
    }
    return {std::move(entries)};
  }

  Json list_of(const py::handle& object, const std::string& name, int depth) {
    go_in(name, depth);
    JsonList list;
    for (py::ssize_t i = 0; i < PySequence_Fast_GET_SIZE(object.ptr()); ++i) {  // an element may change the list
      const auto item = py::reinterpret_borrow<py::object>(PySequence_Fast_GET_ITEM(object.ptr(), i));
      count(++numbers_, kMostNumbers, "numbers");
      list.add(of(item, name, depth + 1));
    }
    return std::move(list).done();
  }

  std::size_t values_ = 0, numbers_ = 0;
};

}  // namespace

Json json_of(const py::handle& object) { return Copy().of(object, "the rig", 0); }

}  // namespace sinew::bindings
