/// Says in one sentence which argument of a call is wrong, where pybind11 would list all types and all values.
#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "arrays.h"

namespace sinew::bindings {

namespace {

constexpr std::string_view kOrNone = " | None";

/// A parameter as pybind11 writes it: "name: type = default".
struct Parameter {
  std::string name, type;
  bool has_default = false, may_be_none = false;
  py::handle given{};  // null: it is not
};

/// Splits at commas that are in no brackets and quotes, up to the bracket that ends it.
std::vector<std::string_view> split(std::string_view text) {
  std::vector<std::string_view> parts;
  int depth = 0;
  char quote = 0;
  std::size_t begin = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quote || c == '\'' || c == '"') {
      quote = quote == 0 ? c : c == quote ? '\0' : quote;
    } else if (std::strchr("([{", c)) {
      ++depth;
    } else if (std::strchr(")]}", c) && --depth < 0) {
      parts.push_back(text.substr(begin, i - begin));
      break;
    } else if (c == ',' && depth == 0) {
      parts.push_back(text.substr(begin, i - begin));
      begin = i + 2;
    }
  }
  return parts;
}

/// signature  "(name: type = default, *, name: type) -> type".
std::vector<Parameter> parameters_of(std::string_view signature) {
  std::vector<Parameter> parameters;
  for (const std::string_view part : split(signature.substr(1))) {
    const std::size_t colon = part.find(": "), equals = part.find(" = ");
    if (colon == part.npos) continue;
    Parameter own;
    own.name = part.substr(0, colon);
    own.type = part.substr(colon + 2, equals - colon - 2);
    own.has_default = equals != part.npos;
    own.may_be_none = own.type.ends_with(kOrNone) || (own.has_default && part.substr(equals + 3) == "None");
    if (own.type.ends_with(kOrNone)) own.type.resize(own.type.size() - kOrNone.size());
    parameters.push_back(std::move(own));
  }
  return parameters;
}

bool is_integer(py::handle value) { return PyIndex_Check(value.ptr()) && !PyFloat_Check(value.ptr()); }

/// What is in the brackets of "collections.abc.Sequence[...]", if any, and how many there have to be, if that is known.
struct Sequence {
  std::string_view item;  // empty: anything
  std::optional<std::size_t> size;
};

std::optional<Sequence> sequence_of(std::string_view type) {
  constexpr std::string_view kFixed = "typing.Annotated[", kSequence = "collections.abc.Sequence", kSize = "FixedSize(";
  Sequence own;
  if (type.starts_with(kFixed)) {
    const std::size_t at = type.rfind(kSize);
    if (at == type.npos) return std::nullopt;
    std::from_chars(type.data() + at + kSize.size(), type.data() + type.size(), own.size.emplace());
    type.remove_prefix(kFixed.size());
  }
  if (!type.starts_with(kSequence)) return std::nullopt;
  type.remove_prefix(kSequence.size());
  if (!type.empty()) own.item = split(type.substr(1)).front();
  return own;
}

/// Whether a value may be what a type asks for; what is not known may.
bool fits(py::handle value, std::string_view type) {
  if (type.ends_with(kOrNone)) return value.is_none() || fits(value, type.substr(0, type.size() - kOrNone.size()));
  if (type == "numpy.ndarray") return py::isinstance<py::array>(value);
  if (type.starts_with("typing.SupportsInt")) return is_integer(value);
  if (type.starts_with("typing.SupportsFloat")) return is_integer(value) || py::hasattr(value, "__float__");
  if (type == "str") return PyUnicode_Check(value.ptr());
  if (type.starts_with("os.PathLike")) return PyUnicode_Check(value.ptr()) || py::hasattr(value, "__fspath__");
  if (type.starts_with("sinew_native.")) {
    for (const py::handle base : py::type::handle_of(value).attr("__mro__")) {
      if (type.ends_with("." + std::string(py::str(base.attr("__name__"))))) return true;
    }
    return false;
  }
  if (const auto sequence = sequence_of(type)) {
    if (!PySequence_Check(value.ptr())) return false;
    const auto items = py::reinterpret_borrow<py::sequence>(value);
    if (sequence->size && items.size() != *sequence->size) return false;
    for (std::size_t i = 0; i < items.size(); ++i) {
      if (!fits(py::object(items[i]), sequence->item)) return false;
    }
  }
  return true;
}

std::string expected(std::string_view type) {
  if (type == "numpy.ndarray") return "a numpy array";
  if (type.starts_with("typing.SupportsInt")) return "an integer";
  if (type.starts_with("typing.SupportsFloat")) return "a number";
  if (type == "str") return "text";
  if (type.starts_with("os.PathLike")) return "a path";
  if (type.starts_with("sinew_native.")) return "a " + std::string(type.substr(type.rfind('.') + 1));
  if (const auto sequence = sequence_of(type)) {
    const std::string size = sequence->size ? std::to_string(*sequence->size) + " in a list" : "a list";
    return sequence->item.empty() ? size : size + ", each " + expected(sequence->item);
  }
  return std::string(type);
}

