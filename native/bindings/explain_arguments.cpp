/// Says in one sentence which argument of a call is wrong, where pybind11 would list all types and all values.
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "arrays.h"

namespace sinew::bindings {

namespace {

using FunctionRecord = py::detail::function_record;
using Parameter = py::detail::argument_record;

constexpr std::string_view kOrNone = " | None", kSequence = "collections.abc.Sequence", kFixed = "typing.Annotated[",
                           kOwn = "sinew_native.";

/// The type of each parameter, with what follows it, from "(name: type = default, *, name: type) -> type".
std::vector<std::string_view> types_of(const FunctionRecord& record) {
  std::vector<std::string_view> types;
  std::string_view rest = record.signature;
  rest = rest.substr(0, rest.rfind(") -> "));
  for (const Parameter& own : record.args) {
    const std::string name = std::string(own.name) + ": ";
    const std::size_t at = rest.find(name);
    if (!types.empty()) types.back() = rest.substr(0, at);
    types.push_back(rest = rest.substr(at + name.size()));
  }
  return types;
}

bool may_be_none(const Parameter& own, std::string_view type) {
  return type.find(kOrNone) != type.npos || (own.value && own.value.is_none());
}

/// What a type asks for, as text, and whether a value is that; what is not known may be anything.
std::pair<std::string, bool> wanted(std::string_view type, const py::object& value) {
  const std::string_view word = type.substr(0, type.find_first_of(" ,[]"));
  if (word == "numpy.ndarray") return {"a numpy array", py::isinstance<py::array>(value)};
  if (word == "typing.SupportsInt") return {"an integer", PyIndex_Check(value.ptr())};
  if (word == "typing.SupportsFloat") return {"a number", PyNumber_Check(value.ptr())};
  if (word == "str") return {"text", py::isinstance<py::str>(value)};
  if (word == "collections.abc.Callable") return {"a function", PyCallable_Check(value.ptr())};
  if (word == "os.PathLike") return {"a path", py::isinstance<py::str>(value) || py::hasattr(value, "__fspath__")};
  if (word.starts_with(kOwn)) {
    const std::string name(word.substr(word.rfind('.') + 1)), bases = py::str(py::type::of(value).attr("__mro__"));
    return {"a " + name, bases.find("." + name + "'") != bases.npos};
  }
  const std::size_t at = type.find(kSequence);
  if (at != 0 && at != kFixed.size()) return {std::string(word), true};
  bool is_met = PySequence_Check(value.ptr()) && !PyUnicode_Check(value.ptr()) && !PyBytes_Check(value.ptr());
  const std::size_t count = is_met ? py::len(value) : 0;
  std::string said = "a list";
  if (at > 0) {
    const std::string_view size = type.substr(type.rfind('(') + 1);
    said = std::string(size.substr(0, size.find(')'))) + " in a list";
    is_met &= said.starts_with(std::to_string(count) + " ");
  }
  type.remove_prefix(at + kSequence.size());
  if (!type.starts_with('[')) return {said, is_met};
  type.remove_prefix(1);
  for (std::size_t i = 0; i < count && is_met; ++i) {
    const py::object item = value[py::int_(i)];
    is_met &= wanted(type, item).second || (item.is_none() && type.find(kOrNone) != type.npos);
  }
  return {said + ", each " + wanted(type, py::none()).first, is_met};
}

/// Raises what is wrong with a call.
[[noreturn]] void complain(const FunctionRecord& record, PyObject* const* arguments, std::size_t positional,
                           py::handle names) {
  const std::string call =
      std::string(record.is_constructor ? py::str(record.scope.attr("__name__")) : py::str(record.name)) + "()";
  if (positional > record.nargs_pos) {
    throw py::type_error(call + " takes " + std::to_string(record.nargs_pos - record.is_method) +
                         " arguments without names, not " + std::to_string(positional - record.is_method));
  }
  std::vector<py::handle> given(arguments, arguments + positional);
  given.resize(record.args.size());
  for (std::size_t i = 0; names && i < py::len(names); ++i) {
    const std::string name = py::str(names[py::int_(i)]);
    const auto place = std::ranges::find(record.args, name, &Parameter::name) - record.args.begin();
    if (place == std::ssize(given)) throw py::type_error(call + " has no argument " + shortened(name));
    if (given[place]) throw py::type_error(call + " has the argument " + name + " twice");
    given[place] = arguments[positional + i];
  }
  const std::vector<std::string_view> types = types_of(record);
  std::string out_of_range, list;
  for (std::size_t i = 0; i < given.size(); ++i) {
    const std::string name = record.args[i].name;
    if (!given[i] && !record.args[i].value) throw py::type_error(call + " lacks the argument " + name);
    const bool is_optional = may_be_none(record.args[i], types[i]);
    if (!given[i] || (given[i].is_none() && is_optional)) continue;
    const auto value = py::reinterpret_borrow<py::object>(given[i]);
    const auto [said, is_met] = wanted(types[i], value);
    const std::string expected = "; expected " + said + (is_optional ? " or None" : "");
    if (!is_met) throw py::type_error(name + " is " + type_text(value) + expected);
    if (said == "an integer" && (value < py::int_(INT32_MIN) || value > py::int_(INT32_MAX))) {
      out_of_range = name + " is " + value_text(value) + ", which is out of range";
    } else if (list.empty() && said.find("list") != said.npos) {
      list = name + " does not fit" + expected;
    }
  }
  if (!out_of_range.empty()) throw py::value_error(out_of_range);
  throw py::type_error(list.empty() ? call + " does not take these arguments" : list);
}

using Dispatcher = PyObject* (*)(PyObject*, PyObject* const*, std::size_t, PyObject*);
Dispatcher dispatcher;  // pybind11's, the same for all functions

PyObject* call_and_explain(PyObject* self, PyObject* const* arguments, std::size_t count, PyObject* names) {
  PyObject* const result = dispatcher(self, arguments, count, names);
  if (result || !PyErr_ExceptionMatches(PyExc_TypeError)) return result;
  py::error_already_set raised;
  const std::string said = py::str(raised.value());
  if (said.find("): incompatible ") == said.npos) {
    raised.restore();
    return nullptr;
  }
  try {
    complain(*py::detail::function_record_ptr_from_PyObject(self), arguments, PyVectorcall_NARGS(count), names);
  } catch (const py::builtin_exception& own) {
    own.set_error();
  } catch (const py::error_already_set& own) {
    const std::string type = py::str(own.type().attr("__name__"));
    PyErr_SetString(PyExc_TypeError, ("an argument cannot be looked at: it raises " + type).c_str());
  }
  return nullptr;
}

void explain(py::handle function) {
  if (!PyCFunction_Check(function.ptr()) || !PyCFunction_GET_SELF(function.ptr())) return;
  auto* const record = py::detail::function_record_ptr_from_PyObject(PyCFunction_GET_SELF(function.ptr()));
  if (!record || record->next || record->def->ml_flags != (METH_FASTCALL | METH_KEYWORDS)) return;
  if (record->is_method && record->args.empty()) {                                  // otherwise None is a null `self`
    record->args.emplace_back(strdup("self"), nullptr, py::handle(), true, false);  // pybind11 frees it
  }
  dispatcher = reinterpret_cast<Dispatcher>(reinterpret_cast<void (*)()>(record->def->ml_meth));
  record->def->ml_meth = reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(call_and_explain));
}

}  // namespace

/// Of all functions and methods of a module or class, and of a module's classes.
void explain_arguments(const py::object& owner) {
  for (const auto& [name, member] : py::dict(owner.attr("__dict__"))) {
    py::object own = py::getattr(owner, name);
    if (Py_IS_TYPE(own.ptr(), &PyProperty_Type)) own = own.attr("fget");
    PyType_Check(own.ptr()) ? explain_arguments(own) : explain(py::detail::get_function(own));
  }
}

}  // namespace sinew::bindings
