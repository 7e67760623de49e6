/// How Python passes the module's own objects: never as null, and never one that has no C++ half. What may be None is
/// an OrNone.
#pragma once

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <memory>
#include <optional>
#include <type_traits>

namespace pybind11::detail {

/// Replaces pybind11's own caster, which makes null of a None that is in a list or tuple.
template <class T>
requires std::is_class_v<T>
class type_caster<std::shared_ptr<T>> : public copyable_holder_caster<T, std::shared_ptr<T>> {
 public:
  bool load(handle source, bool convert) {
    if (source.is_none()) return false;
    try {
      return copyable_holder_caster<T, std::shared_ptr<T>>::load(source, convert);
    } catch (const cast_error&) {
      throw type_error("__init__ was not called; call the class itself");
    }
  }
};

}  // namespace pybind11::detail

namespace sinew::bindings {

template <class T>
using OrNone = std::optional<std::shared_ptr<T>>;

}  // namespace sinew::bindings