/// Returns what is wrong with a call, as one sentence, and whether it is about a value rather than a type; or nothing.
std::optional<std::pair<std::string, bool>> complaint(const py::detail::function_record& record,
                                                      PyObject* const* arguments, std::size_t positional,
                                                      py::handle names) {
  const std::string call =
      std::string(record.is_constructor ? py::str(record.scope.attr("__name__")) : py::str(record.name)) + "()";
  const auto wrong = [](std::string said) { return std::pair(std::move(said), false); };
  std::vector<Parameter> parameters = parameters_of(record.signature);
  if (positional > record.nargs_pos) {
    return wrong(call + " takes " + std::to_string(record.nargs_pos - record.is_method) +
                 " arguments without names, not " + std::to_string(positional - record.is_method));
  }
  for (std::size_t i = 0; i < std::min(positional, parameters.size()); ++i) parameters[i].given = arguments[i];
  for (std::size_t i = 0; names && i < py::len(names); ++i) {
    const std::string name = py::str(names[py::int_(i)]);
    const auto own = std::ranges::find(parameters, name, &Parameter::name);
    if (own == parameters.end()) return wrong(call + " has no argument " + name);
    if (own->given) return wrong(call + " has the argument " + name + " twice");
    own->given = arguments[positional + i];
  }
  for (const Parameter& own : parameters) {
    if (!own.given && !own.has_default) return wrong(call + " lacks the argument " + own.name);
    if (!own.given || (own.given.is_none() ? own.may_be_none : fits(own.given, own.type))) continue;
    return wrong(own.name + " is " + type_text(own.given) + "; expected " + expected(own.type) +
                 (own.may_be_none ? " or None" : ""));
  }
  for (const Parameter& own : parameters) {
    if (!own.given || !own.type.starts_with("typing.SupportsInt") || !is_integer(own.given)) continue;
    const auto number = py::reinterpret_steal<py::object>(PyNumber_Index(own.given.ptr()));
    int overflow = 0;
    const long long value = PyLong_AsLongLongAndOverflow(number.ptr(), &overflow);
    if (overflow == 0 && std::in_range<std::int32_t>(value)) continue;
    return std::pair(own.name + " is " + std::string(py::str(number)) + ", which is out of range", true);
  }
  for (const Parameter& own : parameters) {
    if (own.given && sequence_of(own.type)) return wrong(own.name + " does not fit; expected " + expected(own.type));
  }
  return std::nullopt;
}

using Dispatcher = PyObject* (*)(PyObject*, PyObject* const*, std::size_t, PyObject*);
Dispatcher dispatcher;  // pybind11's, the same for all functions

PyObject* call_and_explain(PyObject* self, PyObject* const* arguments, std::size_t count, PyObject* names) {
  PyObject* const result = dispatcher(self, arguments, count, names);
  if (result || !PyErr_ExceptionMatches(PyExc_TypeError)) return result;
  py::error_already_set raised;
  try {
    const std::string said = py::str(raised.value());
    if (said.find("): incompatible ") != said.npos) {
      const auto* const record = py::detail::function_record_ptr_from_PyObject(self);
      const auto positional = static_cast<std::size_t>(PyVectorcall_NARGS(count));
      if (const auto own = complaint(*record, arguments, positional, names)) {
        PyErr_SetString(own->second ? PyExc_ValueError : PyExc_TypeError, own->first.c_str());
        return nullptr;
      }
    }
  } catch (const std::exception&) {  // what was raised says enough
    PyErr_Clear();
  }
  raised.restore();
  return nullptr;
}

void explain(py::handle member) {
  PyObject* function = member.ptr();
  if (PyInstanceMethod_Check(function)) function = PyInstanceMethod_GET_FUNCTION(function);
  py::object unwrapped;
  if (py::isinstance<py::staticmethod>(member)) {
    unwrapped = member.attr("__func__");
    function = unwrapped.ptr();
  }
  if (!PyCFunction_Check(function) || !PyCFunction_GET_SELF(function)) return;
  auto* const record = py::detail::function_record_ptr_from_PyObject(PyCFunction_GET_SELF(function));
  if (!record || record->next || record->def->ml_flags != (METH_FASTCALL | METH_KEYWORDS)) return;
  // pybind11 would pass null where an object of ours has to be given.
  const std::vector<Parameter> parameters = parameters_of(record->signature);
  for (std::size_t i = 0; i < std::min(parameters.size(), record->args.size()); ++i) {
    if (parameters[i].type.starts_with("sinew_native.") && !parameters[i].may_be_none) record->args[i].none = false;
  }
  dispatcher = reinterpret_cast<Dispatcher>(reinterpret_cast<void (*)()>(record->def->ml_meth));
  record->def->ml_meth = reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(call_and_explain));
}

}  // namespace

/// Of all functions and methods of a module or submodule.
void explain_arguments(const py::object& module) {
  for (const auto& [name, member] : py::dict(module.attr("__dict__"))) {
    if (!PyType_Check(member.ptr())) {
      explain(member);
      continue;
    }
    for (const auto& [own_name, own] : py::dict(member.attr("__dict__"))) explain(own);
  }
}

}  // namespace sinew::bindings
